"""Bounded queues between stages that keep the newest items: items not taken in time are dropped and counted."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Sized
from typing import Generic, TypeVar

T = TypeVar("T")


class Closing:
    """Base class of queues with an orderly end: no more items are accepted, and the remaining ones can still be taken."""

    _items: Sized

    def __init__(self) -> None:
        """Start open."""
        self._changed = threading.Condition()
        self._closed = False

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

    def _wait(self, timeout: float | None) -> None:
        """Wait until there is an item, the queue is closed, or `timeout` [s] is over; the caller holds the lock."""
        if not self._items and not self._closed:
            self._changed.wait(timeout)


class Mailbox(Closing, Generic[T]):
    """A queue of at most `most` items between two threads; a new item replaces the oldest.

    Args:
        most: capacity.

    Attributes:
        dropped: number of items replaced before they were taken.
    """

    def __init__(self, most: int = 1) -> None:
        """Start empty."""
        super().__init__()
        self.dropped = 0
        self._most = most
        self._items: deque[T] = deque()

    def put(self, item: T) -> None:
        """Add an item; ignored after `close`."""
        with self._changed:
            if self._closed:
                return
            if len(self._items) >= self._most:
                self._items.popleft()
                self.dropped += 1
            self._items.append(item)
            self._changed.notify()

    def take(self, timeout: float | None = None) -> T | None:
        """The oldest item; None if none arrives within `timeout` [s], or the mailbox is closed and empty."""
        with self._changed:
            self._wait(timeout)
            return self._items.popleft() if self._items else None

    def __len__(self) -> int:
        """Number of waiting items."""
        return len(self._items)
