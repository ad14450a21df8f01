"""Rotations as matrices, quaternions (x, y, z, w), rotation vectors (axis times angle) and Euler angles."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

import voodoo._core as _core

FloatArray = npt.NDArray[np.float64]

_NO_TURN = 1e-3
"""Below this angle [rad] a series is used instead of a division by it."""


def quaternions(rotations: FloatArray) -> FloatArray:
    """Unit quaternions (..., 4) of rotation matrices (..., 3, 3); the largest entry of each is positive. A matrix that is only
    approximately a rotation is replaced by the nearest rotation."""
    matrices = np.ascontiguousarray(rotations, dtype=np.float64)
    found, skewed = _core.quaternions(matrices)
    if skewed:
        left, _, right = np.linalg.svd(matrices)
        found, _ = _core.quaternions(left @ right)
    return found


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
    return matrix_of_quaternion(_quaternion_of_turn(*(float(value) for value in np.asarray(turn))))


def _quaternion_of_turn(x: float, y: float, z: float) -> tuple[float, float, float, float]:
    angle = math.sqrt(x * x + y * y + z * z)
    squared = angle * angle
    scale = 0.5 - squared / 48.0 + squared * squared / 3840.0 if angle <= _NO_TURN else math.sin(angle / 2.0) / angle
    return scale * x, scale * y, scale * z, math.cos(angle / 2.0)


def _turn_of_quaternion(x: float, y: float, z: float, w: float) -> tuple[float, float, float]:
    # Of the two quaternions of a rotation, the one with an angle of at most pi.
    if w < 0.0 or (w == 0.0 and (x < 0.0 or (x == 0.0 and (y < 0.0 or (y == 0.0 and z < 0.0))))):
        x, y, z, w = -x, -y, -z, -w
    angle = 2.0 * math.atan2(math.sqrt(x * x + y * y + z * z), w)
    squared = angle * angle
    scale = (
        2.0 + squared / 12.0 + 7.0 * squared * squared / 2880.0 if angle <= _NO_TURN else angle / math.sin(angle / 2.0)
    )
    return scale * x, scale * y, scale * z


def _product(
    p: tuple[float, float, float, float], q: tuple[float, float, float, float]
) -> tuple[float, float, float, float]:
    px, py, pz, pw = p
    qx, qy, qz, qw = q
    x = pw * qx + qw * px + (py * qz - pz * qy)
    y = pw * qy + qw * py + (pz * qx - px * qz)
    z = pw * qz + qw * pz + (px * qy - py * qx)
    w = pw * qw - px * qx - py * qy - pz * qz
    length = math.sqrt(x * x + y * y + z * z + w * w)
    return x / length, y / length, z / length, w / length


def turned_between(first: FloatArray, second: FloatArray, fraction: float) -> FloatArray:
    """Interpolated rotation (3, 3) at a fraction, 0 to 1, with constant angular velocity about one axis."""
    (ax, ay, az, aw), (bx, by, bz, bw) = quaternions(np.array([first, second])).tolist()
    turn = _turn_of_quaternion(*_product((-ax, -ay, -az, aw), (bx, by, bz, bw)))
    x, y, z = (value * fraction for value in turn)
    return matrix_of_quaternion(_product((ax, ay, az, aw), _quaternion_of_turn(x, y, z)))


def euler_angles(rotations: FloatArray, order: str) -> FloatArray:
    """Angles (N, 3) [rad] about moving axes, such as "ZXY", of rotation matrices (N, 3, 3) (Bernardes and Viollet, "Quaternion to
    Euler angles conversion: a direct, general and computationally efficient method", PLOS ONE 2022).

    If the first and third axes are parallel, only their sum is determined; the third angle is then zero.
    """
    first, second, third = ("XYZ".index(axis) for axis in order)
    return _core.euler_angles(quaternions(rotations), (first, second, third))
