"""Checks rigid transforms given by callers."""

from __future__ import annotations

import math
import struct
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from voodoo.errors import MeasurementError
from voodoo.model.joint import numbers_or_nan

_OFF = 1e-4
"""Tolerance for the products of the rows of a rotation, as in the core."""


def rigid(value: npt.ArrayLike, *, name: str = "world_from_sensor") -> npt.NDArray[np.float64]:
    """A rigid transform (4, 4), checked.

    Raises:
        MeasurementError: another shape, not finite, or not a rotation and translation; names `name`.
    """
    pose = numbers_or_nan(value)
    if pose.shape != (4, 4) or not _turns_and_shifts(pose.tobytes()):
        raise MeasurementError(f"{name}: expected a rigid 4x4 transform, found {value!r}")
    return pose


def pose_of(rotation: npt.ArrayLike, translation: npt.ArrayLike = (0.0, 0.0, 0.0)) -> npt.NDArray[np.float64]:
    """The transform (4, 4) of a rotation (3, 3) and a translation (3,)."""
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation, translation
    return pose


def inverse(a_from_b: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """b_from_a (4, 4) of a rigid a_from_b: the inverse rotation is the transposed one."""
    return pose_of(a_from_b[:3, :3].T, -a_from_b[:3, :3].T @ a_from_b[:3, 3])


# Cached, because most sensors are static, and several steps of a frame check the same transform.
@lru_cache(maxsize=64)
def _turns_and_shifts(entries: bytes) -> bool:
    # Sixteen numbers are faster without arrays; numbers that are not finite fail a comparison.
    numbers = struct.unpack("16d", entries)
    x, y, z, last = (numbers[start : start + 4] for start in (0, 4, 8, 12))
    across = (y[1] * z[2] - y[2] * z[1], y[2] * z[0] - y[0] * z[2], y[0] * z[1] - y[1] * z[0])
    return (
        all(abs(_dot(axis, axis) - 1.0) <= _OFF for axis in (x, y, z))
        and all(abs(_dot(one, two)) <= _OFF for one, two in ((x, y), (y, z), (z, x)))
        and _dot(x, across) > 0.0
        and last == (0.0, 0.0, 0.0, 1.0)
        and all(math.isfinite(row[3]) for row in (x, y, z))
    )


def _dot(a: tuple[float, ...], b: tuple[float, ...]) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
