"""Clock of the host; tests substitute a clock that they set."""

from __future__ import annotations

import time
from typing import Protocol


class Clock(Protocol):
    """Interface of a clock: seconds since 1970 that never decrease."""

    def now(self) -> float:
        """The time [s]."""


class HostClock:
    """Host clock: system time at the start plus the time elapsed since then on a monotonic clock."""

    def __init__(self) -> None:
        """Start."""
        self._zero = time.time() - time.monotonic()

    def now(self) -> float:
        """See Clock."""
        return self._zero + time.monotonic()
