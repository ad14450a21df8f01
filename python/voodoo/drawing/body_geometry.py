"""Colors and elastic bands of the body for a 3-D viewer."""

from __future__ import annotations

import colorsys

import numpy as np
import numpy.typing as npt

from voodoo._core import Estimate
from voodoo.measurements import FloatArray
from voodoo.model.body import Body

_ON_BODY_M = 0.12


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
