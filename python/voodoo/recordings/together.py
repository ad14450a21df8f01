"""Groups measurements into frames: one for each of the sensor that defines them."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise

from voodoo.errors import RecordingError
from voodoo.measurements import Measurement, RecordedFrame

FARTHEST_S = 0.25
"""An image with a larger time difference [s] belongs to no frame, even at low frame rates: the pose differs, and the tracker
would reject the frame."""
WAIT_S = 0.010
"""How long a frame waits for measurements that belong to it [s]."""
_AHEAD = 2


def in_turn(items: Iterable[Measurement], driver: str) -> Iterator[RecordedFrame]:
    """A frame for each measurement of one sensor, which is its last one, with those of the others since the one before; in the
    last frame also those that follow it within WAIT_S, since there is no other for them."""
    pending: list[Measurement] = []
    held: RecordedFrame | None = None
    before = -math.inf
    try:
        for item in items:
            pending.append(item)
            if item.sensor == driver:
                if held is not None:
                    yield held
                    before = held.stamp
                held = RecordedFrame(item.stamp, tuple(pending))
                pending.clear()
    except RecordingError:
        if held is not None:
            yield held
        raise
    if held is not None:
        yield _with_rest(held, pending, before)


def _with_rest(last: RecordedFrame, rest: Sequence[Measurement], before: float) -> RecordedFrame:
    """The last frame with measurements after it, of sensors that have none in it but those that follow the frame before."""
    own = {item.sensor for item in last.measurements if item.stamp - before > WAIT_S}
    near = tuple(item for item in rest if item.stamp - last.stamp <= WAIT_S and item.sensor not in own)
    return RecordedFrame(last.stamp, (*last.measurements[:-1], *near, *last.measurements[-1:]))


def together(items: Iterable[Measurement], first: str) -> Iterator[RecordedFrame]:
    """Frames of the images of the first camera; images of the others within half an interval belong to them.

    Args:
        items: in the order in which they were recorded; stamps of each camera rise.
        first: sensor whose images define the frames.

    Yields:
        Frames with at most one image of each camera, that of the first camera last. The interval is the shorter one to the
        previous and the next image. An image that arrives after the second next one of the first camera is left out.
    """
    waiting: deque[Measurement] = deque()
    others: dict[str, deque[Measurement]] = {}
    before: list[float] = []

    def frame() -> RecordedFrame:
        stamps = [*before, *(item.stamp for item in waiting)]
        this = waiting.popleft()
        before[:] = [this.stamp]
        half = min([FARTHEST_S, *(0.5 * (b - a) for a, b in pairwise(stamps))])
        found = [_nearest(queue, this.stamp, half) for queue in others.values()]
        beside = sorted((item for item in found if item is not None), key=lambda item: (item.stamp, item.sensor))
        return RecordedFrame(this.stamp, (*beside, this))

    for item in items:
        if item.sensor != first:
            others.setdefault(item.sensor, deque()).append(item)
            continue
        waiting.append(item)
        if len(waiting) > _AHEAD:
            yield frame()
    while waiting:
        yield frame()


def _nearest(queue: deque[Measurement], stamp: float, half: float) -> Measurement | None:
    """Remove the images older than half an interval after a time; returns the nearest one, if it is within half an interval."""
    taken = []
    while queue and queue[0].stamp < stamp + half:
        taken.append(queue.popleft())
    near = [item for item in taken if item.stamp >= stamp - half]
    return min(near, key=lambda item: abs(item.stamp - stamp)) if near else None
