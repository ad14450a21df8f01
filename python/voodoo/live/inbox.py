"""What the sources hand over, until somebody decodes it: of what makes frames the newest, of the rest the newest few."""

from __future__ import annotations

import threading

from voodoo.live.source import Arrival

_OTHERS = 4
"""Of a sensor that joins frames: a laser may be faster than the camera."""


class Inbox:
    """A bounded queue of arrivals.

    Attributes:
        dropped: arrivals that a frame was to be made for, and that a newer one overtook.
    """

    def __init__(self) -> None:
        """Nothing in it."""
        self.dropped = 0
        self._items: list[tuple[Arrival, float]] = []
        self._changed = threading.Condition()
        self._closed = False

    def put(self, arrival: Arrival, now: float) -> None:
        """Put in what came at the host's time `now` [s]."""
        with self._changed:
            if self._closed:
                return
            same = [number for number, (other, _) in enumerate(self._items) if other.sensor == arrival.sensor]
            if len(same) >= (1 if arrival.drives else _OTHERS):
                del self._items[same[0]]
                self.dropped += arrival.drives
            self._items.append((arrival, now))
            self._changed.notify()

    def take(self, timeout: float) -> list[tuple[Arrival, float]]:
        """All that came, in the order of arrival; empty where nothing comes within `timeout` [s]."""
        with self._changed:
            if not self._items and not self._closed:
                self._changed.wait(timeout)
            items, self._items = self._items, []
            return items

    def close(self) -> None:
        """Nothing more comes; what is in it can still be taken."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()

    @property
    def closed(self) -> bool:
        """Whether nothing more comes and all was taken."""
        with self._changed:
            return self._closed and not self._items
