"""Tracking loop for several persons in a recording."""

from __future__ import annotations

from collections.abc import Iterator
from copy import copy
from dataclasses import dataclass

from voodoo._core import Frame
from voodoo.errors import BodyError, MeasurementError
from voodoo.measurements import ColorImage, RecordedFrame
from voodoo.model.body import Body
from voodoo.people import People, PeopleEstimate
from voodoo.pipeline.frozen import FrozenSensors
from voodoo.pipeline.people_own import PeopleOwn
from voodoo.pipeline.run import stepped
from voodoo.recordings.left_out import LeftOut
from voodoo.recordings.recording import Recording
from voodoo.sensors.adapters import Context, Memory, adapters_of, all_adapters
from voodoo.sensors.gating import SiteGate
from voodoo.sensors.kinds import inputs_of
from voodoo.sensors.settings import FrontEndSettings
from voodoo.tracker import Tracker

_SERVED = frozenset({"keypoints", "skin", "color"})
"""Inputs that are assigned to persons, beside those whose adapters need no person."""


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
        context = Context(
            stamp=recorded.stamp,
            measurements=alive,
            predicted={},
            settings=chosen,
            tracker=self._nobody,
            gate=SiteGate(chosen.gate_radius, chosen.gate_growth, chosen.gate_widest),
            memory=self.memory,
        )
        frame = Frame(stamp=recorded.stamp)
        context.add_scene(frame)
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


def check_inputs(recording: Recording, people: People, settings: FrontEndSettings) -> None:
    """Raise an error if an input cannot be used for several persons, or nobody can be found.

    Raises:
        MeasurementError: neither depth images nor keypoints, or an input whose adapter needs to know the person.
        BodyError: a body that the detector does not know, with depth images alone.
    """
    has = {kind for sensor in recording.info().sensors for kind in inputs_of(sensor.kind)} & set(settings.use)
    finding = {"depth", "keypoints"} & has
    if not finding:
        raise MeasurementError(
            f"{recording.name}: several people are found in depth images or keypoints, expected some, found "
            f"{', '.join(sorted(has)) or 'none'}"
        )
    served = {adapter.kind for adapter in all_adapters() if adapter.while_searching} | _SERVED
    if unserved := sorted(has - served):
        raise MeasurementError(
            f"{recording.name}: expected inputs that serve several people, found {', '.join(unserved)}, which are of one "
            f"person; --use {','.join(sorted(has & served))} leaves them out"
        )
    searching = people.detector is not None and not len(people.estimate)
    if finding == {"depth"} and searching and not Tracker(people.prototype, detector=people.detector).can_search:
        raise BodyError(
            f"{recording.name}: expected a body with joints that the detector of persons knows, found "
            f"{people.prototype.name!r}; one such body is tracked from --init FILE"
        )


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
        VoodooError: inputs or a body that do not serve several persons, see `check_inputs`; a damaged recording, or a rejected
            frame; names the frame.
    """
    chosen = settings or FrontEndSettings.of(recording)
    check_inputs(recording, people, chosen)
    front_end = PeopleFrontEnd(people, settings=chosen)
    for index, recorded, estimate, seconds in stepped(recording, front_end.step, left_out):
        yield TrackedPeople(index, recorded, estimate, seconds)
