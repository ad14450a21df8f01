"""Assigns keypoints in several cameras and skin to single persons, and detects new persons."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from voodoo._core import Frame
from voodoo.errors import MeasurementError
from voodoo.measurements import ColorImage, DepthImage, KeypointImage
from voodoo.people import Followed, People, PeopleEstimate
from voodoo.pipeline.starts.base import StartFrame
from voodoo.pipeline.starts.cameras import everybody
from voodoo.sensors.adapters import Adapter, Context, Memory, adapters_of
from voodoo.sensors.gating import SiteGate
from voodoo.sensors.keypoints.people import assign_keypoints
from voodoo.sensors.pixels import FloatArray
from voodoo.sensors.settings import FrontEndSettings

_SAME_M = 0.4
"""A person found within this distance of a tracked person is the same person."""
_ROOT = "humanoid_root"


@dataclass
class _Person:
    """State of one person that is kept between frames."""

    gate: SiteGate
    memory: Memory = field(default_factory=Memory)

    def __copy__(self) -> _Person:
        return replace(self, gate=copy(self.gate), memory=copy(self.memory))


class PeopleOwn:
    """Assigns keypoints and skin of every image to persons, and adds a new person whom most of the cameras observe.

    Args:
        people: the tracked persons.
        settings: which inputs are used, and with which weights.
    """

    def __init__(self, people: People, settings: FrontEndSettings) -> None:
        """Start without persons."""
        self._people = people
        self._settings = settings
        self._persons: dict[int, _Person] = {}
        self._cameras: set[str] = set()

    def __copy__(self) -> PeopleOwn:
        """A copy with its own memory."""
        twin = PeopleOwn(self._people, self._settings)
        twin._persons = {number: copy(person) for number, person in self._persons.items()}
        twin._cameras = set(self._cameras)
        return twin

    def frames(self, stamp: float, measurements: Iterable[object]) -> dict[int, Frame]:
        """Person number -> their keypoints and skin as rays; new persons are tracked from this frame on.

        Raises:
            MeasurementError: keypoints or an image are invalid.
        """
        used = list(measurements)
        images = [item for item in used if isinstance(item, KeypointImage) and "keypoints" in self._settings.use]
        pictured = [item for item in used if isinstance(item, ColorImage) and self.skin]
        depths = [item for item in used if isinstance(item, DepthImage)]
        self._cameras.update(item.sensor for item in images)
        # `People.only` lets go of persons between two frames.
        kept = [number for number in self._persons if self._people._core.estimate(number) is not None]
        predicted = {number: Followed(self._people, number).predict(stamp) for number in kept}
        assigned = [assign_keypoints(item, predicted) for item in images]
        pictures = {number: [each.of[number] for each in assigned if number in each.of] for number in predicted}
        for number, joints in self._come(stamp, [each.rest for each in assigned], predicted).items():
            predicted[number] = dict(joints)
            rest = [assign_keypoints(each.rest, {number: joints}).of for each in assigned]
            pictures[number] = [of[number] for of in rest if number in of]
        frames = {}
        for number, items in pictures.items():
            if items or pictured:
                frames[number] = self._frame(stamp, number, predicted, [*items, *pictured], depths)
        return frames

    def learn(self, estimate: PeopleEstimate, measurements: Iterable[object]) -> None:
        """Update the positions of all persons and their skin models."""
        pictured = [item for item in measurements if isinstance(item, ColorImage) and self.skin]
        there = {person.id: person.estimate for person in estimate}
        self._persons = {number: kept for number, kept in self._persons.items() if number in there}
        for number, found in there.items():
            person = self._persons.setdefault(number, self._new())
            for item in pictured:
                for adapter in _own_adapters(item, self._settings):
                    adapter.learn(item, found, person.memory, trusted_start=False)

    @property
    def skin(self) -> bool:
        """Whether skin is detected on each person."""
        return "skin" in self._settings.use and self._settings.skin.each

    def _new(self) -> _Person:
        chosen = self._settings
        return _Person(SiteGate(chosen.gate_radius, chosen.gate_growth, chosen.gate_widest))

    def _come(
        self, stamp: float, rest: Sequence[KeypointImage], predicted: Mapping[int, Mapping[str, FloatArray]]
    ) -> dict[int, Mapping[str, FloatArray]]:
        """New persons, with their joints."""
        least = max(2, len(self._cameras) // 2 + 1)
        if sum(bool(item.people) for item in rest) < least:
            return {}
        come: dict[int, Mapping[str, FloatArray]] = {}
        for found in everybody(StartFrame(stamp, rest, self._people.prototype, self._settings), cameras=least):
            middle = np.mean(list(found.joints.values()), axis=0)
            roots = [joints[_ROOT] for joints in [*predicted.values(), *come.values()] if _ROOT in joints]
            if any(np.linalg.norm((middle - root)[:2]) < _SAME_M for root in roots):
                continue
            try:
                number = self._people.add({name: tuple(place) for name, place in found.joints.items()})
            except MeasurementError:
                continue
            come[number] = found.joints
        return come

    def _frame(
        self,
        stamp: float,
        number: int,
        everybody_predicted: Mapping[int, Mapping[str, FloatArray]],
        items: Sequence[KeypointImage | ColorImage],
        depths: Sequence[DepthImage],
    ) -> Frame:
        chosen = self._settings
        person = self._persons.setdefault(number, self._new())
        context = Context(
            stamp=stamp,
            measurements=[*items, *depths],
            predicted=everybody_predicted[number],
            settings=chosen,
            tracker=Followed(self._people, number),
            others=tuple(Followed(self._people, other) for other in everybody_predicted if other != number),
            gate=person.gate,
            memory=person.memory,
        )
        frame = Frame(stamp=stamp)
        for item in items:
            for adapter in _own_adapters(item, chosen):
                adapter.add(frame, item, context)
        context.add_rays(frame)
        return frame


def _own_adapters(item: KeypointImage | ColorImage, settings: FrontEndSettings) -> list[Adapter[Any]]:
    """Adapters whose output belongs to one person; color regions belong to all persons and are not included."""
    return [
        adapter
        for adapter in adapters_of(item)
        if adapter.kind in settings.use and adapter.kind in ("keypoints", "skin")
    ]
