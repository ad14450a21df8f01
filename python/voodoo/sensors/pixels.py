"""Single pixels and the rays behind them."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from voodoo.measurements import FloatArray
from voodoo.model.camera import Camera
from voodoo.model.transforms import rigid


def world_rays(
    camera: Camera, world_from_sensor: npt.ArrayLike, pixels: npt.ArrayLike
) -> tuple[FloatArray, FloatArray]:
    """Focal point (3,) [m] and unit directions (N, 3), in the world, of the rays behind pixels (N, 2).

    Raises:
        CameraError: the shape of the pixels is not (N, 2).
        MeasurementError: the pose is not rigid.
    """
    pose = rigid(world_from_sensor)
    xy = camera.undistorted(np.asarray(pixels, dtype=np.float64))
    directions = np.column_stack([xy, np.ones(len(xy))]) @ pose[:3, :3].T
    return pose[:3, 3], directions / np.linalg.norm(directions, axis=1, keepdims=True)


def in_sensor(world_from_sensor: FloatArray, points: npt.ArrayLike) -> FloatArray:
    """World points (N, 3) in the sensor frame."""
    return np.asarray((np.asarray(points, dtype=np.float64) - world_from_sensor[:3, 3]) @ world_from_sensor[:3, :3])


def ray_distance(origin: FloatArray, directions: FloatArray, points: FloatArray) -> FloatArray:
    """Distances (...) [m] of points (..., 3) to rays with unit directions (..., 3); behind the origin, to the origin."""
    offset = points - origin
    along = np.maximum((offset * directions).sum(axis=-1), 0.0)
    return np.asarray(np.linalg.norm(offset - along[..., None] * directions, axis=-1))
