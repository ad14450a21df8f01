"""Tracks persons through live frames; after a break in the frames the search starts again."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from voodoo._core import Detector, Estimate
from voodoo.errors import VoodooError
from voodoo.export.upright import Turn
from voodoo.live.assembly import LiveFrame
from voodoo.measurements import FloatArray
from voodoo.model.body import Body
from voodoo.people import People, PeopleEstimate, Person
from voodoo.pipeline.floor import detections
from voodoo.pipeline.front_end import FrontEnd
from voodoo.pipeline.people import PeopleFrontEnd
from voodoo.pipeline.run import decodable
from voodoo.pipeline.starts.base import FoundStart
from voodoo.pipeline.starts.chosen import Starts
from voodoo.sensors.settings import FrontEndSettings
from voodoo.tracker import Tracker

GONE_S = 5.0
"""After this time without a frame, persons are treated as new, with their own sizes."""
NEAR_M = 1.0
"""A person is chosen by a place that is at most this far from the nearest joint."""
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

    def choose(self, frame: LiveFrame, place: FloatArray) -> str:
        """Follow only the person at a place (3,) [m] in the root frame from now on; returns who that is.

        Of several persons it is one of those who are tracked; a single person is searched for in the depth images of `frame`.

        Raises:
            VoodooError: nobody is within NEAR_M of the place, or the body is no person's; the state is unchanged.
        """
        if self._all is not None:
            tracked = [person for person in self._all.people.estimate if person.estimate.joints]
            bodies = [person.estimate.joints for person in tracked]
        else:
            bodies = [found.joints for found in detections(Detector(), frame)]
        away = [float(np.linalg.norm(np.array(list(body.values())) - place, axis=1).min()) for body in bodies]
        if not away or not min(away) < NEAR_M:
            raise VoodooError(f"expected somebody within {NEAR_M:g} m of {np.round(place, 2).tolist()}, found nobody")
        chosen = int(np.argmin(away))
        if self._all is not None:
            self._all.people.only(tracked[chosen].id)
            return f"person {self._numbers + tracked[chosen].id} only"
        assert self._one is not None
        self._one.tracker.reset(joints={name: tuple(at) for name, at in bodies[chosen].items()})
        self._one = FrontEnd(self._one.tracker, settings=self._settings)
        # Found, not given: one who leaves is searched for.
        self._one.search.found = FoundStart(bodies[chosen], {}, "follow")
        return f"the person {away[chosen]:.2f} m from there"

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
