"""The surface of limbs: silhouettes in views, which project points of the root frame to an image, and meshes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

import cv2
import numpy as np
import numpy.typing as npt

from voodoo._core import Estimate, TaperedEllipticCylinder
from voodoo.model.body import Body
from voodoo.model.camera import Camera
from voodoo.model.joint import FloatArray
from voodoo.model.transforms import inverse

Axes: TypeAlias = Literal["rep103", "optical"]

NEAREST_M = 0.05
"""Smallest depth that a camera measures, or shows of a model [m]."""


@dataclass(frozen=True, eq=False)
class CameraView:
    """View of a camera.

    Args:
        camera: its calibration.
        root_from_sensor: (4, 4) pose of its optical frame.
        scale: scale factor of the image.
    """

    camera: Camera
    root_from_sensor: FloatArray
    scale: float = 1

    def project(self, points_root: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Pixels (N, 2) of points (N, 3) [m], NaN for invisible points, and their depths (N,) [m] along the optical axis."""
        points = transform(inverse(self.root_from_sensor), points_root)
        points[points[:, 2] < NEAREST_M] = np.nan
        # Integer coordinates are pixel centers, so scaling includes an offset of half a pixel.
        return (self.camera.project(points) + 0.5) * self.scale - 0.5, points[:, 2]


@dataclass(frozen=True)
class TopView:
    """Orthographic view from above: forward is up in the image, left is left.

    Args:
        center: (x, y, z) [m] of the root frame at the center of the image.
        meters_per_pixel: scale of the image.
        size: width = height [px].
        axes: "rep103" for root frames with x forward, y left, z up; "optical" for x right, y down, z forward.
    """

    center: tuple[float, float, float]
    meters_per_pixel: float
    size: int
    axes: Axes = "rep103"

    def project(self, points_root: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Pixels (N, 2) of points (N, 3) [m], and their depths (N,) [m] downwards from the center."""
        x, y, z = (points_root - np.array(self.center)).T
        right, forward, down = (-y, x, -z) if self.axes == "rep103" else (x, z, y)
        pixels = np.column_stack([right, -forward]) / self.meters_per_pixel + (self.size - 1) / 2
        return pixels, down


View: TypeAlias = CameraView | TopView
"""Projects points of the root frame into an image."""


def transform(a_from_b: FloatArray, points_b: FloatArray) -> FloatArray:
    """Points (..., 3) of frame b in frame a."""
    return np.asarray(points_b @ a_from_b[:3, :3].T + a_from_b[:3, 3])


def limb_rings(shape: TaperedEllipticCylinder, *, samples: int = 48) -> FloatArray:
    """Both end ellipses of a limb as (2, samples, 3) points [m] in the limb frame, the proximal one first."""
    angle = np.linspace(0.0, 2.0 * np.pi, samples, endpoint=False)
    t = np.array([[0.0], [1.0]])
    a, b = shape.a0 + (shape.a1 - shape.a0) * t, shape.b0 + (shape.b1 - shape.b0) * t
    return np.stack([a * np.cos(angle), b * np.sin(angle), np.broadcast_to(shape.length * t, (2, samples))], axis=2)


def limb_silhouette(
    shape: TaperedEllipticCylinder, root_from_limb: FloatArray, view: View
) -> npt.NDArray[np.float32] | None:
    """Silhouette of a limb in a view: (K, 2) pixels, convex.

    The solid is a union of segments between its two end ellipses, so its silhouette is their convex hull (except for lens
    distortion, and up to 0.1 mm by which a tapered side may be concave).

    Returns:
        None if a part of the limb is behind the camera.
    """
    points = transform(root_from_limb, limb_rings(shape).reshape(-1, 3))
    return _hull(view.project(points)[0])


def _hull(pixels: FloatArray) -> npt.NDArray[np.float32] | None:
    if not np.isfinite(pixels).all():
        return None
    hull = cv2.convexHull(pixels.astype(np.float32))
    return np.asarray(hull, dtype=np.float32).reshape(-1, 2)


def body_mask(body: Body, estimate: Estimate, view: View, *, width: int, height: int) -> npt.NDArray[np.bool_]:
    """Pixels (height, width) whose centers lie inside the silhouette of a limb."""
    mask = np.zeros((height, width), dtype=bool)
    points = [transform(estimate.world_from_limb[limb.name], limb_rings(limb.shape)) for limb in body.limbs]
    for pixels in view.project(np.reshape(points, (-1, 3)))[0].reshape(len(points), -1, 2):
        contour = _hull(pixels)
        if contour is not None and len(contour) >= 3:
            _fill(mask, contour.astype(np.float64))
    return mask


def _fill(mask: npt.NDArray[np.bool_], contour: FloatArray) -> None:
    """Set the pixels whose centers lie in a convex polygon (K, 2).

    cv2.fillConvexPoly would also set all pixels that the border touches, which adds half a pixel on all sides.
    """
    height, width = mask.shape
    low = np.clip(np.ceil(contour.min(axis=0)), 0, (width, height)).astype(int)
    high = np.clip(np.floor(contour.max(axis=0)) + 1, 0, (width, height)).astype(int)
    if (high <= low).any():
        return
    x, y = np.arange(low[0], high[0]), np.arange(low[1], high[1])[:, None]
    edge = np.roll(contour, -1, axis=0) - contour
    edge, start = edge[edge[:, 1] != 0.0], contour[edge[:, 1] != 0.0]
    if not len(edge):
        return
    # Where the line of each edge crosses the rows: a row is inside between the edges that go down and those that go up.
    crossing = start[:, 0] + edge[:, 0] / edge[:, 1] * (y - start[:, 1])
    down = edge[:, 1] > 0.0
    if crossing[:, down].mean() > crossing[:, ~down].mean():
        down = ~down
    first, last = crossing[:, down].max(axis=1), crossing[:, ~down].min(axis=1)
    mask[low[1] : high[1], low[0] : high[0]] |= (x >= first[:, None]) & (x <= last[:, None])


_AROUND = 24


def limb_mesh(
    shape: TaperedEllipticCylinder,
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.uint32], npt.NDArray[np.float32]]:
    """Vertices (V, 3) [m] in the limb frame, triangles (T, 3) counter-clockwise from outside, and unit normals (V,
    3)."""
    angle = np.linspace(0.0, 2.0 * np.pi, _AROUND, endpoint=False)
    ring = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(_AROUND)])
    low, high = limb_rings(shape, samples=_AROUND)
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
    corners = (
        (here, following, n + here),
        (following, n + following, n + here),
        (4 * n, 2 * n + following, 2 * n + here),
        (4 * n + 1, 3 * n + here, 3 * n + following),
    )
    triangles = np.vstack([np.column_stack(np.broadcast_arrays(*each)) for each in corners])
    return vertices.astype(np.float32), triangles.astype(np.uint32), normals.astype(np.float32)
