"""Tracks persons through live frames; after a break in the frames the search starts again."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from voodoo._core import Estimate
from voodoo.errors import VoodooError
from voodoo.export.upright import Turn
from voodoo.live.assembly import LiveFrame
from voodoo.model.body import Body
from voodoo.people import People, PeopleEstimate, Person
from voodoo.pipeline.front_end import FrontEnd
from voodoo.pipeline.people import PeopleFrontEnd
from voodoo.pipeline.run import decodable
from voodoo.pipeline.starts.chosen import Starts
from voodoo.sensors.settings import FrontEndSettings
from voodoo.tracker import Tracker

GONE_S = 5.0
"""After this time without a frame, persons are treated as new, with their own sizes."""
ONE = 1
"""Number of the person if only one is tracked."""


@dataclass(frozen=True, eq=False)
class Step:
    """Result of tracking one frame.

    Args:
        frame: the live frame.
        estimates: person number -> pose; with a single tracked person also if nobody was found (status "searching").
        bodies: person number -> body, with current sizes.
        seconds: duration of tracking [s].
        front_end: for a single person: the front end that made the tracker's frame.
        turn: how outputs turn the root frame upright; None: by its axes if it is an optical frame by its name.
    """

    frame: LiveFrame
    estimates: Mapping[int, Estimate]
    bodies: Mapping[int, Body]
    seconds: float
    front_end: FrontEnd | None = None
    turn: Turn | None = None

    @property
    def stamp(self) -> float:
        """Stamp of the frame [s]."""
        return self.frame.stamp

    @property
    def people(self) -> PeopleEstimate:
        """The persons present."""
        there = tuple(Person(number, one) for number, one in self.estimates.items() if one.joints)
        return PeopleEstimate(self.stamp, there)


class Follower:
    """Tracks one person or several through live frames.

    Args:
        tracker: tracker of one person; None: `people` is used.
        people: creates the tracker of several persons. After time jumped back, new persons get unused numbers.
        settings: see FrontEndSettings.
        starts: sources of the first pose of a single person; None: every kind of measurement that can give one.
    """

    def __init__(
        self,
        tracker: Tracker | None = None,
        *,
        people: Callable[[], People] | None = None,
        settings: FrontEndSettings | None = None,
        starts: Starts | None = None,
    ) -> None:
        """Start without frames."""
        if (tracker is None) == (people is None):
            raise VoodooError("follower: expected a tracker or people, found both or neither")
        self._settings = settings or FrontEndSettings()
        self._make = people
        self._one = None if tracker is None else FrontEnd(tracker, settings=self._settings, starts=starts)
        self._all = None if people is None else PeopleFrontEnd(people(), settings=self._settings)
        self._numbers = 0
        self._most = 0
        self._stamp: float | None = None
        self._arrived = 0.0

    def step(self, frame: LiveFrame) -> Step:
        """Estimate the pose of all persons at the time of the frame.

        Raises:
            VoodooError: the frame is rejected; the state is unchanged.
        """
        start = time.perf_counter()
        if frame.breaks and self._stamp is not None:
            self.restart(back=frame.stamp <= self._stamp, gone=frame.arrived - self._arrived > GONE_S)
        if self._one is not None:
            estimate = self._one.step(frame)
            body = self._one.tracker.body
            found: tuple[dict[int, Estimate], dict[int, Body]] = {ONE: estimate}, {ONE: body}
        else:
            found = self._step_people(frame)
        self._stamp, self._arrived = frame.stamp, frame.arrived
        return Step(frame, *found, time.perf_counter() - start, self._one)

    def _step_people(self, frame: LiveFrame) -> tuple[dict[int, Estimate], dict[int, Body]]:
        assert self._all is not None
        estimate = self._all.step(frame)
        numbers = {person.id: self._numbers + person.id for person in estimate}
        self._most = max(self._most, *numbers.values(), 0)
        bodies = {numbers[person.id]: self._all.people.body(person.id) for person in estimate}
        return {numbers[person.id]: person.estimate for person in estimate}, bodies

    def restart(self, *, back: bool, gone: bool) -> None:
        """Continue after a break in the frames.

        The pose is kept, and the tracker detects where it is wrong. After a long gap the search starts again. A body that no
        source can find keeps its position.

        Args:
            back: stamps restart before earlier ones.
            gone: no frame arrived for GONE_S.
        """
        if self._one is not None:
            tracker = self._one.tracker
            if not tracker.estimate.joints or (gone and tracker.can_search):
                tracker.search()
            else:
                poses = dict(tracker.estimate.world_from_limb)
                tracker = Tracker(tracker.body, config=tracker.config, detector=tracker.detector)
                tracker.reset_pose(poses)
            self._one = FrontEnd(tracker, settings=self._settings)
        elif self._make is not None and back:
            # `People` handles a gap by itself.
            self._numbers = self._most
            self._all = PeopleFrontEnd(self._make(), settings=self._settings)


def without_damaged(frame: LiveFrame) -> tuple[LiveFrame, list[VoodooError]]:
    """The frame without the undecodable images, and the reasons."""
    kept, errors = decodable(frame.measurements)
    return replace(frame, measurements=kept), errors
