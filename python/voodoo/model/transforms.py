"""Rigid transforms that callers give."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from voodoo.errors import MeasurementError
from voodoo.model.joint import as_numbers

_OFF = 1e-4
"""How far the products of a rotation's rows may be from those of unit vectors at right angles, as in the core."""


def rigid(value: npt.ArrayLike, *, name: str = "world_from_sensor") -> npt.NDArray[np.float64]:
    """A rigid transform (4, 4), checked.

    Raises:
        MeasurementError: numbers of another shape, not finite, or no rotation and shift; it names `name`.
    """
    try:
        pose = as_numbers(value)
    except (TypeError, ValueError, OverflowError):
        pose = np.empty(0)
    if pose.shape != (4, 4) or not np.isfinite(pose).all() or not _turns_and_shifts(pose.tolist()):
        raise MeasurementError(f"{name}: expected a rigid 4x4 transform, found {value!r}")
    return pose


def _turns_and_shifts(rows: list[list[float]]) -> bool:
    # Sixteen numbers are faster without arrays.
    x, y, z, last = rows
    across = [y[1] * z[2] - y[2] * z[1], y[2] * z[0] - y[0] * z[2], y[0] * z[1] - y[1] * z[0]]
    return (
        all(abs(_dot(axis, axis) - 1.0) <= _OFF for axis in (x, y, z))
        and all(abs(_dot(one, two)) <= _OFF for one, two in ((x, y), (y, z), (z, x)))
        and _dot(x, across) > 0.0
        and last == [0.0, 0.0, 0.0, 1.0]
    )


def _dot(a: list[float], b: list[float]) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
