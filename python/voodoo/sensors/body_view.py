"""What a depth camera sees of the body, in the picture of a colour camera beside it; and what may be the still scene."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from statistics import median

import cv2
import numpy as np
import numpy.typing as npt

import voodoo._core as _core
from voodoo.model.camera import Camera
from voodoo.sensors.depth import DepthArray
from voodoo.sensors.pixels import FloatArray, in_sensor

_CORNERS = np.array([[bool(corner >> axis & 1) for axis in range(3)] for corner in range(8)])
"""Which of a box's corners are at its high end."""


_STANDS = 1e-3
"""A pose whose entries change by less is that of a camera that stands."""


_STAYS = 6
"""Over so many pictures the depth of a still surface hardly changes."""


@dataclass(frozen=True, eq=False)
class BodyView:
    """What a depth camera saw of the body, in the picture of a colour camera beside it.

    Args:
        mask: (H, W) of the picture: True where something near the body was seen, or where the depth camera does not look.
        pixels: (N, 2) of the points in the picture.
        depths: (N,) of the points along the colour camera's optical axis [m].
        still: (N,) whether nothing behind a point was ever seen there: it may be the scene. None: not known.
        before: (H, W) of the picture: True where something is before what was seen there once. None: not known.
    """

    mask: npt.NDArray[np.bool_]
    pixels: FloatArray
    depths: FloatArray
    still: npt.NDArray[np.bool_] | None = None
    before: npt.NDArray[np.bool_] | None = None

    def look_at(
        self, labels: npt.NDArray[np.int32], places: Sequence[tuple[tuple[float, float], int]], radius: float
    ) -> list[tuple[float, bool] | None]:
        """Depth [m] of the nearest surface within `radius` pixels of each place (u, v), and whether most of it is still; None
        with less than three points there. Where three of them are in its region, by its number among `labels` (H, W) of the
        picture, only those count."""
        return _core.nearest_surfaces(self.pixels, self.depths, self.still, labels=labels, places=places, radius=radius)


class StillDepth:
    """What may be the still scene of a depth camera that stands: what has been at its place for some pictures, and behind
    which nothing was ever seen. A table's edge does not become a hand.

    The surface of a person who has not moved yet looks the same, so this only tells what has moved.
    """

    def __init__(self) -> None:
        """Nothing seen yet."""
        self._farthest: npt.NDArray[np.float32] | None = None
        self._pose: FloatArray | None = None
        self._last: deque[npt.NDArray[np.float32]] = deque(maxlen=_STAYS)

    def __copy__(self) -> StillDepth:
        """The same; images are never changed in place."""
        twin = StillDepth()
        twin._farthest, twin._pose, twin._last = self._farthest, self._pose, self._last.copy()
        return twin

    def see(
        self, z: npt.NDArray[np.float32], world_from_sensor: FloatArray
    ) -> tuple[npt.NDArray[np.bool_], npt.NDArray[np.bool_]] | None:
        """Take up an image (H, W) [m], 0 = no return; a camera that has moved starts anew.

        Returns:
            (H, W): True where the image shows what may be the scene; (H, W): True where it shows something before what
            was seen there once. None as long as too little was seen.
        """
        moved = self._pose is None or (np.abs(self._pose - world_from_sensor) > _STANDS).any()
        if self._farthest is None or moved or self._farthest.shape != z.shape:
            self._farthest, self._pose = z, world_from_sensor
            self._last.clear()
        self._farthest = np.maximum(self._farthest, z)
        still = None
        if len(self._last) == _STAYS:
            still = _core.still_scene(z, self._farthest, self._last[0])
        self._last.append(z)
        return still


