"""From a recording to estimates: the one loop that the command line, the demo and the evaluation run."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass

from voodoo._core import Estimate
from voodoo.errors import VoodooError
from voodoo.measurements import RecordedFrame
from voodoo.pipeline.front_end import FrontEnd
from voodoo.pipeline.pairing import paired
from voodoo.pipeline.start import Init, start_tracker
from voodoo.pipeline.starts.chosen import Starts
from voodoo.recordings.recording import Recording
from voodoo.sensors.settings import FrontEndSettings
from voodoo.tracker import Tracker

__all__ = ["Init", "TrackedFrame", "start_tracker", "track"]


@dataclass(frozen=True)
class TrackedFrame:
    """One frame with what the tracker made of it.

    Args:
        index: number in the recording, from 0.
        recorded: the measurements.
        estimate: the pose.
        seconds: wall-clock time from measurements in memory to the estimate [s]; pictures are decoded within it.
        front_end: what made the tracker's frame of them: its rays and skin candidates are those of this frame.
    """

    index: int
    recorded: RecordedFrame
    estimate: Estimate
    seconds: float
    front_end: FrontEnd


def track(
    recording: Recording,
    tracker: Tracker,
    *,
    settings: FrontEndSettings | None = None,
    starts: Starts | None = None,
) -> Iterator[TrackedFrame]:
    """Step the tracker through a recording, by the front end that every command uses.

    Between two yields `tracker` holds the model of the frame yielded last.

    Args:
        recording: read while iterating.
        tracker: see start_tracker; one without a pose searches.
        settings: what is used and how; None means all there is, see FrontEndSettings.of.
        starts: where a first pose may come from; None: from whatever the recording offers.

    Raises:
        VoodooError: damage in the recording, or a frame that the tracker refuses; names the frame.
    """
    front_end = FrontEnd(tracker, settings=settings or FrontEndSettings.of(recording), starts=starts)
    for index, recorded in enumerate(paired(recording)):
        began = time.perf_counter()
        try:
            estimate = front_end.step(recorded)
        except VoodooError as error:
            raise VoodooError(f"{recording.name}, frame {index} (stamp {recorded.stamp:.6f} s): {error}") from error
        yield TrackedFrame(index, recorded, estimate, time.perf_counter() - began, front_end)
