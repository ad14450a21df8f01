"""Tracking loop over a recording, which the command line, the demo and the evaluation share."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Generic

from voodoo._core import Estimate
from voodoo.errors import VoodooError
from voodoo.measurements import ROUNDED_S, ColorImage, Measurement, RecordedFrame
from voodoo.people import People
from voodoo.pipeline.front_end import E, FrontEnd, Steps
from voodoo.pipeline.pairing import paired
from voodoo.pipeline.start import Init, check_findable, start_tracker
from voodoo.pipeline.starts import Starts
from voodoo.recordings.left_out import LeftOut
from voodoo.recordings.recording import Recording
from voodoo.sensors.settings import FrontEndSettings
from voodoo.tracker import Tracker

__all__ = ["Init", "TrackedFrame", "decodable", "start_tracker", "track"]


def decodable(measurements: Sequence[Measurement]) -> tuple[tuple[Measurement, ...], list[VoodooError]]:
    """Measurements without the undecodable images, and the reasons; the other measurements remain usable."""
    kept, errors = [], []
    for item in measurements:
        try:
            if isinstance(item, ColorImage):
                _ = item.image
            kept.append(item)
        except VoodooError as error:
            errors.append(error)
    return tuple(kept), errors


@dataclass(frozen=True)
class TrackedFrame(Generic[E]):
    """One frame with its estimate.

    Args:
        index: number in the recording, from 0.
        recorded: the measurements.
        estimate: the estimated pose, or those of all persons.
        seconds: wall-clock time from measurements in memory to the estimate [s]; pictures are decoded within it.
        front_end: the front end that made the tracker's frame; its rays and skin candidates are those of this frame.
    """

    index: int
    recorded: RecordedFrame
    estimate: E
    seconds: float
    front_end: FrontEnd[E]


def track(
    recording: Recording,
    tracker: Steps[E],
    *,
    settings: FrontEndSettings | None = None,
    starts: Starts | None = None,
    left_out: LeftOut | None = None,
    after: float = -math.inf,
) -> Iterator[TrackedFrame[E]]:
    """Step the tracker through a recording, by the front end that every command uses.

    Between two yields `tracker` holds the model of the frame yielded last.

    Args:
        recording: read while iterating.
        tracker: see start_tracker, one without a pose searches; or `People`, whose persons are found as they come.
        settings: which inputs are used and how; None means all available ones, see FrontEndSettings.of.
        starts: sources of detections; None: all that the recording offers.
        left_out: counts undecodable images and frames that the tracker rejects, which are then left out; None: they are errors.
        after: earlier frames are passed over [s].

    Raises:
        VoodooError: the recording is damaged, or the tracker rejects a frame; names the frame.
    """
    settings = settings or FrontEndSettings.of(recording)
    if isinstance(tracker, People):
        check_findable(recording, tracker, settings.use)
    front_end = FrontEnd(tracker, settings=settings, starts=starts)
    for index, recorded in enumerate(paired(recording)):
        if recorded.stamp < after - ROUNDED_S:
            continue
        began = time.perf_counter()
        try:
            estimate = front_end.step(recorded)
        except VoodooError as error:
            if left_out is None:
                raise VoodooError(f"{recording.name}, frame {index} (stamp {recorded.stamp:.6f} s): {error}") from error
            kept, damaged = decodable(recorded.measurements)
            for problem in damaged:
                left_out.add_error(problem)
            recorded = RecordedFrame(recorded.stamp, kept)
            try:
                estimate = front_end.step(recorded)
            except VoodooError as refusal:
                left_out.add("that the tracker refuses", f"{recording.name}, frame {index}: {refusal}")
                continue
        yield TrackedFrame(index, recorded, estimate, time.perf_counter() - began, front_end)


def first_pose(recording: Recording, tracker: Tracker, **how: Any) -> Estimate | None:  # noqa: ANN401 - of track
    """Step a tracker without a pose until a person is found; returns the estimate of that frame, or None.

    Args:
        recording: read while searching.
        tracker: it has a pose afterwards.
        **how: see `track`.

    Raises:
        VoodooError: see `track`.
    """
    return next((step.estimate for step in track(recording, tracker, **how) if step.front_end.posed), None)
