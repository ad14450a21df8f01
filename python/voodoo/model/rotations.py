"""Rotations as matrices, quaternions (x, y, z, w), rotation vectors (axis times angle) and Euler angles."""

from __future__ import annotations

import math

import cv2
import numpy as np
import numpy.typing as npt

import voodoo._core as _core
from voodoo.model.joint import FloatArray


def axes(words: str) -> FloatArray:
    """The rotation (3, 3) into coordinates that are named by those before it: by "z -x y", (x, y, z) becomes (z, -x, y)."""
    rotation = np.zeros((3, 3))
    for row, word in zip(rotation, words.split(), strict=True):
        row["xyz".index(word[-1])] = -1.0 if word.startswith("-") else 1.0
    return rotation


def quaternions(rotations: FloatArray) -> FloatArray:
    """Unit quaternions (..., 4) of rotation matrices (..., 3, 3); the largest entry of each is positive. A matrix that is only
    approximately a rotation is replaced by the nearest rotation."""
    matrices = np.ascontiguousarray(rotations, dtype=np.float64)
    found, skewed = _core.quaternions(matrices)
    if skewed:
        found, _ = _core.quaternions(nearest_rotations(matrices))
    return found


def nearest_rotations(matrices: FloatArray) -> FloatArray:
    """The rotations (..., 3, 3) nearest to matrices that are approximately rotations."""
    left, _, right = np.linalg.svd(matrices)
    return np.asarray(left @ right)


def matrix_of_quaternion(quaternion: tuple[float, float, float, float]) -> FloatArray:
    """The rotation matrix (3, 3) of a unit quaternion."""
    x, y, z, w = quaternion
    return np.array(
        [
            [x * x - y * y - z * z + w * w, 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)],
            [2.0 * (x * y + z * w), -x * x + y * y - z * z + w * w, 2.0 * (y * z - x * w)],
            [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), -x * x - y * y + z * z + w * w],
        ]
    )


def matrix_of_turn(turn: npt.ArrayLike) -> FloatArray:
    """The rotation matrix (3, 3) of an axis times an angle (3,) [rad]."""
    return np.asarray(cv2.Rodrigues(np.asarray(turn, dtype=np.float64))[0], dtype=np.float64)


def turned_between(first: FloatArray, second: FloatArray, fraction: float) -> FloatArray:
    """Interpolated rotation (3, 3) at a fraction, 0 to 1, with constant angular velocity about one axis."""
    start, end = quaternions(np.array([first, second]))
    end = end if start @ end >= 0.0 else -end
    angle = 2.0 * math.atan2(float(np.linalg.norm(end - start)), float(np.linalg.norm(end + start)))
    # np.sinc(x / pi) is sin(x) / x, also at 0.
    shares = [part * np.sinc(part * angle / math.pi) for part in (1.0 - fraction, fraction)]
    x, y, z, w = shares[0] * start + shares[1] * end
    length = math.sqrt(x * x + y * y + z * z + w * w)
    return matrix_of_quaternion((x / length, y / length, z / length, w / length))


def euler_angles(rotations: FloatArray, order: str) -> FloatArray:
    """Angles (N, 3) [rad] about moving axes, such as "ZXY", of rotation matrices (N, 3, 3) (Bernardes and Viollet, "Quaternion to
    Euler angles conversion: a direct, general and computationally efficient method", PLOS ONE 2022).

    If the first and third axes are parallel, only their sum is determined; the third angle is then zero.
    """
    first, second, third = ("XYZ".index(axis) for axis in order)
    return _core.euler_angles(quaternions(rotations), (first, second, third))
