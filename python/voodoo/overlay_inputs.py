"""The fused inputs in the overlay: laser returns, clouds, keypoints, skin regions, rays and markers."""

from __future__ import annotations

from typing import TypeAlias

import cv2
import numpy as np
import numpy.typing as npt

import voodoo
from voodoo.camera import Camera
from voodoo.recordings import KeypointImage, LaserScan, MarkerSet, PointCloud, RecordedFrame
from voodoo.sensors.front_end import FrontEnd
from voodoo.views import View, transform

Picture: TypeAlias = npt.NDArray[np.uint8]
"""(H, W, 3) BGR."""
FloatArray: TypeAlias = npt.NDArray[np.float64]
Color: TypeAlias = tuple[int, int, int]

SCAN, CLOUD, SKIN, KEYPOINT, RAY, MARKER = (
    (90, 230, 90), (225, 225, 120), (80, 255, 255), (255, 120, 255), (120, 255, 60), (60, 60, 255),
)  # fmt: skip
_RAY_HALF_M = 0.20
_SUBPIXEL = 4


def draw_points(picture: Picture, recorded: RecordedFrame, view: View) -> None:
    """Draw laser returns, cloud points and markers as dots; depth pixels need none, they are the background."""
    for item in recorded.measurements:
        if isinstance(item, LaserScan):
            _dots(picture, transform(item.root_from_sensor, item.points()), view, SCAN, 2)
        elif isinstance(item, PointCloud):
            _dots(picture, transform(item.root_from_sensor, item.points), view, CLOUD, 1)
        elif isinstance(item, MarkerSet) and item.positions:
            _dots(picture, np.array(list(item.positions.values()), dtype=np.float64), view, MARKER, 4)


def draw_rays(picture: Picture, front_end: FrontEnd, estimate: voodoo.Estimate, view: View) -> None:
    """Draw the part of each ray that passes its site, 20 cm to either side, with a cross where it is nearest."""
    for ray in front_end.rays:
        reach = float((estimate.joints[ray.site] - ray.origin) @ ray.direction)
        along = ray.origin + np.outer((reach - _RAY_HALF_M, reach, reach + _RAY_HALF_M), ray.direction)
        pixels, _ = view.project(along)
        if not (np.isfinite(pixels).all() and np.abs(pixels).max() < 1e5):
            continue
        start, middle, end = (_point(pixel) for pixel in pixels)
        cv2.line(picture, start, end, RAY, 1, cv2.LINE_AA, _SUBPIXEL)
        centre = tuple(value >> _SUBPIXEL for value in middle)
        cv2.drawMarker(picture, (centre[0], centre[1]), RAY, cv2.MARKER_TILTED_CROSS, 11, 1, cv2.LINE_AA)


def draw_skin(picture: Picture, front_end: FrontEnd, sensor: str, scale: float) -> None:
    """Draw the outlines of all skin regions of one camera; candidates are dots, the assigned ones are named."""
    skin = front_end.skin.get(sensor)
    if skin is None or skin.mask is None:
        return
    contours, _ = cv2.findContours(skin.mask.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    outlines = [np.round((contour + 0.5) * scale).astype(np.int32) for contour in contours]
    cv2.polylines(picture, outlines, True, SKIN, 1, cv2.LINE_AA)
    for candidate in skin.candidates:
        cv2.circle(picture, _point((np.array(candidate.pixel) + 0.5) * scale), 3 << _SUBPIXEL, SKIN, -1, 0, _SUBPIXEL)
    for site, candidate in skin.assigned.items():
        u, v = (np.array(candidate.pixel) * scale).astype(int)
        cv2.putText(picture, site, (int(u) + 8, int(v) - 8), cv2.FONT_HERSHEY_SIMPLEX, 0.5, SKIN, 1, cv2.LINE_AA)


def draw_keypoints(
    picture: Picture, recorded: RecordedFrame, camera: Camera, root_from_sensor: FloatArray, scale: float
) -> None:
    """Draw the keypoints that were found in the images of one camera as rings; fainter with less confidence."""
    for item in recorded.measurements:
        if not (isinstance(item, KeypointImage) and item.camera == camera):
            continue
        if not np.allclose(item.root_from_sensor, root_from_sensor):
            continue
        for person in item.people:
            for u, v, confidence in person[np.isfinite(person).all(axis=1) & (person[:, 2] > 0.0)]:
                centre = _point((np.array((u, v)) + 0.5) * scale)
                strength = 0.3 + 0.7 * min(float(confidence), 1.0)
                ring = tuple(strength * channel for channel in KEYPOINT)
                cv2.circle(picture, centre, 4 << _SUBPIXEL, ring, 2, cv2.LINE_AA, _SUBPIXEL)


def _dots(picture: Picture, points: FloatArray, view: View, color: Color, radius: int) -> None:
    pixels, _ = view.project(points)
    height, width = picture.shape[:2]
    with np.errstate(invalid="ignore"):
        visible = ((pixels >= 0.0) & (pixels < (width, height))).all(axis=1)
    for pixel in pixels[visible]:
        cv2.circle(picture, _point(pixel), radius << _SUBPIXEL, color, -1, cv2.LINE_AA, _SUBPIXEL)


def _point(pixel: npt.NDArray[np.floating]) -> tuple[int, int]:
    """Pixel coordinates as OpenCV's fixed-point numbers."""
    x, y = (int(value) for value in np.round(pixel * (1 << _SUBPIXEL)))
    return x, y
