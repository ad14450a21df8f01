"""Queue of arrivals between sources and decoding: keeps the newest frame-defining arrival, and a few of the others."""

from __future__ import annotations

from voodoo.live.mailbox import Closing
from voodoo.live.source import Arrival

_OTHERS = 4
"""Capacity for a sensor that joins frames: a laser may be faster than the camera."""


class Inbox(Closing):
    """A bounded queue of arrivals.

    Attributes:
        dropped: number of frame-defining arrivals that a newer one replaced.
    """

    def __init__(self) -> None:
        """Start empty."""
        super().__init__()
        self.dropped = 0
        self._awake = False
        self._items: list[tuple[Arrival, float]] = []

    def put(self, arrival: Arrival, now: float) -> None:
        """Add an arrival at host time `now` [s]."""
        with self._changed:
            if self._closed:
                return
            same = [number for number, (other, _) in enumerate(self._items) if other.sensor == arrival.sensor]
            if len(same) >= (1 if arrival.drives else _OTHERS):
                del self._items[same[0]]
                self.dropped += arrival.drives
            self._items.append((arrival, now))
            self._changed.notify()

    def wake(self) -> None:
        """Let `take` return without an arrival, now or at its next call: what a waiting frame waits for may be there."""
        with self._changed:
            self._awake = True
            self._changed.notify()

    def take(self, timeout: float) -> list[tuple[Arrival, float]]:
        """All arrivals in order; empty if nothing arrives within `timeout` [s], or after `wake`."""
        with self._changed:
            if not self._awake:
                self._wait(timeout)
            self._awake = False
            items, self._items = self._items, []
            return items
