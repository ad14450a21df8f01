"""Tracking loop for several persons in a recording."""

from __future__ import annotations

from collections.abc import Iterator
from copy import copy
from dataclasses import dataclass

from voodoo._core import Frame
from voodoo.errors import MeasurementError
from voodoo.measurements import ColorImage, RecordedFrame
from voodoo.model.body import Body
from voodoo.people import People, PeopleEstimate
from voodoo.pipeline.frozen import FrozenSensors
from voodoo.pipeline.people_own import PeopleOwn
from voodoo.pipeline.run import stepped
from voodoo.recordings.left_out import LeftOut
from voodoo.recordings.recording import Recording
from voodoo.sensors.adapters import Context, Memory, adapters_of
from voodoo.sensors.gating import SiteGate
from voodoo.sensors.kinds import inputs_of
from voodoo.sensors.settings import FrontEndSettings
from voodoo.tracker import Tracker


class PeopleFrontEnd:
    """Feeds `voodoo.People` from recorded measurements: depth and other inputs that need no pose, color images, keypoints, skin.

    Args:
        people: the tracked persons.
        settings: see FrontEndSettings.
    """

    def __init__(self, people: People, *, settings: FrontEndSettings | None = None) -> None:
        """Start without measurements."""
        self.people = people
        self.settings = settings or FrontEndSettings()
        self.memory = Memory()
        self.own = PeopleOwn(people, self.settings)
        self._frozen = FrozenSensors()
        # Adapters query the tracked person; here there is no single one.
        self._nobody = Tracker(Body.human())

    def step(self, recorded: RecordedFrame) -> PeopleEstimate:
        """Make the frame and step all persons.

        Raises:
            MeasurementError: a measurement is invalid; the state is unchanged.
        """
        memory, frozen, own = copy(self.memory), copy(self._frozen), copy(self.own)
        try:
            frame = self.frame(recorded)
            estimate = self.people.step(frame, own=self.own.frames(recorded.stamp, self._alive))
        except BaseException:
            self.memory, self._frozen, self.own = memory, frozen, own
            raise
        self.own.learn(estimate, self._alive)
        return estimate

    def frame(self, recorded: RecordedFrame) -> Frame:
        """The frame of all persons, without stepping."""
        chosen = self.settings
        colored = self.people.needs_color
        colors_needed = colored or self.own.skin
        alive = self._alive = self._frozen.without(
            recorded.measurements, use=chosen.use, idle=lambda item: isinstance(item, ColorImage) and not colors_needed
        )
        frame = Frame(stamp=recorded.stamp)
        for low, high in chosen.exclude:
            frame.exclude(low, high)
        if chosen.ground_z is not None:
            frame.set_ground(normal=(0.0, 0.0, 1.0), offset=chosen.ground_z)
        context = Context(
            stamp=recorded.stamp,
            measurements=alive,
            predicted={},
            settings=chosen,
            tracker=self._nobody,
            gate=SiteGate(chosen.gate_radius, chosen.gate_growth, chosen.gate_widest),
            memory=self.memory,
        )
        for item in alive:
            used = [adapter for adapter in adapters_of(item) if adapter.kind in chosen.use]
            for adapter in used:
                if adapter.while_searching:
                    adapter.add(frame, item, context)
            if used and isinstance(item, ColorImage) and colored:
                # Colors of clothes distinguish persons.
                frame.add_color(
                    item.image, camera=item.camera, world_from_sensor=item.root_from_sensor, source=item.sensor
                )
        return frame


@dataclass(frozen=True)
class TrackedPeople:
    """One frame with all persons in it.

    Args:
        index: number in the recording, from 0.
        recorded: the measurements.
        estimate: the persons present and their poses.
        seconds: wall-clock time from measurements in memory to the estimate [s].
    """

    index: int
    recorded: RecordedFrame
    estimate: PeopleEstimate
    seconds: float


def track_people(
    recording: Recording,
    people: People,
    *,
    settings: FrontEndSettings | None = None,
    left_out: LeftOut | None = None,
) -> Iterator[TrackedPeople]:
    """Step through a recording; between two yields `people` holds the bodies of the frame yielded last.

    Args:
        recording: read while iterating.
        people: the tracked persons; new ones are detected in depth images, and in keypoints of several cameras.
        settings: which inputs are used and how; None means all available ones, see FrontEndSettings.of.
        left_out: counts undecodable images and rejected frames, which are then left out; None: they are errors.

    Raises:
        VoodooError: a recording without depth images, a damaged one, or a rejected frame; names the frame.
    """
    chosen = settings or FrontEndSettings.of(recording)
    has = {kind for sensor in recording.info().sensors for kind in inputs_of(sensor.kind)}
    if not {"depth", "keypoints"} & has & set(chosen.use):
        raise MeasurementError(
            f"{recording.name}: several people are found in depth images or keypoints, expected some, found "
            f"{', '.join(sorted(has & set(chosen.use))) or 'none'}"
        )
    front_end = PeopleFrontEnd(people, settings=chosen)
    for index, recorded, estimate, seconds in stepped(recording, front_end.step, left_out):
        yield TrackedPeople(index, recorded, estimate, seconds)
