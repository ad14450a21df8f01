"""Pictures to look at: limbs, joints and measured points drawn over what the sensor saw."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import cv2
import numpy as np
import numpy.typing as npt

import voodoo
from voodoo.recordings import ColorImage, DepthImage, LaserScan, PointCloud, RecordedFrame, Recording
from voodoo.views import Axes, CameraView, TopView, View, limb_outline, limb_rings, transform

Picture: TypeAlias = npt.NDArray[np.uint8]
"""(H, W, 3) BGR."""
FloatArray: TypeAlias = npt.NDArray[np.float64]

_LEFT, _RIGHT, _MIDDLE = (235, 170, 60), (60, 140, 250), (190, 205, 190)  # BGR: blue, orange, grey
_STATUS = {"tracking": (150, 220, 120), "degraded": (80, 200, 250), "lost": (80, 80, 250)}
_SCAN, _CLOUD, _INK, _PAPER = (90, 230, 90), (225, 225, 120), (250, 250, 250), (24, 20, 18)
_OPACITY = 0.62
_TARGET_HEIGHT = 640
_TOP_SIZE, _TOP_METRES = 720, 6.0
_SUBPIXEL = 4
_FACETS = 64


class Overlay:
    """Draws the frames of one recording, all of them with the same colours for the same depth.

    Args:
        recording: gives the number of frames and the root frame.
    """

    def __init__(self, recording: Recording) -> None:
        """Remember what the frames have in common."""
        self._frames = len(recording)
        self._axes: Axes = "optical" if recording.root_frame.endswith("optical_frame") else "rep103"
        self._range: tuple[float, float] | None = None
        self._origin: float | None = None

    def draw(self, recorded: RecordedFrame, body: voodoo.Body, estimate: voodoo.Estimate, *, index: int) -> Picture:
        """Draw one frame: over its depth image, else over its colour image, else as seen from above.

        Args:
            recorded: the measurements.
            body: with the sizes it had in this frame.
            estimate: the pose.
            index: number of the frame, from 0, for the caption.
        """
        depth = [item for item in recorded.measurements if isinstance(item, DepthImage)]
        color = [item for item in recorded.measurements if isinstance(item, ColorImage)]
        view: View
        if depth or color:
            item = depth[-1] if depth else color[-1]
            scale = -(-_TARGET_HEIGHT // item.camera.height)
            background = self._depth_picture(item) if isinstance(item, DepthImage) else np.array(item.image)
            picture = cv2.resize(background, None, fx=scale, fy=scale, interpolation=cv2.INTER_NEAREST)
            view = CameraView(item.camera, item.root_from_sensor, scale)
        else:
            joints = np.array(list(estimate.joints.values()))
            x, y, z = (float(value) for value in np.median(joints, axis=0))
            view = TopView((x, y, z), _TOP_METRES / _TOP_SIZE, _TOP_SIZE, self._axes)
            picture = _grid(view)
        canvas = np.asarray(picture, dtype=np.uint8)
        draw_points(canvas, recorded, view)
        draw_body(canvas, body, estimate, view)
        self._origin = estimate.stamp if self._origin is None else self._origin
        caption(canvas, f"{index + 1}/{self._frames}   {estimate.stamp - self._origin:.2f} s", estimate)
        return canvas

    def _depth_picture(self, depth: DepthImage) -> Picture:
        """Depth as colour: near is bright; nothing measured is dark."""
        metres = depth.image.astype(np.float32) * depth.metres_per_unit
        seen = np.isfinite(metres) & (metres > 0.0)
        if self._range is None and seen.any():
            near, far = np.percentile(metres[seen], [1.0, 97.0])
            self._range = float(near) - 0.3, float(far) + 0.6
        near, far = self._range or (0.5, 5.0)
        level = np.where(seen, 1.0 - np.clip((metres - near) / (far - near), 0.0, 1.0), 0.0)
        tone = (40.0 + 190.0 * level**1.3).astype(np.uint8)
        picture = np.asarray(cv2.applyColorMap(tone, cv2.COLORMAP_BONE), dtype=np.uint8)
        picture[~seen] = _PAPER
        return picture


def draw_body(picture: Picture, body: voodoo.Body, estimate: voodoo.Estimate, view: View) -> None:
    """Draw limbs as shaded, half transparent solids with outlines, far ones first, then joints and sites."""
    limbs = []
    for limb in body.limbs:
        root_from_limb = np.asarray(estimate.world_from_limb[limb.name], dtype=np.float64)
        outline = limb_outline(limb.shape, root_from_limb, view)
        if outline is not None:
            centre = transform(root_from_limb, np.array([[0.0, 0.0, limb.shape.length / 2.0]]))
            limbs.append((float(view.project(centre)[1][0]), limb, root_from_limb, outline))
    layer, covered = picture.copy(), np.zeros(picture.shape[:2], dtype=np.uint8)
    for _, limb, root_from_limb, outline in sorted(limbs, key=lambda item: -item[0]):
        _draw_solid(layer, limb.shape, root_from_limb, view, side_color(limb.name))
        border = _fixed(outline)
        cv2.polylines(layer, [border], True, _PAPER, 1, cv2.LINE_AA, _SUBPIXEL)
        cv2.fillConvexPoly(covered, border, 255, cv2.LINE_8, _SUBPIXEL)
    inside = covered > 0
    mixed = cv2.addWeighted(layer, _OPACITY, picture, 1.0 - _OPACITY, 0.0)
    picture[inside] = mixed[inside]
    for _, limb, _, outline in limbs:
        cv2.polylines(picture, [_fixed(outline)], True, side_color(limb.name), 1, cv2.LINE_AA, _SUBPIXEL)
    _draw_sites(picture, estimate, view)


def _draw_solid(
    layer: Picture,
    shape: voodoo.TaperedEllipticCylinder,
    root_from_limb: FloatArray,
    view: View,
    color: tuple[int, int, int],
) -> None:
    """Fill the facets of a limb that face the viewer, brighter the more they do."""
    rings = transform(root_from_limb, limb_rings(shape, samples=_FACETS))
    pixels, depths = view.project(rings.reshape(-1, 3))
    points = np.column_stack([pixels, depths]).reshape(2, _FACETS, 3)
    following = np.roll(points, -1, axis=1)
    facets = [np.array([points[0, i], points[1, i], following[1, i], following[0, i]]) for i in range(_FACETS)]
    facets += [points[0], points[1][::-1]]
    axis = transform(root_from_limb, np.array([[0.0, 0.0, 0.0], [0.0, 0.0, shape.length]]))
    middle = axis.mean(axis=0)
    corners = np.concatenate([rings, np.roll(rings, -1, axis=1)])
    normals = corners.mean(axis=0) - middle
    normals -= np.outer(normals @ (axis[1] - axis[0]), axis[1] - axis[0]) / max(shape.length**2, 1e-12)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    # A light at the viewer: how far a normal points to the viewer is how far a small step along it reduces the depth.
    step = 1e-3
    towards = (view.project(middle[None])[1] - view.project(middle + step * normals)[1]) / step
    for index, facet in enumerate(facets):
        x, y = facet[:, 0], facet[:, 1]
        if np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1)) <= 0.0:
            continue  # seen from behind
        light = 0.35 + 0.65 * float(np.clip(towards[index], 0.0, 1.0)) if index < _FACETS else 0.8
        shade = tuple(float(light * channel) for channel in color)
        cv2.fillConvexPoly(layer, _fixed(facet[:, :2]), shade, cv2.LINE_8, _SUBPIXEL)


def _draw_sites(picture: Picture, estimate: voodoo.Estimate, view: View) -> None:
    """Draw every joint and site as a dot with a dark rim."""
    pixels, _ = view.project(np.array(list(estimate.joints.values()), dtype=np.float64))
    radius = max(3, round(picture.shape[0] / 160))
    for name, pixel in zip(estimate.joints, pixels, strict=True):
        if np.isfinite(pixel).all() and np.abs(pixel).max() < 1e5:
            centre = _point(pixel)
            cv2.circle(picture, centre, (radius + 2) << _SUBPIXEL, _PAPER, -1, cv2.LINE_AA, _SUBPIXEL)
            cv2.circle(picture, centre, (radius + 1) << _SUBPIXEL, side_color(name), -1, cv2.LINE_AA, _SUBPIXEL)
            cv2.circle(picture, centre, (radius - 1) << _SUBPIXEL, _INK, -1, cv2.LINE_AA, _SUBPIXEL)


def draw_points(picture: Picture, recorded: RecordedFrame, view: View) -> None:
    """Draw laser returns and cloud points as dots; depth pixels need none, they are the background."""
    for item in recorded.measurements:
        if isinstance(item, LaserScan):
            points, color, radius = item.points(), _SCAN, 2
        elif isinstance(item, PointCloud):
            points, color, radius = item.points, _CLOUD, 1
        else:
            continue
        pixels, _ = view.project(transform(item.root_from_sensor, points))
        height, width = picture.shape[:2]
        with np.errstate(invalid="ignore"):
            visible = ((pixels >= 0.0) & (pixels < (width, height))).all(axis=1)
        for pixel in pixels[visible]:
            cv2.circle(picture, _point(pixel), radius << _SUBPIXEL, color, -1, cv2.LINE_AA, _SUBPIXEL)


def caption(picture: Picture, text: str, estimate: voodoo.Estimate) -> None:
    """Write frame number, status and residual into the top left corner."""
    size = picture.shape[0] / 1100.0
    status = str(estimate.status)
    parts = [(text, _INK), (status, _STATUS.get(status, _INK)), (f"{1e3 * estimate.residual:.0f} mm", _INK)]
    x, y = round(22 * size), round(42 * size)
    for part, color in parts:
        for dx, dy in ((-1, 0), (1, 0), (0, -1), (0, 1)):  # a dark rim keeps it legible over bright depth
            cv2.putText(picture, part, (x + dx, y + dy), cv2.FONT_HERSHEY_DUPLEX, size, _PAPER, 1, cv2.LINE_AA)
        cv2.putText(picture, part, (x, y), cv2.FONT_HERSHEY_DUPLEX, size, color, 1, cv2.LINE_AA)
        x += cv2.getTextSize(part, cv2.FONT_HERSHEY_DUPLEX, size, 1)[0][0] + round(28 * size)


def contact_sheet(pictures: Sequence[Picture], *, columns: int, width: int = 1600, gap: int = 6) -> Picture:
    """Pictures of one size side by side, row by row.

    Args:
        pictures: at least one.
        columns: how many in a row.
        width: of the sheet [px].
        gap: between the pictures [px].
    """
    columns = min(columns, len(pictures))
    rows = -(-len(pictures) // columns)
    cell = (width - (columns - 1) * gap) // columns
    height = round(pictures[0].shape[0] * cell / pictures[0].shape[1])
    sheet = np.full((rows * height + (rows - 1) * gap, width, 3), _INK, dtype=np.uint8)
    for index, picture in enumerate(pictures):
        row, column = divmod(index, columns)
        top, left = row * (height + gap), column * (cell + gap)
        sheet[top : top + height, left : left + cell] = cv2.resize(
            picture, (cell, height), interpolation=cv2.INTER_AREA
        )
    return sheet


def side_color(name: str) -> tuple[int, int, int]:
    """BGR: blue for the person's left, orange for the right, grey for the middle."""
    return _LEFT if name.startswith("l_") else _RIGHT if name.startswith("r_") else _MIDDLE


def _grid(view: TopView) -> Picture:
    """Dark paper with a line every metre."""
    picture = np.full((view.size, view.size, 3), _PAPER, dtype=np.uint8)
    half = view.size * view.metres_per_pixel / 2.0
    centre = np.array(view.centre)
    horizontal = (0, 1) if view.axes == "rep103" else (0, 2)
    for along, across in (horizontal, horizontal[::-1]):
        for value in np.arange(np.ceil(centre[along] - half), centre[along] + half):
            ends = np.repeat(centre[None], 2, axis=0)
            ends[:, along] = value
            ends[:, across] += (-half, half)
            a, b = (_point(pixel) for pixel in view.project(ends)[0])
            cv2.line(picture, a, b, (62, 56, 52), 1, cv2.LINE_AA, _SUBPIXEL)
    return picture


def _fixed(pixels: npt.NDArray[np.floating]) -> npt.NDArray[np.int32]:
    """Pixel coordinates as OpenCV's fixed-point numbers."""
    return np.round(pixels * (1 << _SUBPIXEL)).astype(np.int32)


def _point(pixel: npt.NDArray[np.floating]) -> tuple[int, int]:
    x, y = (int(value) for value in _fixed(pixel))
    return x, y
