"""Order of measurements by stamp, not by arrival: detects repeated stamps, wrong order, and clocks that were set."""

from __future__ import annotations

from dataclasses import dataclass

GAP_S = 1.0
"""After this time without a measurement, persons have moved and the search starts again."""
_PASSED = 0.25
"""If stamps advance by more than a gap while less than this fraction of it has elapsed, the clock was set ahead."""


@dataclass(frozen=True)
class Verdict:
    """Result of checking a stamp.

    Args:
        fault: name in FAULTS, or "".
        usable: whether the measurement is used.
        breaks: time does not continue from the previous measurement.
    """

    fault: str = ""
    usable: bool = True
    breaks: bool = False


class Stamps:
    """Checks the stamps of a sensor, one after the other.

    A single stamp that is out of order is left out; if the next one continues from it, time has jumped.

    Attributes:
        last: last used stamp [s].
        period: difference of the last two [s]; 0 until there are two.
    """

    def __init__(self) -> None:
        """Nothing came yet."""
        self.last: float | None = None
        self.period = 0.0
        self._at = 0.0
        self._apart: float | None = None

    def judge(self, stamp: float, now: float) -> Verdict:
        """Check a stamp [s] that arrived at host time `now` [s]."""
        last, passed = self.last, now - self._at
        if last is None:
            return self._take(stamp, now, Verdict())
        if stamp == last:
            self._apart = None
            return Verdict("repeated stamp", usable=False)
        ahead = stamp - last > GAP_S and passed < _PASSED * (stamp - last)
        if stamp < last or ahead:
            goes_on = self._apart is not None and 0.0 < stamp - self._apart < GAP_S
            if goes_on:
                word = "time jumped ahead" if ahead else "time jumped back"
                return self._take(stamp, now, Verdict(word, breaks=True))
            self._apart = stamp
            return Verdict("late" if not ahead else "", usable=False)
        return self._take(stamp, now, Verdict(breaks=stamp - last > GAP_S))

    def _take(self, stamp: float, now: float, verdict: Verdict) -> Verdict:
        self.period = 0.0 if self.last is None or verdict.breaks else stamp - self.last
        self.last, self._at, self._apart = stamp, now, None
        return verdict


class HostTime:
    """Converts stamps to host time; stamps by the host clock are used unchanged.

    Stamps by another clock are aligned with the fastest arrival, so latencies are relative to the smallest one.

    Attributes:
        by_host: whether stamps are by the host clock.
    """

    NEAR_S = 10.0

    def __init__(self) -> None:
        """Nothing came yet."""
        self.by_host = True
        self._offset: float | None = None

    def of(self, stamp: float, now: float) -> float:
        """Host time of a measurement that has just arrived."""
        if abs(now - stamp) < self.NEAR_S:
            self.by_host, self._offset = True, None
            return min(stamp, now)
        self.by_host = False
        offset = now - stamp
        # After the clock was set, the alignment starts again.
        if self._offset is None or abs(offset - self._offset) > self.NEAR_S:
            self._offset = offset
        self._offset = min(self._offset, offset)
        return stamp + self._offset

    def forget(self) -> None:
        """Reset, because the clock was set."""
        self._offset = None
