"""What the functions of voodoo.ik take, as the core wants it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from voodoo.errors import MeasurementError

FloatArray: TypeAlias = npt.NDArray[np.float64]
Vector: TypeAlias = Sequence[float] | FloatArray
Bone: TypeAlias = tuple[str, str, float]
"""Two sites and the radius [m] around the segment between them that shall lie inside the silhouettes."""

_IDENTITY = np.eye(4)


def listed_bones(bones: Sequence[Bone] | None) -> list[Bone] | None:
    """Bones with plain floats."""
    return None if bones is None else [(first, second, float(radius)) for first, second, radius in bones]


def named(names: Sequence[str], values: FloatArray) -> MappingProxyType[str, FloatArray]:
    """Name -> row of values."""
    return MappingProxyType(dict(zip(names, values, strict=True)))


def listed_poses(poses: Mapping[str, npt.ArrayLike] | None) -> list[tuple[str, FloatArray]]:
    """Name and pose (4, 4) of limbs; the core checks them."""
    return [(name, np.asarray(pose, dtype=np.float64)) for name, pose in (poses or {}).items()]


def base_pose(pose: npt.ArrayLike | None) -> FloatArray:
    """A pose (4, 4), identity for None; the core checks it."""
    return _IDENTITY if pose is None else np.asarray(pose, dtype=np.float64)


def vector(values: npt.ArrayLike) -> FloatArray:
    """Numbers in a row; the core checks them."""
    return np.ascontiguousarray(values, dtype=np.float64).reshape(-1)


def three(what: str, values: Vector) -> tuple[float, float, float]:
    """Three numbers.

    Raises:
        MeasurementError: it names `what`.
    """
    try:
        x, y, z = np.asarray(values, dtype=np.float64).reshape(-1).tolist()
    except (TypeError, ValueError):
        raise MeasurementError(f"{what}: expected three numbers, found {values!r}") from None
    return x, y, z
