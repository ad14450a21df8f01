"""Stamps decide, not arrival: which measurement is later, repeated, out of order, or by a clock that was set."""

from __future__ import annotations

from dataclasses import dataclass

GAP_S = 1.0
"""After so long without a measurement nobody is where they were: somebody is looked for anew."""
_PASSED = 0.25
"""Stamps that went on by more than a gap, in less than this share of it, were set ahead."""


@dataclass(frozen=True)
class Verdict:
    """What a stamp says.

    Args:
        fault: name in FAULTS, or "".
        usable: whether the measurement is used.
        breaks: time does not go on from the measurement before.
    """

    fault: str = ""
    usable: bool = True
    breaks: bool = False


class Stamps:
    """Judges the stamps of a sensor, one after the other.

    One stamp that is out of order is left out; when the next goes on from there, time has jumped.

    Attributes:
        last: the last one that is used [s].
        period: between the last two [s]; 0 until there are two.
    """

    def __init__(self) -> None:
        """Nothing came yet."""
        self.last: float | None = None
        self.period = 0.0
        self._at = 0.0
        self._apart: float | None = None

    def judge(self, stamp: float, now: float) -> Verdict:
        """Take up a stamp [s] that came at the host's time `now` [s]."""
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
    """The host's time of measurements: their stamps, where these are by the host's clock.

    Stamps by another clock are taken to be as late as the fastest of them arrived: latencies are above the least one then.

    Attributes:
        by_host: whether stamps are by the host's clock.
    """

    NEAR_S = 10.0

    def __init__(self) -> None:
        """Nothing came yet."""
        self.by_host = True
        self._offset: float | None = None

    def of(self, stamp: float, now: float) -> float:
        """When, by the host's clock, something was measured that came just now."""
        if abs(now - stamp) < self.NEAR_S:
            self.by_host, self._offset = True, None
            return min(stamp, now)
        self.by_host = False
        offset = now - stamp
        # A clock that was set starts anew.
        if self._offset is None or abs(offset - self._offset) > self.NEAR_S:
            self._offset = offset
        self._offset = min(self._offset, offset)
        return stamp + self._offset

    def forget(self) -> None:
        """The clock was set."""
        self._offset = None
