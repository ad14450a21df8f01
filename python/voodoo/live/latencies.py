"""Percentiles of any number of latencies in a few kilobytes, so that a program can run for weeks."""

from __future__ import annotations

import math

import numpy as np

_LEAST_S, _MOST_S, _STEP = 1e-5, 1e3, 1.01
"""From 10 microseconds to 17 minutes in steps of 1 %."""


class Latencies:
    """Histogram of durations with a resolution of 1 %.

    Attributes:
        count: number of durations.
        largest: longest duration [s]; NaN without any.
        last: most recent duration [s]; NaN without any.
    """

    def __init__(self) -> None:
        """Start empty."""
        self.count, self.largest, self.last = 0, math.nan, math.nan
        self._counts = np.zeros(int(math.log(_MOST_S / _LEAST_S) / math.log(_STEP)) + 2, dtype=np.int64)

    def add(self, seconds: float) -> None:
        """Add a duration [s]; values below 10 microseconds, including negative ones, count as 10 microseconds."""
        self.count += 1
        self.last = seconds
        self.largest = seconds if math.isnan(self.largest) else max(self.largest, seconds)
        at = int(math.log(min(max(seconds, _LEAST_S), _MOST_S) / _LEAST_S) / math.log(_STEP))
        self._counts[at] += 1

    def percentile(self, percent: float) -> float:
        """Percentile of the latencies [s] to 1 %, for `percent` from 0 to 100; NaN without any."""
        if not self.count:
            return math.nan
        at = int(np.searchsorted(np.cumsum(self._counts), max(math.ceil(self.count * percent / 100.0), 1)))
        return min(_LEAST_S * _STEP ** (at + 0.5), max(self.largest, _LEAST_S))
