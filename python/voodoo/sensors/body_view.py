"""Registers the depth measurements near the body to the image of a color camera, and finds the still scene."""

from __future__ import annotations

import math
from functools import lru_cache

import cv2
import numpy as np
import numpy.typing as npt

import voodoo._core as _core
from voodoo.model.camera import Camera
from voodoo.sensors.depth import DepthArray
from voodoo.sensors.pixels import FloatArray, in_sensor

BodyView = _core.BodyView
StillDepth = _core.StillDepth


def body_view(
    depth: DepthArray,
    *,
    depth_camera: Camera,
    world_from_depth: FloatArray,
    meters_per_unit: float,
    color_camera: Camera,
    world_from_color: FloatArray,
    joints: npt.ArrayLike,
    margin: float = 0.30,
    step: int = 1,
    scene: StillDepth | None = None,
) -> BodyView:
    """Registers the points of a depth image within the box around the body to a color image.

    Args:
        depth: (H, W) uint16 or float32; 0 and NaN mean "no return".
        depth_camera, world_from_depth: calibration and (4, 4) pose.
        meters_per_unit: of `depth`.
        color_camera, world_from_color: calibration and (4, 4) pose of the color camera.
        joints: (N, 3) predicted positions of the body [m].
        margin: enlargement of their box [m].
        step: every step-th row and column of the depth image is used.
        scene: the still scene of the depth camera; is updated with this image.

    Returns:
        Mask of the color image and the points; the gaps between the depth pixels are closed in the mask.
    """
    world_from_color, world_from_depth = (
        np.asarray(pose, dtype=np.float64) for pose in (world_from_color, world_from_depth)
    )
    poses = world_from_color.tobytes(), world_from_depth.tobytes()
    lens = depth_camera
    return _core.body_view(
        depth,
        lens,
        np.ascontiguousarray(joints, dtype=np.float64),
        meters_per_unit=meters_per_unit,
        world_from_depth=world_from_depth,
        color_from_depth=_between(*poses),
        color_camera=color_camera,
        # A few centimeters of the body's distance change the field of view in the color image by less than a pixel.
        beyond=lambda away: _beyond(lens, poses[1], color_camera, poses[0], max(round(away, 1), 0.1)),
        # A depth pixel covers this many color pixels; one and a half times as many close the gaps and the edge filter's rim.
        reach=math.ceil(1.5 * step * color_camera.fx / lens.fx),
        step=step,
        margin=margin,
        scene=scene,
    )


_SIDE, _OUTWARDS = 16, 32
"""Number of samples on each side of a depth image's border, and on the line from its center to each of them."""


def _corners(camera: Camera) -> FloatArray:
    """Rays (4, 3) with z = 1 of the corners of an image."""
    right, bottom = camera.width - 1, camera.height - 1
    corners = np.ones((4, 3))
    corners[:, :2] = camera.rays()[[0, 0, bottom, bottom], [0, right, right, 0]]
    return corners


@lru_cache(maxsize=8)
def _border(camera: Camera) -> FloatArray:
    """Rays (4 _SIDE _OUTWARDS, 3) with z = 1 through samples on lines from the center of an image to its border, line by line;
    NaN where the lens model has none."""
    right, bottom = camera.width - 1.0, camera.height - 1.0
    corners = np.array([(0.0, 0.0), (right, 0.0), (right, bottom), (0.0, bottom)])
    fraction = np.arange(_SIDE)[:, None] / _SIDE
    sides = zip(corners, np.roll(corners, -1, axis=0), strict=True)
    border = np.concatenate([first + fraction * (second - first) for first, second in sides])
    middle = np.clip((camera.cx, camera.cy), 0.0, (right, bottom))
    outwards = np.linspace(1.0 / _OUTWARDS, 1.0, _OUTWARDS)[:, None]
    places = (middle + outwards * (border[:, None] - middle)).reshape(-1, 2)
    return np.column_stack([camera.undistorted(places), np.ones(len(places))])


@lru_cache(maxsize=16)
def _between(color_pose: bytes, depth_pose: bytes) -> FloatArray:
    """(4, 4) color_from_depth."""
    world_from_color, world_from_depth = (np.frombuffer(pose).reshape(4, 4) for pose in (color_pose, depth_pose))
    return np.asarray(np.linalg.inv(world_from_color) @ world_from_depth)


@lru_cache(maxsize=8)
def _beyond(
    depth_camera: Camera, depth_pose: bytes, color_camera: Camera, color_pose: bytes, z: float
) -> npt.NDArray[np.bool_]:
    """(H, W) of the color image: True outside the depth camera's field of view at a distance from it [m]; read-only."""
    world_from_depth, world_from_color = (np.frombuffer(pose).reshape(4, 4) for pose in (depth_pose, color_pose))
    bent = depth_camera.distorted or color_camera.distorted
    rays = _border(depth_camera) if bent else _corners(depth_camera)
    border = (z * rays) @ world_from_depth[:3, :3].T + world_from_depth[:3, 3]
    contour = color_camera.project(in_sensor(world_from_color, border))
    if bent:
        # On each line from the center outwards, the last sample that both lenses map.
        contour = contour.reshape(-1, _OUTWARDS, 2)
        last = np.isfinite(contour).all(axis=2).cumprod(axis=1).sum(axis=1) - 1
        contour = contour[last >= 0, last[last >= 0]]
    # The corners are the centers of the outermost pixels.
    middle = contour.mean(axis=0)
    contour = middle + (contour - middle) * (1.0 + 4.0 / min(depth_camera.width, depth_camera.height))
    away = np.ones((color_camera.height, color_camera.width), dtype=np.uint8)
    if len(contour) > 2 and np.isfinite(contour).all():
        places = contour.round().clip(-9999, 9999).astype(np.int32)
        cv2.fillPoly(away, [places], 0) if bent else cv2.fillConvexPoly(away, places, 0)
    away.setflags(write=False)
    return away.view(np.bool_)
