"""Clocks that were set back while a recording was made: what comes after is moved on, so that time goes on."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

BACK_S = 1.0
"""A stamp that is less before the last one is out of order."""


def falls(times: Iterable[tuple[int, int]]) -> bool:
    """Whether, of (connection, time of recording [ns]) as they were written, the times of one connection fall by over BACK_S."""
    last: dict[int, int] = {}
    return any(time < last.get(one, time) - BACK_S * 1e9 or last.update({one: time}) for one, time in times)


@dataclass
class _Sensor:
    last: float
    steps: int = 0
    apart: float | None = None


class SetBack:
    """Stamps of several sensors by one clock.

    A single stamp that is before the last one of its sensor is out of order. If the next one goes on from it, the clock was set
    back; then this and all later stamps are moved on to where they were expected, by the same amount for all sensors.

    Attributes:
        steps: by how much stamps are moved on after each time the clock was set back, in all [s].
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
            if state.apart is None or not 0.0 < stamp - state.apart < BACK_S:
                state.apart = stamp
                return None
            if state.steps == len(self.steps):
                # The stamp that was put aside had followed the last one as this one follows it.
                step = state.last - state.apart + (stamp - state.apart)
                self.steps.append(step + (self.steps[-1] if self.steps else 0.0))
                self.words.append(
                    f"the clock of {sensor} was set back from {state.last:.6f} to {state.apart:.6f} s; "
                    f"stamps after that are moved on by {self.steps[-1]:.6f} s"
                )
            state.steps += 1
        state.last, state.apart = stamp, None
        return stamp + (self.steps[state.steps - 1] if state.steps else 0.0)