def body_view(
    depth: DepthArray,
    *,
    depth_camera: Camera,
    world_from_depth: FloatArray,
    metres_per_unit: float,
    color_camera: Camera,
    world_from_color: FloatArray,
    joints: npt.ArrayLike,
    margin: float = 0.30,
    step: int = 1,
    scene: StillDepth | None = None,
) -> BodyView:
    """Where, in a colour image, a depth camera beside it saw something within the box around the body.

    Args:
        depth: (H, W) uint16 or float32; 0 and NaN mean "no return".
        depth_camera, world_from_depth: calibration and (4, 4) pose.
        metres_per_unit: of `depth`.
        color_camera, world_from_color: calibration and (4, 4) pose of the colour camera.
        joints: (N, 3) predicted positions of the body [m].
        margin: enlargement of their box [m].
        step: every step-th row and column of the depth image is used.
        scene: what the depth camera saw before; takes up this image.

    Returns:
        Mask of the colour image and the points; the gaps between the depth pixels are closed in the mask.
    """
    places = np.asarray(joints, dtype=np.float64)
    low, high = places.min(axis=0) - margin, places.max(axis=0) + margin
    z = depth[::step, ::step].astype(np.float32) * np.float32(metres_per_unit)
    rows, columns = _window(depth_camera, world_from_depth, low, high)
    poses = [np.asarray(pose, dtype=np.float64).tobytes() for pose in (world_from_color, world_from_depth)]
    points, index = _core.points_within(
        z,
        depth_camera.rays(),
        step=step,
        rows=(-(-rows.start // step), -(-rows.stop // step)),
        columns=(-(-columns.start // step), -(-columns.stop // step)),
        low=low,
        high=high,
        world_from_sensor=world_from_depth,
        other_from_sensor=_between(*poses),
    )
    standing = None if scene is None else scene.see(z, world_from_depth)
    still, moved = (None, None) if standing is None else (item.ravel()[index] for item in standing)
    pixels = color_camera.project(points)
    # A few centimetres of the body's distance move what is beyond by less than a pixel.
    away = round(median(in_sensor(world_from_depth, places)[:, 2].tolist()), 1)
    beyond = _beyond(depth_camera, poses[1], color_camera, poses[0], max(away, 0.1))
    # A depth pixel covers this many colour pixels; one and a half of them close the gaps and the edge filter's rim.
    reach = math.ceil(1.5 * step * color_camera.fx / depth_camera.fx)
    mask, before, inside = _core.shown(pixels, points, moved, beyond=beyond, reach=reach)
    depths = points[:, 2].copy()
    if len(inside) < len(points):
        pixels, depths, still = pixels[inside], depths[inside], None if still is None else still[inside]
    return BodyView(mask, pixels, depths, still, before)


@lru_cache(maxsize=16)
def _between(color_pose: bytes, depth_pose: bytes) -> FloatArray:
    """(4, 4) color_from_depth."""
    world_from_color, world_from_depth = (np.frombuffer(pose).reshape(4, 4) for pose in (color_pose, depth_pose))
    return np.asarray(np.linalg.inv(world_from_color) @ world_from_depth)


def _window(camera: Camera, world_from_depth: FloatArray, low: FloatArray, high: FloatArray) -> tuple[slice, slice]:
    """Rows and columns of a depth image that can show the box between two corners (3,); all where the lens distorts."""
    corners = in_sensor(world_from_depth, np.where(_CORNERS, high, low))
    if camera.distorted or (corners[:, 2] < 0.05).any():
        return slice(0, camera.height), slice(0, camera.width)
    columns, rows = camera.project(corners).T.tolist()
    spans = [
        slice(min(max(math.floor(min(span)), 0), size), min(max(math.ceil(max(span)) + 1, 0), size))
        for span, size in ((rows, camera.height), (columns, camera.width))
    ]
    return spans[0], spans[1]


@lru_cache(maxsize=8)
def _beyond(
    depth_camera: Camera, depth_pose: bytes, color_camera: Camera, color_pose: bytes, z: float
) -> npt.NDArray[np.bool_]:
    """(H, W) of the colour image: True where the depth camera does not look, at a distance from it [m]; read-only."""
    world_from_depth, world_from_color = (np.frombuffer(pose).reshape(4, 4) for pose in (depth_pose, color_pose))
    right, bottom = depth_camera.width - 1, depth_camera.height - 1
    rays = depth_camera.rays()[[0, 0, bottom, bottom], [0, right, right, 0]]
    corners = np.ones((4, 3))
    corners[:, :2] = rays
    corners = (z * corners) @ world_from_depth[:3, :3].T + world_from_depth[:3, 3]
    outline = color_camera.project(in_sensor(world_from_color, corners))
    # The corners are the centres of the outermost pixels.
    middle = outline.mean(axis=0)
    outline = middle + (outline - middle) * (1.0 + 4.0 / min(depth_camera.width, depth_camera.height))
    away = np.ones((color_camera.height, color_camera.width), dtype=np.uint8)
    if np.isfinite(outline).all():
        cv2.fillConvexPoly(away, outline.round().clip(-9999, 9999).astype(np.int32), 0)
    away.setflags(write=False)
    return away.view(np.bool_)
