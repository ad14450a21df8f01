"""Renders rooms made of boxes with exact depth."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from voodoo.model.camera import Camera

FloatArray: TypeAlias = npt.NDArray[np.float64]
Box: TypeAlias = tuple[tuple[float, float, float], tuple[float, float, float]]
"""Lower and upper corner [m]."""


def room_depth(camera: Camera, world_from_sensor: FloatArray, boxes: Sequence[Box]) -> FloatArray:
    """Depth (height, width) [m] along the optical axis of the floor z = 0 and of boxes; infinite where there is neither."""
    rays = camera.rays().astype(np.float64)
    in_camera = np.concatenate([rays[..., :2], np.ones((*rays.shape[:2], 1))], axis=-1)
    directions = in_camera @ world_from_sensor[:3, :3].T
    origin = world_from_sensor[:3, 3]
    # A ray parallel to a side of a box would divide by zero.
    directions = np.where(np.abs(directions) < 1e-9, 1e-9, directions)
    depth = np.where(directions[..., 2] < 0.0, -origin[2] / directions[..., 2], np.inf)
    for low, high in boxes:
        first, second = (np.array(low) - origin) / directions, (np.array(high) - origin) / directions
        near = np.minimum(first, second).max(axis=-1)
        far = np.maximum(first, second).min(axis=-1)
        depth = np.where((near <= far) & (near > 0.0) & (near < depth), near, depth)
    return np.asarray(depth)
