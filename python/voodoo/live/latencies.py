"""Percentiles of any number of latencies in a few kilobytes: a program that runs for weeks keeps no list."""

from __future__ import annotations

import math

import numpy as np

_LEAST_S, _MOST_S, _STEP = 1e-5, 1e3, 1.01
"""From 10 microseconds to 17 minutes in steps of 1 %."""


class Latencies:
    """How long things took: counts by size, to 1 %.

    Attributes:
        count: how many.
        largest: the longest [s]; NaN without any.
        last: the latest [s]; NaN without any.
    """

    def __init__(self) -> None:
        """None yet."""
        self.count, self.largest, self.last = 0, math.nan, math.nan
        self._counts = np.zeros(int(math.log(_MOST_S / _LEAST_S) / math.log(_STEP)) + 2, dtype=np.int64)

    def add(self, seconds: float) -> None:
        """Count one [s]; what is below 10 microseconds, or negative, counts as that."""
        self.count += 1
        self.last = seconds
        self.largest = seconds if math.isnan(self.largest) else max(self.largest, seconds)
        at = int(math.log(min(max(seconds, _LEAST_S), _MOST_S) / _LEAST_S) / math.log(_STEP))
        self._counts[at] += 1

    def percentile(self, percent: float) -> float:
        """The latency [s] that `fraction` (0 to 100) percent do not exceed, to 1 %; NaN without any."""
        if not self.count:
            return math.nan
        at = int(np.searchsorted(np.cumsum(self._counts), max(math.ceil(self.count * percent / 100.0), 1)))
        return min(_LEAST_S * _STEP ** (at + 0.5), max(self.largest, _LEAST_S))
