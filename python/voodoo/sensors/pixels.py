"""Single pixels and the rays behind them."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from voodoo.errors import MeasurementError
from voodoo.measurements import FloatArray
from voodoo.model.camera import Camera
from voodoo.model.transforms import rigid


def normalized(camera: Camera, pixels: npt.ArrayLike) -> FloatArray:
    """Undistorted x/z, y/z of pixels at any subpixel position.

    Args:
        camera: calibration.
        pixels: (N, 2) coordinates (u, v).

    Returns:
        (N, 2); NaN where the lens model has no ray for the pixel.

    Raises:
        MeasurementError: the shape is not (N, 2).
    """
    pixels = np.asarray(pixels, dtype=np.float64)
    if pixels.ndim != 2 or pixels.shape[1] != 2:
        raise MeasurementError(f"pixels: expected shape (N, 2), found {pixels.shape}")
    return camera.undistorted(pixels)


def world_rays(
    camera: Camera, world_from_sensor: npt.ArrayLike, pixels: npt.ArrayLike
) -> tuple[FloatArray, FloatArray]:
    """Focal point (3,) [m] and unit directions (N, 3), in the world, of the rays behind pixels (N, 2).

    Raises:
        MeasurementError: wrong shapes.
    """
    pose = rigid(world_from_sensor)
    xy = normalized(camera, pixels)
    directions = np.column_stack([xy, np.ones(len(xy))]) @ pose[:3, :3].T
    return pose[:3, 3], directions / np.linalg.norm(directions, axis=1, keepdims=True)


def checked_camera(camera: object) -> Camera:
    """Check that the argument is a calibration and return it.

    Raises:
        MeasurementError: it is something else, or None.
    """
    if not isinstance(camera, Camera):
        raise MeasurementError(f"camera: expected a Camera, the calibration of the image, found {camera!r}")
    return camera


def in_sensor(world_from_sensor: FloatArray, points: npt.ArrayLike) -> FloatArray:
    """World points (N, 3) in the sensor frame."""
    return np.asarray((np.asarray(points, dtype=np.float64) - world_from_sensor[:3, 3]) @ world_from_sensor[:3, :3])


def ray_distance(origin: FloatArray, directions: FloatArray, points: FloatArray) -> FloatArray:
    """Distances (...) [m] of points (..., 3) to rays with unit directions (..., 3); behind the origin, to the origin."""
    offset = points - origin
    along = np.maximum((offset * directions).sum(axis=-1), 0.0)
    return lengths(offset - along[..., None] * directions)


def lengths(vectors: FloatArray) -> FloatArray:
    """Lengths of vectors (..., 3)."""
    return np.asarray(np.sqrt(np.add.reduce(vectors * vectors, axis=-1)))
