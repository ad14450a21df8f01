"""Small helpers of rotations; vectors in the last axis, any leading axes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def about(axis: str, angle: float) -> Array:
    """The matrix that turns by `angle` (radians) about "x", "y" or "z"."""
    c, s = np.cos(angle), np.sin(angle)
    if axis == "x":
        return np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    if axis == "y":
        return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])


def about_axis(axis: Array, angle: float) -> Array:
    """The matrix that turns by `angle` (radians) about a unit vector."""
    x, y, z = axis
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * (k @ k)


def unit(v: Array) -> Array:
    """`v` divided by its length."""
    return v / (np.linalg.norm(v, axis=-1, keepdims=True) + 1e-12)


def frame(first: Array, second: Array) -> Array:
    """Axes (columns) from a first direction and, made orthogonal to it, a second: shape (..., 3, 3)."""
    a = unit(first)
    b = unit(second - (second * a).sum(-1, keepdims=True) * a)
    return np.stack([a, b, np.cross(a, b)], -1)


def shortest(a: Array, b: Array) -> Array:
    """The smallest rotation that takes the unit vector `a` to `b`."""
    c = float(a @ b)
    axis = np.cross(a, b)
    n = float(np.linalg.norm(axis))
    if n < 1e-8:
        if c > 0:
            return np.eye(3)
        other = np.cross(a, [1.0, 0, 0] if abs(a[0]) < 0.9 else [0, 1.0, 0])
        return about_axis(unit(other), np.pi)
    return about_axis(axis / n, np.arctan2(n, c))


def vector(r: Array) -> Array:
    """The rotation vector (radians) of a matrix."""
    c = np.clip((np.trace(r) - 1) / 2, -1, 1)
    angle = np.arccos(c)
    v = np.array([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]])
    n = np.linalg.norm(v)
    return v * (angle / n) if n > 1e-9 else np.zeros(3)


def part(r: Array, fraction: float) -> Array:
    """A share of a rotation, along the shortest way."""
    v = vector(r)
    n = float(np.linalg.norm(v))
    return about_axis(v / n, n * fraction) if n > 1e-9 else np.eye(3)
