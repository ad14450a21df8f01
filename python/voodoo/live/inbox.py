"""What the sources hand over, until somebody decodes it: of what makes frames the newest, of the rest the newest few."""

from __future__ import annotations

from voodoo.live.mailbox import Closing
from voodoo.live.source import Arrival

_OTHERS = 4
"""Of a sensor that joins frames: a laser may be faster than the camera."""


class Inbox(Closing):
    """A bounded queue of arrivals.

    Attributes:
        dropped: arrivals that a frame was to be made for, and that a newer one overtook.
    """

    def __init__(self) -> None:
        """Nothing in it."""
        super().__init__()
        self.dropped = 0
        self._items: list[tuple[Arrival, float]] = []

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
            self._wait(timeout)
            items, self._items = self._items, []
            return items
