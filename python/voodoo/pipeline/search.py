"""Decides when a body is tracked and when one is searched for: before the first pose, and after the person has left."""

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
"""A body found by a source counts as gone after being lost for this time [s]: neither source nor tracker found it again."""

RESTART_S = 0.5
"""After being lost for this time [s], a body restarts where a source finds it: until then the tracker's own search has
priority."""


class Search:
    """Finds the first pose of a tracker, in frames as they come.

    Args:
        tracker: with or without a pose.
        starts: which sources are used; None: all that a recording offers.

    Attributes:
        posed: whether a body is tracked.
        found: the most recent first pose, if one of the sources found it.
    """

    def __init__(self, tracker: Tracker, starts: Starts | None = None) -> None:
        """See the class."""
        self._tracker = tracker
        self._starts = starts or automatic_starts()
        self.posed = bool(tracker.estimate.joints)
        self.found: FoundStart | None = None
        self._supported: float | None = None

    def search(self, stamp: float, measurements: Sequence[Any], settings: FrontEndSettings) -> bool:
        """Query the sources and reset the tracker to the first pose found; returns whether there is one.

        Raises:
            BodyError, MeasurementError: a given pose does not fit this body.
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
        """Whether the search is active at this time [s]: nobody is tracked, or a body that a source found is lost."""
        if not self.posed:
            return True
        lost = self._lost_for(stamp)
        return lost is not None and lost >= RESTART_S

    @property
    def by_tracker(self) -> bool:
        """Whether the tracker itself searches for a person in the depth images."""
        return self._starts.by_tracker and self._tracker.can_search

    def learn(self, estimate: Estimate) -> Estimate:
        """Update with the estimate of a step. Returns it, or an empty estimate if the person has left.

        A person that a source found has left after being lost for GONE_S. For an auto-initialized track, the tracker decides.
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
        """How long [s] a body that a source found by itself has been lost; None for other bodies."""
        if self.found is None or self._supported is None or any(finder.given for finder in self._starts.finders):
            return None
        return stamp - self._supported


def nobody(stamp: float) -> Estimate:
    """The estimate of a frame in which nobody is tracked: status "searching", no joints, no limbs."""
    return _core._estimate((stamp, SEARCHING, float("nan"), 0), ([], [], [], []), ([], [], [], [], [], [], []))
