"""Conversion of arguments of voodoo.ik to the form that the core takes."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from voodoo.errors import MeasurementError
from voodoo.model.joint import numbers_of, short

FloatArray: TypeAlias = npt.NDArray[np.float64]
Vector: TypeAlias = Sequence[float] | FloatArray
Bone: TypeAlias = tuple[str, str, float]
"""Two sites and the radius [m] around the segment between them that must lie inside the silhouettes."""

_IDENTITY = np.eye(4)


def listed_bones(bones: Sequence[Bone] | None) -> list[Bone] | None:
    """Bones with plain floats.

    Raises:
        MeasurementError: not two sites and a radius of at least zero.
    """
    if bones is None:
        return None
    if isinstance(bones, str) or not isinstance(bones, Iterable):
        raise MeasurementError(f"bones: expected a list of (site, site, radius), found {short(bones)}")
    found: list[Bone] = []
    for bone in bones:
        try:
            first, second, radius = bone
            found.append((str(first), str(second), float(radius)))
        except (TypeError, ValueError, OverflowError):
            raise MeasurementError(f"bones: expected (site, site, radius), found {short(bone)}") from None
        if not 0.0 <= found[-1][2] < math.inf:
            raise MeasurementError(f"bones: expected a radius of at least 0 m, found {radius!r}")
    return found


def named(names: Sequence[str], values: FloatArray) -> MappingProxyType[str, FloatArray]:
    """Name -> row of values."""
    return MappingProxyType(dict(zip(names, values, strict=True)))


def listed_poses(poses: Mapping[str, npt.ArrayLike] | None) -> list[tuple[str, FloatArray]]:
    """Name and pose (4, 4) of limbs; the core checks them.

    Raises:
        MeasurementError: not a mapping, or poses that are not numbers.
    """
    if poses is None:
        return []
    if not isinstance(poses, Mapping):
        raise MeasurementError(f"others: expected limb name -> pose (4, 4), found {short(poses)}")
    return [(name, numbers("others", pose)) for name, pose in poses.items()]


def base_pose(pose: npt.ArrayLike | None) -> FloatArray:
    """A pose (4, 4), identity for None; the core checks it.

    Raises:
        MeasurementError: not numbers.
    """
    return _IDENTITY if pose is None else numbers("world_from_base", pose)


def vector(values: npt.ArrayLike) -> FloatArray:
    """Angles in a row; the core checks them.

    Raises:
        MeasurementError: not numbers.
    """
    return np.ascontiguousarray(numbers("angles", values)).reshape(-1)


def numbers(what: str, values: npt.ArrayLike) -> FloatArray:
    """An array.

    Raises:
        MeasurementError: not numbers; it names `what`.
    """
    return numbers_of(what, values, MeasurementError)


def three(what: str, values: Vector) -> tuple[float, float, float]:
    """Three numbers.

    Raises:
        MeasurementError: it names `what`.
    """
    x, y, z = numbers_of(what, values, MeasurementError, "three numbers", count=3).tolist()
    return x, y, z
