"""Groups measurements into frames."""

from __future__ import annotations

from collections.abc import Iterator

from voodoo.measurements import RecordedFrame
from voodoo.recordings.recording import Recording
from voodoo.recordings.together import WAIT_S


def paired(recording: Recording) -> Iterator[RecordedFrame]:
    """The frames of a recording, each with the measurements that follow it within WAIT_S.

    A color image taken a few milliseconds after a depth image belongs to that depth image, not to the next one a whole
    period later. This adds a latency of at most WAIT_S. A frame keeps the stamp of its own measurement. Complete frames are
    not changed.

    Raises:
        RecordingError: the recording is damaged.
    """
    if recording.complete:
        yield from recording
        return
    held: RecordedFrame | None = None
    for recorded in recording:
        if held is not None:
            # The next measurement of a fast sensor, and the measurement that defines a frame, stay in their own frames.
            has = {item.sensor for item in held.measurements}
            early = tuple(
                item
                for item in recorded.measurements[:-1]
                if item.stamp - held.stamp <= WAIT_S and item.sensor not in has
            )
            yield RecordedFrame(held.stamp, held.measurements + early)
            late = tuple(item for item in recorded.measurements if not any(item is other for other in early))
            recorded = RecordedFrame(recorded.stamp, late)
        held = recorded
    if held is not None:
        yield held
