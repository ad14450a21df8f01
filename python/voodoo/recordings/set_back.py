"""Clocks that were set back while a recording was made: what comes after is moved on, so that time goes on."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from voodoo.errors import RecordingError

BACK_S = 1.0
"""A stamp that is less before the last one is out of order."""


def falls(times: Iterable[tuple[int, int]]) -> bool:
    """Whether, of (connection, time of recording [ns]) as they were written, the times of one connection fall by over BACK_S."""
    last: dict[int, int] = {}
    return any(time < last.get(one, time) - BACK_S * 1e9 or last.update({one: time}) for one, time in times)


def out_of_order(where: object, stamp: float, before: float) -> RecordingError:
    """The error for a stamp [s] that does not rise from the one before."""
    reason = "with a repeated stamp" if stamp == before else "with a stamp before the last one"
    return RecordingError(f"{where}: expected rising stamps, found {stamp:.6f} after {before:.6f}", reason=reason)


@dataclass
class _Sensor:
    last: float
    before: float | None = None
    apart: float | None = None
    steps: int = 0
    moved: float = 0.0
    interval: float = 0.0

    def follows(self, stamp: float, before: float) -> bool:
        """Whether a stamp goes on from one before it; of a slow sensor also at two intervals, of which the shortest is known."""
        return 0.0 < stamp - before < max(BACK_S, 3.0 * self.interval)


class SetBack:
    """Stamps of several sensors, whose clocks may be set back.

    A single stamp that is before the last one of its sensor is out of order. If the next one goes on from it, the clock was set
    back; then this and all later stamps are moved on to where they were expected, by the same amount for all sensors.

    Attributes:
        steps: by how much stamps were moved on each time a clock was set back [s].
        words: the same in words, for whoever reads the stamps.
    """

    def __init__(self, found: SetBack | None = None) -> None:
        """Start with the steps that other sensors have found, and without sensors."""
        self.steps: list[float] = [] if found is None else found.steps
        self.words: list[str] = [] if found is None else found.words
        self._sensors: dict[str, _Sensor] = {}

    def of(self, sensor: str, stamp: float) -> float | None:
        """The stamp [s], moved on; None if it is out of order, by more than BACK_S."""
        state = self._sensors.setdefault(sensor, _Sensor(stamp))
        if stamp < state.last - BACK_S:
            if state.apart is None or not state.follows(stamp, state.apart):
                state.apart = stamp
                return None
            if state.before is None or not state.follows(state.apart, state.before):  # else the last one was wild
                self._step(sensor, state, stamp)
        elif stamp > state.last:
            state.interval = min(state.interval or math.inf, stamp - state.last)
        state.before, state.last, state.apart = state.last, stamp, None
        return stamp + state.moved

    def _step(self, sensor: str, state: _Sensor, stamp: float) -> None:
        assert state.apart is not None
        # The stamp that was put aside had followed the last one as this one follows it.
        own = state.last - state.apart + (stamp - state.apart)
        alike = max(BACK_S, state.interval)
        near = (at for at, one in enumerate(self.steps) if at >= state.steps and abs(one - own) < alike)
        at = next(near, len(self.steps))
        if at == len(self.steps):
            self.steps.append(own)
            self.words.append(
                f"the clock of {sensor} was set back from {state.last:.6f} to {state.apart:.6f} s; "
                f"stamps after that are moved on by {state.moved + own:.6f} s"
            )
        state.steps, state.moved = at + 1, state.moved + self.steps[at]
