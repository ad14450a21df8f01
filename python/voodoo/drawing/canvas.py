"""The image on which adapters draw their measurements: that of a camera, or a view from above."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

import cv2
import numpy as np
import numpy.typing as npt

from voodoo._core import Estimate, SiteRay
from voodoo.drawing.ink import RAY, SUBPIXEL, Color, FloatArray, Picture, point
from voodoo.measurements import ColorImage, DepthImage, KeypointImage
from voodoo.model.projection import View

Pictured: TypeAlias = DepthImage | ColorImage | KeypointImage
"""Measurements of a camera."""
_RAY_HALF_M = 0.20


@dataclass(frozen=True, eq=False)
class Canvas:
    """The picture of one camera, or a view from above, into which adapters draw.

    Objects in space are drawn immediately; image features (rings, regions) are drawn by `finish`, so that rays do not cover
    them.

    Args:
        picture: image to draw into.
        view: projection of the root frame into the image.
        camera: the measurement of this image; None: a view from above.
        scale: scale factor from the camera's image to the drawn image.
    """

    picture: Picture
    view: View
    camera: Pictured | None = None
    scale: float = 1.0
    _rings: list[tuple[FloatArray, FloatArray, Color]] = field(default_factory=list)
    _regions: dict[str, tuple[npt.NDArray[np.bool_], FloatArray, Mapping[str, FloatArray], Color]] = field(
        default_factory=dict
    )

    def dots(self, points_root: FloatArray, *, color: Color, radius: int) -> None:
        """Points (N, 3) [m] of the root frame as dots; colors are BGR, radii pixels."""
        pixels, _ = self.view.project(points_root)
        height, width = self.picture.shape[:2]
        with np.errstate(invalid="ignore"):
            visible = ((pixels >= 0.0) & (pixels < (width, height))).all(axis=1)
        for pixel in pixels[visible]:
            cv2.circle(self.picture, point(pixel), radius << SUBPIXEL, color, -1, cv2.LINE_AA, SUBPIXEL)

    def rings(self, item: Pictured, pixels: FloatArray, strengths: FloatArray, *, color: Color) -> None:
        """Rings about pixels (N, 2) of a camera, fainter with less strength (N,), if this is its picture."""
        if self.camera is not None and same_place(item, self.camera):
            self._rings.append((pixels, strengths, color))

    def regions(
        self,
        item: Pictured,
        mask: npt.NDArray[np.bool_],
        *,
        marks: Sequence[tuple[float, float]],
        names: Mapping[str, tuple[float, float]],
        color: Color,
    ) -> None:
        """Outlines of a mask (H, W), dots at pixels, and names beside others, if this is the sensor's own picture."""
        if self.camera is not None and item.sensor == self.camera.sensor:
            places = np.array(marks, dtype=np.float64).reshape(-1, 2)
            self._regions[item.sensor] = (mask, places, {name: np.array(pixel) for name, pixel in names.items()}, color)

    def rays(self, rays: Sequence[SiteRay], estimate: Estimate) -> None:
        """Draw 40 cm of each ray around the point nearest to its site, with a cross at that point."""
        for ray in rays:
            reach = float((estimate.joints[ray.site] - ray.origin) @ ray.direction)
            along = ray.origin + np.outer((reach - _RAY_HALF_M, reach, reach + _RAY_HALF_M), ray.direction)
            pixels, _ = self.view.project(along)
            if not (np.isfinite(pixels).all() and np.abs(pixels).max() < 1e5):
                continue
            start, middle, end = (point(pixel) for pixel in pixels)
            cv2.line(self.picture, start, end, RAY, 1, cv2.LINE_AA, SUBPIXEL)
            center = tuple(value >> SUBPIXEL for value in middle)
            cv2.drawMarker(self.picture, (center[0], center[1]), RAY, cv2.MARKER_TILTED_CROSS, 11, 1, cv2.LINE_AA)

    def finish(self) -> None:
        """Draw the image features."""
        for pixels, strengths, color in self._rings:
            for pixel, confidence in zip(pixels, strengths, strict=True):
                strength = 0.3 + 0.7 * min(float(confidence), 1.0)
                ring = tuple(strength * channel for channel in color)
                center = point((pixel + 0.5) * self.scale)
                cv2.circle(self.picture, center, 4 << SUBPIXEL, ring, 2, cv2.LINE_AA, SUBPIXEL)
        for mask, marks, names, color in self._regions.values():
            self._draw_regions(mask, marks, names, color)

    def _draw_regions(
        self, mask: npt.NDArray[np.bool_], marks: FloatArray, names: Mapping[str, FloatArray], color: Color
    ) -> None:
        contours, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
        silhouettes = [np.round((contour + 0.5) * self.scale).astype(np.int32) for contour in contours]
        cv2.polylines(self.picture, silhouettes, True, color, 1, cv2.LINE_AA)
        for mark in marks:
            cv2.circle(self.picture, point((mark + 0.5) * self.scale), 3 << SUBPIXEL, color, -1, 0, SUBPIXEL)
        for name, pixel in names.items():
            u, v = (pixel * self.scale).astype(int)
            place = (int(u) + 8, int(v) - 8)
            cv2.putText(self.picture, name, place, cv2.FONT_HERSHEY_SIMPLEX, 0.5, color, 1, cv2.LINE_AA)


def same_place(item: Pictured, other: Pictured) -> bool:
    """Whether two measurements have the same camera model and pose."""
    return item.camera == other.camera and np.allclose(item.root_from_sensor, other.root_from_sensor)
