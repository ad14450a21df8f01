"""Checks rigid transforms given by callers."""

from __future__ import annotations

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
    if pose.shape != (4, 4) or not _is_rigid(pose.tobytes()):
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


def is_rigid(pose: npt.NDArray[np.float64], *, off: float = _OFF) -> bool:
    """Whether a matrix is a rigid transform (4, 4), with a tolerance `off` of the products of the rotation's rows."""
    if pose.shape != (4, 4) or not np.isfinite(pose).all() or (pose[3] != (0.0, 0.0, 0.0, 1.0)).any():
        return False
    turn = pose[:3, :3]
    with np.errstate(over="ignore", invalid="ignore"):
        return bool(np.abs(turn @ turn.T - np.eye(3)).max() <= off and np.linalg.det(turn) > 0.0)


# Cached, because most sensors are static, and several steps of a frame check the same transform.
@lru_cache(maxsize=64)
def _is_rigid(entries: bytes) -> bool:
    return is_rigid(np.frombuffer(entries).reshape(4, 4))
