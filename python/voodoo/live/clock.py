"""The time of the host, which tests replace by one that they set."""

from __future__ import annotations

import time
from typing import Protocol


class Clock(Protocol):
    """Seconds since 1970 that never go back."""

    def now(self) -> float:
        """The time [s]."""


class HostClock:
    """The host's: its time at the start, and what has passed since then by a clock that nobody sets."""

    def __init__(self) -> None:
        """Start."""
        self._zero = time.time() - time.monotonic()

    def now(self) -> float:
        """See Clock."""
        return self._zero + time.monotonic()
