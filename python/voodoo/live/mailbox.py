"""Bounded queues between stages in which the latest wins: what nobody took in time is dropped and counted."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Sized
from typing import Generic, TypeVar

T = TypeVar("T")


class Closing:
    """What ends in order: nothing more comes in, and what is in it can still be taken."""

    _items: Sized

    def __init__(self) -> None:
        """Open."""
        self._changed = threading.Condition()
        self._closed = False

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

    def _wait(self, timeout: float | None) -> None:
        """Until something is in it, it is closed, or `timeout` [s] is over; the lock is held."""
        if not self._items and not self._closed:
            self._changed.wait(timeout)


class Mailbox(Closing, Generic[T]):
    """A queue of at most `most` items between two threads; the oldest goes when another one comes.

    Args:
        most: how many wait at the same time.

    Attributes:
        dropped: how many went untaken.
    """

    def __init__(self, most: int = 1) -> None:
        """Nothing in it."""
        super().__init__()
        self.dropped = 0
        self._most = most
        self._items: deque[T] = deque()

    def put(self, item: T) -> None:
        """Put an item in; after `close` nothing is taken up."""
        with self._changed:
            if self._closed:
                return
            if len(self._items) >= self._most:
                self._items.popleft()
                self.dropped += 1
            self._items.append(item)
            self._changed.notify()

    def take(self, timeout: float | None = None) -> T | None:
        """The oldest item; None where none comes within `timeout` [s], or the box is closed and empty."""
        with self._changed:
            self._wait(timeout)
            return self._items.popleft() if self._items else None

    def __len__(self) -> int:
        """How many wait."""
        return len(self._items)
