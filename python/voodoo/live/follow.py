"""Follows who is seen in live frames; where frames do not go on from those before, somebody is looked for anew."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from voodoo._core import Estimate
from voodoo.errors import VoodooError
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
"""After so long without a frame whoever is there is somebody new, in sizes of their own."""
ONE = 1
"""The number of the person where only one is followed."""


@dataclass(frozen=True, eq=False)
class Step:
    """What became of a frame.

    Args:
        frame: it.
        estimates: number of a person -> their pose; of one person also where nobody was found (status "searching").
        bodies: number of a person -> their body, with current sizes.
        seconds: what tracking took [s].
        front_end: of one person: what made the tracker's frame.
    """

    frame: LiveFrame
    estimates: Mapping[int, Estimate]
    bodies: Mapping[int, Body]
    seconds: float
    front_end: FrontEnd | None = None

    @property
    def stamp(self) -> float:
        """That of the frame [s]."""
        return self.frame.stamp

    @property
    def people(self) -> PeopleEstimate:
        """Those who are there."""
        there = tuple(Person(number, one) for number, one in self.estimates.items() if one.joints)
        return PeopleEstimate(self.stamp, there)


class Follower:
    """One person, or several, through live frames.

    Args:
        tracker: of one person; None: `people` are followed.
        people: makes who follows several; whoever comes after time jumped back has a number that nobody had.
        settings: see FrontEndSettings.
        starts: where one person's first pose may come from; None: from whatever is measured.
    """

    def __init__(
        self,
        tracker: Tracker | None = None,
        *,
        people: Callable[[], People] | None = None,
        settings: FrontEndSettings | None = None,
        starts: Starts | None = None,
    ) -> None:
        """Nothing was seen yet."""
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
        """The pose of everybody at the frame's time.

        Raises:
            VoodooError: a frame that is refused; all is as it was.
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
        """Go on where frames do not go on from those before.

        The pose is kept, and the tracker finds out where it is wrong; after a long gap somebody is looked for anew. A body that
        nobody can look for stays where it was.

        Args:
            back: stamps begin again before those that were seen.
            gone: nothing came for GONE_S.
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
            # Those who follow several bear a gap themselves.
            self._numbers = self._most
            self._all = PeopleFrontEnd(self._make(), settings=self._settings)


def without_damaged(frame: LiveFrame) -> tuple[LiveFrame, list[VoodooError]]:
    """The frame without the pictures that do not decode, and why they do not."""
    kept, errors = decodable(frame.measurements)
    return replace(frame, measurements=kept), errors
