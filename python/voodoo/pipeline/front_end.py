"""Converts recorded measurements to the tracker's `Frame`: prediction, gates, agreement of rays, weights from standard
deviations, detections where nobody is tracked. All commands use this front end, for one person and for several.

Sensor-specific code is in the adapters, see `voodoo.sensors.adapters`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from math import inf
from typing import Any, Generic, Protocol, TypeVar, cast

import numpy as np

import voodoo._core as _core
from voodoo._core import Estimate, Frame
from voodoo.measurements import RecordedFrame
from voodoo.model.body import Body
from voodoo.names import SEARCHING
from voodoo.people import ONE, Followed, People, PeopleEstimate, everybody
from voodoo.pipeline.frozen import FrozenSensors
from voodoo.pipeline.pairing import paired
from voodoo.pipeline.starts import FoundStart, StartFrame, Starts
from voodoo.sensors.adapters import NOBODY, Context, Memory, adapters_of, all_adapters
from voodoo.sensors.gating import SiteGate
from voodoo.sensors.keypoints.sites import KeypointReport
from voodoo.sensors.rays import SiteRay
from voodoo.sensors.settings import FrontEndSettings
from voodoo.sensors.skin.tracker import SkinTracker
from voodoo.tracker import Tracker

__all__ = ["FrontEnd", "FrontEndSettings", "nobody", "paired"]

E = TypeVar("E", Estimate, PeopleEstimate)
E_co = TypeVar("E_co", Estimate, PeopleEstimate, covariant=True)


class Steps(Protocol[E_co]):
    """A `Tracker` or `People`, by what it estimates."""

    def step(self, frame: Frame, /) -> E_co:
        """Estimate the time of the frame."""


@dataclass
class _Person:
    """State of one person that is kept between frames."""

    gate: SiteGate
    memory: Memory
    trusted_start: bool

    def __copy__(self) -> _Person:
        return replace(self, gate=copy(self.gate), memory=copy(self.memory))


class FrontEnd(Generic[E]):
    """Feeds a tracker of one person, or of several, from recorded measurements of any kind.

    Args:
        tracker: a `Tracker`, with a pose or without one, or `People`.
        settings: see FrontEndSettings.
        starts: sources of detections beside the tracker's own detector; None: every kind of measurement that can give one.

    Attributes:
        found: the detection by which a `Tracker` got its pose; None for one that was set, or found by the tracker's own detector.
            Set it before a frame to let a `Tracker` without a pose follow that person.
        memory: state that the adapters keep between frames; of several persons each has a memory of their own.
        rays: rays of the last frame, with their trust.
    """

    def __init__(
        self, tracker: Steps[E], *, settings: FrontEndSettings | None = None, starts: Starts | None = None
    ) -> None:
        """Start from the current state of the tracker."""
        self.tracker = cast(Tracker | People, tracker)
        self.settings = settings or FrontEndSettings()
        self.memory = Memory()
        self.rays: list[SiteRay] = []
        self.found: FoundStart | None = None
        self._starts = starts or Starts()
        self._frozen = FrozenSensors()
        self._alive: Sequence[Any] = ()
        self._persons: dict[int, _Person] = {}
        self._lost = False
        # Adapters of the scene query the tracked person; of several there is no single one.
        self._single = Tracker(self.tracker.prototype) if isinstance(self.tracker, People) else self.tracker
        if self._single.estimate.joints:
            self._persons[ONE] = self._new(trusted_start=True)

    @property
    def posed(self) -> bool:
        """Whether anybody is tracked."""
        return bool(self._persons)

    @property
    def bodies(self) -> dict[int, Body]:
        """Number -> body, with current sizes, of the persons of the last frame; until the next one."""
        if isinstance(self.tracker, People):
            return {person.id: self.tracker.body(person.id) for person in self.tracker.estimate}
        return {ONE: self.tracker.body}

    @property
    def frozen(self) -> tuple[str, ...]:
        """Sensors that repeated their measurement in the last frame and were left out."""
        return self._frozen.names

    @property
    def reports(self) -> dict[str, KeypointReport]:
        """Outcome of the keypoints in each sensor's last image."""
        return self.memory.all("keypoints")

    @property
    def skin(self) -> dict[str, SkinTracker]:
        """The skin cue of each color camera."""
        return self.memory.all("skin")

    def step(self, recorded: RecordedFrame) -> E:
        """Make the frame, step the tracker, and learn from the estimate.

        Returns:
            The estimate. That of a `Tracker` has the status "searching" and no joints if no person was found yet, or the
            person has left.

        Raises:
            MeasurementError: a measurement is invalid.
            BodyError: a given first pose names a site that the body does not have.
            RecordingError: an image cannot be decoded.

        After an error, tracker and front end are unchanged, except that the finders of `starts` may have seen the frame.
        """
        before = self._state()
        try:
            frame, own, detected = self._frames(recorded)
            if isinstance(self.tracker, People):
                estimate: Estimate | PeopleEstimate = self.tracker.step(frame, own=own)
            elif self._persons or detected or (self._starts.by_tracker and self.tracker.can_search):
                estimate = self.tracker.step(frame)
            else:
                estimate = nobody(recorded.stamp)
        except BaseException:
            if not isinstance(self.tracker, People) and self._persons and not before["_persons"]:
                self.tracker.search()
            vars(self).update(before)
            raise
        self._learn(estimate, trusted_start=detected)
        return cast(E, estimate)

    def frame(self, recorded: RecordedFrame) -> Frame:
        """Make the tracker's frame without stepping; that of several persons lacks what belongs to one of them."""
        return self._frames(recorded)[0]

    def _frames(self, recorded: RecordedFrame) -> tuple[Frame, dict[int, Frame], bool]:
        """The frame, those of single persons, and whether there are detections in it."""
        stamp, use, alone = recorded.stamp, self.settings.use, not isinstance(self.tracker, People)
        clothes = not alone and self.settings.clothes and cast(People, self.tracker).needs_color
        unused = not (alone or clothes or ("skin" in use and self.settings.skin.each))
        alive = self._frozen.without(recorded.measurements, use=use, idle=lambda item: unused and _is_colored(item))
        self._alive = alive = [self._ready(item) for item in alive]
        used = [
            item
            for item in alive
            if any(adapter.kind in use for adapter in adapters_of(item)) or (clothes and _is_colored(item))
        ]
        self._take_given(stamp, used)
        persons = self._contexts(stamp)
        frame = Frame(stamp=stamp)
        scene = next(iter(persons.values())) if alone and persons else self._context(stamp, self._single)
        scene.add_scene(frame)
        own = {number: frame if alone else Frame(stamp=stamp) for number in persons}
        spare: list[Any] = []
        filled: set[int] = set()
        item: Any
        for item in used:
            for adapter in adapters_of(item):
                if adapter.kind not in use:
                    continue
                if adapter.while_searching:
                    adapter.add(frame, item, scene)
                    spare.append(item)
                    continue
                shares: Mapping[int, Any] = dict.fromkeys(persons, item)
                if not alone:
                    shares = adapter.shares(item, persons) if persons else {NOBODY: item}
                for number, part in shares.items():
                    if number == NOBODY:
                        spare.append(part)
                    else:
                        adapter.add(own[number], part, persons[number])
                        filled.add(number)
            if clothes and _is_colored(item):
                # Colors of clothes distinguish persons.
                frame.add_color(
                    item.image, camera=item.camera, world_from_sensor=item.root_from_sensor, source=item.sensor
                )
        self.rays = [ray for number, context in persons.items() for ray in context.add_rays(own[number])]
        if alone:
            spare = [] if persons and not self._lost else used
        detected = self._detect(frame, spare)
        return frame, {number: own[number] for number in sorted(filled)}, detected

    def _ready(self, item: Any) -> Any:  # noqa: ANN401 - a measurement of any kind
        """A measurement as its adapters use it."""
        for adapter in adapters_of(item):
            if adapter.kind in self.settings.use:
                item = adapter.ready(item, self.settings)
        return item

    def _contexts(self, stamp: float) -> dict[int, Context]:
        """What the adapters may read about every person who is tracked."""
        bodies: dict[int, Tracker | Followed] = dict.fromkeys(self._persons, self._single)
        if isinstance(self.tracker, People):
            bodies = {number: Followed(self.tracker, number) for number in self.tracker.numbers}
        everybody = {}
        for number, body in bodies.items():
            if number not in self._persons:
                self._persons[number] = self._new(trusted_start=False)
            others = [other for other in bodies.values() if other is not body and isinstance(other, Followed)]
            everybody[number] = self._context(stamp, body, self._persons[number], others)
        return everybody

    def _context(
        self, stamp: float, tracker: Tracker | Followed, person: _Person | None = None, others: Sequence[Followed] = ()
    ) -> Context:
        return Context(
            stamp=stamp,
            measurements=self._alive,
            predicted=tracker.predict(stamp) if person else {},
            settings=self.settings,
            tracker=tracker,
            gate=person.gate if person else SiteGate(),
            memory=person.memory if person else self.memory,
            others=others,
        )

    def _new(self, *, trusted_start: bool) -> _Person:
        memory = Memory() if isinstance(self.tracker, People) else self.memory
        return _Person(SiteGate(), memory, trusted_start)

    def _take_given(self, stamp: float, used: Sequence[Any]) -> None:
        """Set the pose of a `Tracker` that was given for this frame."""
        if isinstance(self.tracker, People) or self._persons:
            return
        for finder in self._starts.finders:
            if finder.given and (found := finder.find(StartFrame(stamp, used, self.tracker.body, self.settings))):
                self.tracker.reset(joints={name: tuple(at) for name, at in found[0].joints.items()}, fit_sizes=True)
                self._persons[ONE] = self._new(trusted_start=True)

    def _detect(self, frame: Frame, spare: Sequence[Any]) -> bool:
        """Add the persons who are found in measurements that belong to nobody; returns whether there are any."""
        found: Sequence[FoundStart] = [] if self.found is None or self._persons else [self.found]
        if not (spare or found):
            return False
        alone = not isinstance(self.tracker, People)
        for finder in self._starts.finders:
            if not found and not finder.given:
                found = finder.find(StartFrame(frame.stamp, spare, self._single.body, self.settings))
        # A single person is there; of several detections the best one is followed.
        for one in found[:1] if alone else found:
            weight = self.settings.model.weight(float(np.median(list(one.sigma.values()))))
            frame.add_detection(one.joints, log_odds=inf if alone else one.log_odds, weight=weight, source=one.by)
        self.found = found[0] if alone and found else self.found
        return bool(found)

    def _learn(self, estimate: Estimate | PeopleEstimate, *, trusted_start: bool) -> None:
        """Update what is kept of the persons who are there, and forget the others."""
        there = {person.id: person.estimate for person in everybody(estimate) if person.status != SEARCHING}
        self._lost = any(found.status == "lost" for found in there.values())
        if self._persons and not there:
            # The next person moves and looks different.
            for adapter in all_adapters():
                adapter.forget(self.memory)
        self.found = self.found if there else None
        self.rays = self.rays if there else []
        self._persons = {number: person for number, person in self._persons.items() if number in there}
        for number, found in there.items():
            if number not in self._persons:
                self._persons[number] = self._new(trusted_start=trusted_start)
            person = self._persons[number]
            for item in self._alive:
                for adapter in adapters_of(item):
                    adapter.learn(item, found, person.memory, trusted_start=person.trusted_start)
            person.trusted_start = False

    def _state(self) -> dict[str, Any]:
        """Snapshot of all state that a frame changes."""
        kept = {name: copy(vars(self)[name]) for name in ("memory", "_frozen")}
        persons = {number: copy(person) for number, person in self._persons.items()}
        if not isinstance(self.tracker, People):
            persons = {number: replace(person, memory=kept["memory"]) for number, person in persons.items()}
        return {**kept, "_persons": persons, "rays": self.rays, "found": self.found, "_lost": self._lost}


def _is_colored(item: Any) -> bool:  # noqa: ANN401
    return any(adapter.colored for adapter in adapters_of(item))


def nobody(stamp: float) -> Estimate:
    """The estimate of a frame in which nobody is tracked: status "searching", no joints, no limbs."""
    return _core._estimate({"stamp": stamp}, (), (), (), ())
