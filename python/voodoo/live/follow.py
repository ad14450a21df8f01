"""Tracks persons through live frames; after a break in the frames the search starts again."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np

from voodoo._core import Detector, Estimate
from voodoo.errors import VoodooError
from voodoo.export.track import Track
from voodoo.export.upright import Turn, by_axes, by_floor, lying_words
from voodoo.live.assembly import LiveFrame
from voodoo.live.stream import Live
from voodoo.measurements import ColorImage, DepthImage, FloatArray
from voodoo.model.body import Body
from voodoo.model.standing import is_optical
from voodoo.people import People, PeopleEstimate, Person, everybody
from voodoo.pipeline.floor import EVERY, FloorSight, detections
from voodoo.pipeline.front_end import FrontEnd
from voodoo.pipeline.starts import FoundStart, Starts
from voodoo.sensors.settings import LEVEL_FRAMES, FrontEndSettings
from voodoo.tracker import Tracker

GONE_S = 5.0
"""After this time without a frame, persons are treated as new, with their own sizes."""
_SIGMA_M = 0.1
"""Standard deviation of a detected joint."""
NEAR_M = 1.0
"""A person is chosen by a place that is at most this far from the nearest joint."""


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
    front_end: FrontEnd[Estimate] | None = None
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

    @property
    def with_pose(self) -> bool:
        """Whether somebody is present."""
        return bool(self.people.persons)


class Follower:
    """Tracks one person or several through live frames.

    Args:
        tracker: tracker of one person; None: `people` is used.
        people: creates the tracker of several persons. After time jumped back, new persons get unused numbers.
        settings: see FrontEndSettings.
        starts: sources of detections; None: every kind of measurement that can give one.
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
        self._make = people
        self._how: dict[str, Any] = {"settings": settings or FrontEndSettings(), "starts": starts}
        first: Any = people() if people else tracker
        self._front: FrontEnd[Any] = FrontEnd(first, **self._how)
        self._numbers = self._most = 0
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
        found = everybody(self._front.step(frame))
        estimates = {self._numbers + person.id: person.estimate for person in found}
        bodies = {self._numbers + number: body for number, body in self._front.bodies.items()}
        self._most = max(self._most, *estimates, 0)
        self._stamp, self._arrived = frame.stamp, frame.arrived
        front_end = None if isinstance(self._front.tracker, People) else self._front
        return Step(frame, estimates, bodies, time.perf_counter() - start, front_end)

    def choose(self, frame: LiveFrame, place: FloatArray) -> str:
        """Follow only the person at a place (3,) [m] in the root frame from now on; returns who that is.

        Of several persons it is one of those who are tracked; a single person is searched for in the depth images of `frame`.

        Raises:
            VoodooError: nobody is within NEAR_M of the place, or the body is no person's; the state is unchanged.
        """
        tracker = self._front.tracker
        if isinstance(tracker, People):
            tracked = [person for person in tracker.estimate if person.estimate.joints]
            bodies = [person.estimate.joints for person in tracked]
        else:
            bodies = [found.joints for found in detections(Detector(), frame)]
        away = [float(np.linalg.norm(np.array(list(body.values())) - place, axis=1).min()) for body in bodies]
        if not away or not min(away) < NEAR_M:
            raise VoodooError(f"expected somebody within {NEAR_M:g} m of {np.round(place, 2).tolist()}, found nobody")
        chosen = int(np.argmin(away))
        if isinstance(tracker, People):
            tracker.only(tracked[chosen].id)
            return f"person {self._numbers + tracked[chosen].id} only"
        tracker.search()
        self._front = FrontEnd(tracker, **self._how)
        self._front.found = FoundStart(bodies[chosen], dict.fromkeys(bodies[chosen], _SIGMA_M), "follow")
        return f"the person {away[chosen]:.2f} m from there"

    def restart(self, *, back: bool, gone: bool) -> None:
        """Continue after a break in the frames.

        The pose is kept, and the tracker detects where it is wrong. After a long gap the search starts again. A body that no
        source can find keeps its position.

        Args:
            back: stamps restart before earlier ones.
            gone: no frame arrived for GONE_S.
        """
        tracker = self._front.tracker
        if not isinstance(tracker, People):
            if not tracker.estimate.joints or (gone and tracker.can_search):
                tracker.search()
            else:
                tracker.reset_pose(dict(tracker.estimate.world_from_limb))
            self._front = FrontEnd(tracker, **self._how)
        elif back and self._make:
            # `People` handles a gap by itself.
            self._numbers = self._most
            self._front = FrontEnd(self._make(), **self._how)


_SIGHTS, _MOST_DETECTIONS = 5, 50
"""After seeing the floor so often, or searching so many frames for it, the search ends."""


class Upright:
    """Finds out how poses are turned: by the floor that is seen in the first frames with a person, until then by the axes.

    Args:
        live: the sources; told what was found, and what speaks against it.
    """

    def __init__(self, live: Live) -> None:
        """Nothing is known yet."""
        self._live = live
        self._turn: Turn | None = None
        self._sight: FloorSight | None = None
        self._estimates: list[Estimate] = []
        self._steps = 0

    def of(self, step: Step) -> Turn:
        """How the root frame of a step is turned."""
        root = self._live.root_frame
        if self._turn is None:
            cameras = [item for item in step.frame.measurements if isinstance(item, DepthImage | ColorImage)]
            own = any(np.array_equal(item.root_from_sensor, np.eye(4)) for item in cameras)
            optical = is_optical(root) or (own and root not in LEVEL_FRAMES)
            self._turn = by_axes(root, optical=optical)
            self._sight = FloorSight() if optical else None
        there = [one for one in step.estimates.values() if one.status != "searching"]
        self._steps += bool(there)
        if not there or self._steps % EVERY or self._steps > _MOST_DETECTIONS * EVERY:
            return self._turn
        self._estimates.append(there[0])
        if self._sight is not None:
            with suppress(VoodooError):  # tracking reports damage
                self._sight.observe(step.frame)
            if len(self._sight.planes) >= _SIGHTS and (floor := self._sight.floor) is not None:
                self._turn, self._sight = by_floor(floor, optical=True), None
                self._live.faults.log(f"outputs but .csv and .npz are turned upright {self._turn.words}")
        if len(self._estimates) == 2 * _SIGHTS and (words := lying_words(Track.of(self._estimates), root, self._turn)):
            self._live.faults.log(words)
        return self._turn
