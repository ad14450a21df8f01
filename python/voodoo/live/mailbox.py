"""Bounded queues between stages that keep the newest items: items not taken in time are dropped and counted."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Generic, TypeVar

from voodoo.live.source import Arrival

T = TypeVar("T")
_OTHERS = 4
"""Capacity of an inbox for a sensor that joins frames: a laser may be faster than the camera."""


class Mailbox(Generic[T]):
    """A queue of at most `most` items between two threads; a new item replaces the oldest.

    Args:
        most: capacity.

    Attributes:
        dropped: number of items replaced before they were taken.
    """

    def __init__(self, most: int = 1) -> None:
        """Start empty."""
        self._changed = threading.Condition()
        self._closed = self._awake = False
        self.dropped, self._most = 0, most
        self._items: list[T] = []

    def put(self, item: T) -> None:
        """Add an item; ignored after `close`."""
        with self._changed:
            if not self._closed:
                self._make_room(item)
                self._items.append(item)
                self._changed.notify()

    def _make_room(self, item: T) -> None:
        if len(self._items) >= self._most:
            del self._items[0]
            self.dropped += 1

    def wake(self) -> None:
        """Let a taker return without an item, now or at its next call: what it waits for may be there."""
        with self._changed:
            self._awake = True
            self._changed.notify()

    def close(self) -> None:
        """Accept no more items; the remaining ones can still be taken."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()

    @property
    def closed(self) -> bool:
        """Whether the queue is closed and empty."""
        with self._changed:
            return self._closed and not self._items

    def take(self, timeout: float | None = None) -> T | None:
        """The oldest item; None if none arrives within `timeout` [s], after `wake`, or if it is closed and empty."""
        with self._waiting(timeout) as items:
            return items.pop(0) if items else None

    def take_all(self, timeout: float) -> list[T]:
        """All items in order; empty if nothing arrives within `timeout` [s], or after `wake`."""
        with self._waiting(timeout) as items:
            self._items = []
            return items

    @contextmanager
    def _waiting(self, timeout: float | None) -> Iterator[list[T]]:
        with self._changed:
            if not (self._items or self._closed or self._awake):
                self._changed.wait(timeout)
            self._awake = False
            yield self._items


class Inbox(Mailbox[tuple[Arrival, float]]):
    """A queue of arrivals, with their host times [s]: of each sensor the newest that defines a frame, or a few of the others.

    Attributes:
        dropped: number of frame-defining arrivals that a newer one replaced.
    """

    def _make_room(self, item: tuple[Arrival, float]) -> None:
        arrival, _ = item
        same = [number for number, (other, _) in enumerate(self._items) if other.sensor == arrival.sensor]
        if len(same) >= (1 if arrival.drives else _OTHERS):
            del self._items[same[0]]
            self.dropped += arrival.drives
