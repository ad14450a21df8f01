"""When a body is tracked, and when one is looked for: the state before the first pose, and after the person is gone."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import voodoo._core as _core
from voodoo._core import Estimate
from voodoo.errors import MeasurementError
from voodoo.names import SEARCHING
from voodoo.pipeline.starts.base import FoundStart, StartFinder, StartFrame
from voodoo.pipeline.starts.chosen import Starts, automatic_starts
from voodoo.sensors.settings import FrontEndSettings
from voodoo.tracker import Tracker

GONE_S = 3.0
"""A body that a source found is gone when it was lost for so long [s]: neither source nor tracker found it again."""

RESTART_S = 0.5
"""A body that was lost for so long [s] starts anew where a source finds it: the tracker's own search has had its turn."""


class Search:
    """Finds the first pose of a tracker, in frames as they come.

    Args:
        tracker: with a pose, or without one.
        starts: which sources are asked; None: whatever a recording offers.

    Attributes:
        posed: whether a body is tracked.
        found: the first pose that was taken last, if one of the sources found it.
    """

    def __init__(self, tracker: Tracker, starts: Starts | None = None) -> None:
        """See the class."""
        self._tracker = tracker
        self._starts = starts or automatic_starts()
        self.posed = bool(tracker.estimate.joints)
        self.found: FoundStart | None = None
        self._supported: float | None = None

    def __copy__(self) -> Search:
        """The same; what finders have seen is shared."""
        twin = object.__new__(Search)
        vars(twin).update(vars(self))
        return twin

    def search(self, stamp: float, measurements: Sequence[Any], settings: FrontEndSettings) -> bool:
        """Ask the sources, and put the tracker where one of them found somebody; whether one did.

        Raises:
            BodyError, MeasurementError: a given pose that is none of this body.
        """
        frame = StartFrame(stamp, measurements, self._tracker.body, settings)
        for finder in self._starts.finders:
            found = finder.find(frame)
            if found is not None and self._take(found, finder):
                self.posed, self.found, self._supported = True, found, None
                return True
        return False

    def _take(self, found: FoundStart, finder: StartFinder) -> bool:
        try:
            self._tracker.reset(joints={name: tuple(place) for name, place in found.joints.items()}, fit_sizes=True)
        except MeasurementError:
            if finder.given:
                raise
            return False
        return True

    def is_due(self, stamp: float) -> bool:
        """Whether somebody is looked for at this time [s]: nobody is tracked, or a body that a source found is lost."""
        if not self.posed:
            return True
        lost = self._lost_for(stamp)
        return lost is not None and lost >= RESTART_S

    @property
    def by_tracker(self) -> bool:
        """Whether the tracker looks for somebody in the depth images itself."""
        return self._starts.by_tracker and self._tracker.can_search

    def learn(self, estimate: Estimate) -> Estimate:
        """Take up what a step found; the same, or an estimate of nobody where the person is gone for good.

        A person that a source found is gone when lost for GONE_S; of one that it found itself the tracker tells.
        """
        if str(estimate.status) == SEARCHING:
            self.posed, self.found = False, None
            return estimate
        self.posed = True
        if str(estimate.status) != "lost" or self._supported is None:
            self._supported = estimate.stamp
        lost = self._lost_for(estimate.stamp)
        if lost is not None and lost >= GONE_S:
            self._tracker.search()
            self.posed, self.found = False, None
            return nobody(estimate.stamp)
        return estimate

    def _lost_for(self, stamp: float) -> float | None:
        """For how long [s] a body that a source found by itself has been lost; None of other bodies."""
        if self.found is None or self._supported is None or any(finder.given for finder in self._starts.finders):
            return None
        return stamp - self._supported


def nobody(stamp: float) -> Estimate:
    """The estimate of a frame in which nobody is tracked: status "searching", no joints, no limbs."""
    return _core._estimate((stamp, SEARCHING, float("nan"), 0), ([], [], [], []), ([], [], [], [], [], [], []))
