"""Meshes, colors and elastic bands of the body for a 3-D viewer."""

from __future__ import annotations

import colorsys

import numpy as np
import numpy.typing as npt

from voodoo._core import Estimate, TaperedEllipticCylinder
from voodoo.measurements import FloatArray
from voodoo.model.body import Body

_AROUND = 24
_ON_BODY_M = 0.12


def limb_mesh(
    shape: TaperedEllipticCylinder,
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.uint32], npt.NDArray[np.float32]]:
    """Vertices (V, 3) [m] in the limb frame, triangles (T, 3) counter-clockwise from outside, and unit normals (V,
    3)."""
    angle = np.linspace(0.0, 2.0 * np.pi, _AROUND, endpoint=False)
    ring = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(_AROUND)])
    low = ring * (shape.a0, shape.b0, 0.0)
    high = ring * (shape.a1, shape.b1, 0.0) + (0.0, 0.0, shape.length)
    middles = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, shape.length]])
    # The rims are doubled: with the normals of the side, and with those of the caps.
    outward = np.vstack([ring * (shape.b0, shape.a0, 0.0), ring * (shape.b1, shape.a1, 0.0)])
    side = outward + 1e-9 * np.vstack([ring, ring])  # so that the normals of a pointed end are defined
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    down, up = np.array([0.0, 0.0, -1.0]), np.array([0.0, 0.0, 1.0])
    vertices = np.vstack([low, high, low, high, middles])
    normals = np.vstack([side, np.tile(down, (_AROUND, 1)), np.tile(up, (_AROUND, 1)), down, up])
    here = np.arange(_AROUND)
    following = (here + 1) % _AROUND
    n = _AROUND
    triangles = np.vstack(
        [
            np.column_stack([here, following, n + here]),
            np.column_stack([following, n + following, n + here]),
            np.column_stack([np.full(n, 4 * n), 2 * n + following, 2 * n + here]),
            np.column_stack([np.full(n, 4 * n + 1), 3 * n + here, 3 * n + following]),
        ]
    )
    return vertices.astype(np.float32), triangles.astype(np.uint32), normals.astype(np.float32)


def limb_colors(body: Body) -> dict[str, tuple[int, int, int]]:
    """A color for each limb, with evenly spaced hues."""
    count = len(body.limbs)
    colors = {}
    for index, limb in enumerate(body.limbs):
        red, green, blue = colorsys.hsv_to_rgb(index / count, 0.75, 1.0)
        colors[limb.name] = (round(255 * red), round(255 * green), round(255 * blue))
    return colors


def nearest_limb(points: FloatArray, estimate: Estimate, body: Body) -> npt.NDArray[np.intp]:
    """(N,) index of the limb whose surface is nearest to each world point (N, 3), the number of limbs for the
    background."""
    if not len(points) or not len(estimate.joint_positions):
        return np.full(len(points), len(body.limbs), dtype=np.intp)
    distances = np.full((len(body.limbs) + 1, len(points)), np.inf)
    distances[-1] = _ON_BODY_M
    low = estimate.joint_positions.min(axis=0) - 0.4
    near = np.flatnonzero(((points > low) & (points < estimate.joint_positions.max(axis=0) + 0.4)).all(axis=1))
    if len(near):
        for index, limb in enumerate(body.limbs):
            pose = estimate.world_from_limb[limb.name]
            local = np.ascontiguousarray((points[near] - pose[:3, 3]) @ pose[:3, :3])
            distances[index, near] = np.abs(limb.shape.closest_points(local).signed_distance)
    return np.asarray(distances.argmin(axis=0))


def bands(estimate: Estimate, body: Body) -> list[FloatArray]:
    """The elastic band of each joint's center as (2, 3): from the parent's half of the joint to the child's."""
    strips = []
    for name, parent, _, joint, _ in body.core.parts()[1]:
        if parent is None or joint is None:
            continue
        ends = []
        for limb, (place, _) in ((parent, joint[1]), (name, joint[2])):
            pose = estimate.world_from_limb[limb]
            ends.append(pose[:3, :3] @ np.asarray(place) + pose[:3, 3])
        strips.append(np.array(ends))
    return strips
