"""Pictures to look at: limbs, joints and measured points drawn over what the sensor saw."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import islice
from typing import TypeAlias

import cv2
import numpy as np
import numpy.typing as npt

import voodoo
from voodoo.overlay_inputs import Picture, draw_keypoints, draw_points, draw_rays, draw_skin
from voodoo.recordings import ColorImage, DepthImage, KeypointImage, RecordedFrame, Recording
from voodoo.sensors.front_end import FrontEnd, paired
from voodoo.views import Axes, CameraView, TopView, View, limb_outline, limb_rings, transform

Pictured: TypeAlias = DepthImage | ColorImage | KeypointImage
"""Measurements of a camera."""
FloatArray: TypeAlias = npt.NDArray[np.float64]

_LEFT, _RIGHT, _MIDDLE = (235, 170, 60), (60, 140, 250), (190, 205, 190)  # BGR: blue, orange, grey
_STATUS = {"tracking": (150, 220, 120), "degraded": (80, 200, 250), "lost": (80, 80, 250)}
_INK, _PAPER = (250, 250, 250), (24, 20, 18)
_ORDER: tuple[type, ...] = (DepthImage, ColorImage, KeypointImage)
_LOOK_AHEAD, _MOST_PANELS = 5, 4
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
        """Look at the first frames for the cameras: every picture of a film has the same size."""
        self._frames = len(recording)
        self._axes: Axes = "optical" if recording.root_frame.endswith("optical_frame") else "rep103"
        self._range: tuple[float, float] | None = None
        self._origin: float | None = None
        self._panels: dict[str, Pictured] = {}
        for recorded in islice(paired(recording), _LOOK_AHEAD):
            for item in recorded.measurements:
                if isinstance(item, (DepthImage, ColorImage, KeypointImage)) and not self._has(item):
                    self._panels[item.sensor] = item
        self._panels = dict(sorted(self._panels.items(), key=lambda pair: _ORDER.index(type(pair[1])))[:_MOST_PANELS])

    def _has(self, item: Pictured) -> bool:
        """Whether this sensor has a panel; keypoints are drawn into the picture they were found in."""
        return item.sensor in self._panels or (
            isinstance(item, KeypointImage) and any(_same_place(item, other) for other in self._panels.values())
        )

    def draw(
        self,
        recorded: RecordedFrame,
        body: voodoo.Body,
        estimate: voodoo.Estimate,
        *,
        index: int,
        front_end: FrontEnd | None = None,
    ) -> Picture:
        """Draw one frame over the picture of each camera, side by side, else as seen from above.

        Args:
            recorded: the measurements.
            body: with the sizes it had in this frame.
            estimate: the pose.
            index: number of the frame, from 0, for the caption.
            front_end: gives the rays and skin regions of the frame.
        """
        current = {item.sensor: item for item in recorded.measurements if isinstance(item, Pictured)}
        canvases: list[Picture] = []
        for sensor, first in self._panels.items():
            scale = _scale(first)
            picture = self._background(current.get(sensor), first)
            resized = cv2.resize(picture, None, fx=scale, fy=scale, interpolation=cv2.INTER_NEAREST)
            canvas = np.asarray(resized, dtype=np.uint8)
            item = current.get(sensor, first)
            view: View = CameraView(item.camera, item.root_from_sensor, scale)
            self._draw_all(canvas, recorded, body, estimate, view, front_end)
            draw_keypoints(canvas, recorded, item.camera, item.root_from_sensor, scale)
            if front_end is not None and isinstance(first, ColorImage) and sensor in current:
                draw_skin(canvas, front_end, sensor, scale)
            canvases.append(canvas)
        if not canvases:
            joints = np.array(list(estimate.joints.values()))
            x, y, z = (float(value) for value in np.median(joints, axis=0))
            top = TopView((x, y, z), _TOP_METRES / _TOP_SIZE, _TOP_SIZE, self._axes)
            canvases.append(_grid(top))
            self._draw_all(canvases[0], recorded, body, estimate, top, front_end)
        canvas = side_by_side(canvases)
        self._origin = estimate.stamp if self._origin is None else self._origin
        caption(canvas, f"{index + 1}/{self._frames}   {estimate.stamp - self._origin:.2f} s", estimate)
        return canvas

    def _draw_all(
        self,
        canvas: Picture,
        recorded: RecordedFrame,
        body: voodoo.Body,
        estimate: voodoo.Estimate,
        view: View,
        front_end: FrontEnd | None,
    ) -> None:
        draw_body(canvas, body, estimate, view)
        draw_points(canvas, recorded, view)
        if front_end is not None:
            draw_rays(canvas, front_end, estimate, view)

    def _background(self, item: Pictured | None, first: Pictured) -> Picture:
        """What the camera saw; dark paper when it saw nothing new, or only its keypoints are known."""
        if isinstance(item, DepthImage):
            return self._depth_picture(item)
        if isinstance(item, ColorImage):
            return np.array(item.image)
        return np.full((first.camera.height, first.camera.width, 3), _PAPER, dtype=np.uint8)

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
    sides = np.stack([points[0], points[1], following[1], following[0]], axis=1)[..., :2]
    caps = np.stack([points[0], points[1][::-1]])[..., :2]
    axis = transform(root_from_limb, np.array([[0.0, 0.0, 0.0], [0.0, 0.0, shape.length]]))
    middle = axis.mean(axis=0)
    corners = np.concatenate([rings, np.roll(rings, -1, axis=1)])
    normals = corners.mean(axis=0) - middle
    normals -= np.outer(normals @ (axis[1] - axis[0]), axis[1] - axis[0]) / max(shape.length**2, 1e-12)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    # A light at the viewer: how far a normal points to the viewer is how far a small step along it reduces the depth.
    step = 1e-3
    towards = (view.project(middle[None])[1] - view.project(middle + step * normals)[1]) / step
    lights = 0.35 + 0.65 * np.clip(towards, 0.0, 1.0)
    for facets, shades in ((sides, lights), (caps, np.full(2, 0.8))):
        # The others are seen from behind.
        for facet, light in zip(_fixed(facets[_ahead(facets)]), shades[_ahead(facets)].tolist(), strict=True):
            cv2.fillConvexPoly(layer, facet, tuple(light * channel for channel in color), cv2.LINE_8, _SUBPIXEL)


def _ahead(facets: FloatArray) -> npt.NDArray[np.bool_]:
    """Which polygons (K, N, 2) in pixels run clockwise, and so face the viewer."""
    x, y = facets[..., 0], facets[..., 1]
    return np.asarray((x * np.roll(y, -1, axis=1) - y * np.roll(x, -1, axis=1)).sum(axis=1) > 0.0)


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


def side_by_side(pictures: Sequence[Picture]) -> Picture:
    """Pictures in a row, all as high as the first one."""
    height = pictures[0].shape[0]
    row = [
        picture
        if picture.shape[0] == height
        else cv2.resize(
            picture,
            (round(picture.shape[1] * height / picture.shape[0]), height),
            interpolation=cv2.INTER_AREA,
        )
        for picture in pictures
    ]
    return np.asarray(np.hstack(row), dtype=np.uint8)


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


def _scale(item: Pictured) -> float:
    """Small pictures are enlarged by a whole number, large ones reduced to the same height."""
    height = item.camera.height
    return float(-(-_TARGET_HEIGHT // height)) if height <= _TARGET_HEIGHT else _TARGET_HEIGHT / height


def _same_place(item: Pictured, other: Pictured) -> bool:
    return item.camera == other.camera and np.allclose(item.root_from_sensor, other.root_from_sensor)


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
