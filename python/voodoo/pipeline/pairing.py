"""Which measurements belong to one frame."""

from __future__ import annotations

from collections.abc import Iterator

from voodoo.measurements import (
    RecordedFrame,
)
from voodoo.recordings.recording import Recording


def paired(recording: Recording, *, wait: float = 0.010) -> Iterator[RecordedFrame]:
    """The frames of a recording, each with the measurements that follow it within `wait` seconds.

    A color picture taken a few milliseconds after a depth image belongs to it, not to the next one a whole period
    later; the price is a latency of at most `wait`. The stamp of a frame stays that of its own measurement. Frames that are
    complete stay as they are.

    Raises:
        RecordingError: damage in the recording.
    """
    if recording.complete:
        yield from recording
        return
    held: RecordedFrame | None = None
    for recorded in recording:
        if held is not None:
            # A fast sensor's next measurement, and the one a frame was made for, stay where they are.
            has = {item.sensor for item in held.measurements}
            early = tuple(
                item
                for item in recorded.measurements[:-1]
                if item.stamp - held.stamp <= wait and item.sensor not in has
            )
            yield RecordedFrame(held.stamp, held.measurements + early)
            late = tuple(item for item in recorded.measurements if not any(item is other for other in early))
            recorded = RecordedFrame(recorded.stamp, late)
        held = recorded
    if held is not None:
        yield held
