"""Units in which stamps are written, and what the time between frames says of them."""

from __future__ import annotations

import math
from collections.abc import Sequence

from voodoo.measurements import ASSUMED_RATE_HZ

_CLOCKS = {13: 1e-3, 16: 1e-6, 19: 1e-9}
"""Number of digits of a time since 1970 -> its unit in seconds."""
_UNITS = dict(zip(_CLOCKS.values(), ("milliseconds", "microseconds", "nanoseconds"), strict=True))
_SLOWEST_HZ, _FASTEST_HZ = 0.2, 1000.0
"""Rates of recordings of people: slower ones do not show motion, and no camera or laser is faster."""


def unit_of(stamps: Sequence[str]) -> float:
    """The unit [s] of times since 1970 by the digits before their point; 1.0 for all other stamps."""
    digits = {len(stamp.partition(".")[0]) for stamp in stamps}
    return next((unit for count, unit in _CLOCKS.items() if digits == {count}), 1.0)


def _off(interval: float) -> float:
    """How far an interval [s] is from the usual one."""
    return abs(math.log(interval * ASSUMED_RATE_HZ))


def _likely_unit(interval: float) -> float:
    """The unit [s] by which an interval of stamps is nearest to the usual one."""
    return min(_UNITS, key=lambda unit: _off(interval * unit))


def step_words(step: float, rate: float) -> str:
    """What numbers of images with this usual step may be if not consecutive ones at a rate [Hz]; "" if nothing."""
    unit = _likely_unit(step) if step > 0.0 else math.nan
    if not _off(step * unit) < _off(step / rate):
        return ""
    return f"the numbers rise by {step:g}: if they are times in {_UNITS[unit]}, --option seconds_per_unit={unit:g}"


def interval_words(interval: float) -> str:
    """What is unlikely about the usual time between frames [s]; "" if nothing, or if it is NaN."""
    if interval > 1.0 / _SLOWEST_HZ:
        unit = _likely_unit(interval)
        option = f"--option seconds_per_unit={unit:g} of a folder of images"
        return f"frames are {interval:.1f} s apart: are the stamps in {_UNITS[unit]}? ({option})"
    if 0.0 < interval < 1.0 / _FASTEST_HZ:
        return f"frames are {interval:.4g} s apart: are the stamps in seconds?"
    return ""
