"""What adapters draw measurements into: the image of a camera or a view from above, and a step in Rerun."""

from __future__ import annotations

import colorsys
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias, TypeVar

import cv2
import numpy as np
import numpy.typing as npt

from voodoo._core import Estimate, SiteRay
from voodoo.drawing.ink import RAY, SUBPIXEL, Color, Picture, drawable, point
from voodoo.measurements import ColorImage, DepthImage, FloatArray, KeypointImage
from voodoo.model.body import Body
from voodoo.model.projection import NEAREST_M, CameraView, View, limb_silhouette

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
            if not drawable(pixels).all():
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


_ON_BODY_M = 0.12


def limb_colors(body: Body) -> dict[str, tuple[int, int, int]]:
    """A color for each limb, with evenly spaced hues."""
    count = len(body.limbs)
    colors = {}
    for index, limb in enumerate(body.limbs):
        red, green, blue = colorsys.hsv_to_rgb(index / count, 0.75, 1.0)
        colors[limb.name] = (round(255 * red), round(255 * green), round(255 * blue))
    return colors


def nearest_limb(points: FloatArray, estimate: Estimate, body: Body) -> npt.NDArray[np.intp]:
    """(N,) index of the limb whose surface is nearest to each world point (N, 3), the number of limbs for the
    background."""
    if not len(points) or not len(estimate.joint_positions):
        return np.full(len(points), len(body.limbs), dtype=np.intp)
    distances = np.full((len(body.limbs) + 1, len(points)), np.inf)
    distances[-1] = _ON_BODY_M
    low = estimate.joint_positions.min(axis=0) - 0.4
    near = np.flatnonzero(((points > low) & (points < estimate.joint_positions.max(axis=0) + 0.4)).all(axis=1))
    if len(near):
        for index, limb in enumerate(body.limbs):
            pose = estimate.world_from_limb[limb.name]
            local = np.ascontiguousarray((points[near] - pose[:3, 3]) @ pose[:3, :3])
            distances[index, near] = np.abs(limb.shape.closest_points(local).signed_distance)
    return np.asarray(distances.argmin(axis=0))


def bands(estimate: Estimate, body: Body) -> list[FloatArray]:
    """The elastic band of each joint's center as (2, 3): from the parent's half of the joint to the child's."""
    strips = []
    for name, parent, _, joint, _ in body.core.parts()[1]:
        if parent is None or joint is None:
            continue
        ends = []
        for limb, (place, _) in ((parent, joint[1]), (name, joint[2])):
            pose = estimate.world_from_limb[limb]
            ends.append(pose[:3, :3] @ np.asarray(place) + pose[:3, 3])
        strips.append(np.array(ends))
    return strips


Pixel = TypeVar("Pixel", bound=np.generic)
_BODY_POINTS = 400
"""Number of points of a depth image that are shown on the body, enough to recognize their limbs."""
_BACKGROUND = (90, 90, 90)
_DEPTH_STEP = 0.005
"""Depths are rounded to steps of this fraction, below the noise of depth cameras; this halves the size of the images."""
_POINT_FILL = 0.3
"""Fraction of its pixel that a point of a depth image fills, so that the model is visible between the points."""
_SILHOUETTE_PX = 0.3
"""Tolerance of simplified silhouettes."""
_PNG = [cv2.IMWRITE_PNG_COMPRESSION, 6]
if hasattr(cv2, "IMWRITE_PNG_FILTER"):  # few distinct depths compress better without differences
    _PNG += [cv2.IMWRITE_PNG_FILTER, cv2.IMWRITE_PNG_FILTER_NONE]


@dataclass(frozen=True, eq=False)
class Log:
    """One step in Rerun, to which adapters log.

    Args:
        rr: the module `rerun`.
        stream: recording stream, at the time of the step.
        estimate: of the step.
        body: body with its sizes in the step.
        most_points: larger clouds and images are subsampled.
        whole: depth images are shown at full resolution, as in a viewer; in a file they would need most of the space.
    """

    rr: Any
    stream: Any
    estimate: Estimate
    body: Body
    most_points: int
    whole: bool = False

    @property
    def limbs(self) -> int:
        """How many limbs the body has."""
        return len(self.body.limbs)

    def send(self, path: str, *archetypes: Any) -> None:  # noqa: ANN401 - Rerun's own
        """Log archetypes of Rerun at a path."""
        self.stream.log(path, *archetypes)

    def entity(self, sensor: str) -> str:
        """A sensor's name as part of a path."""
        return entity(sensor)

    def camera(self, item: Pictured) -> str:
        """Log pose and calibration of a camera; returns the path of its image."""
        rr, path, pose = self.rr, f"world/cameras/{entity(item.sensor)}", item.root_from_sensor
        camera = item.camera
        self.send(path, rr.Transform3D(translation=pose[:3, 3], mat3x3=pose[:3, :3]))
        about = {"resolution": (camera.width, camera.height), "camera_xyz": rr.ViewCoordinates.RDF}
        self.send(f"{path}/picture", rr.Pinhole(image_from_camera=camera.matrix, image_plane_distance=0.3, **about))
        return path

    def silhouettes(self, path: str, item: Pictured) -> None:
        """Log the silhouettes of the limbs in the camera's image at a path."""
        silhouettes, colors, of_limb = [], [], limb_colors(self.body)
        view = CameraView(item.camera, item.root_from_sensor)
        for limb in self.body.limbs if self.estimate.joints else ():
            contour = limb_silhouette(limb.shape, self.estimate.world_from_limb[limb.name], view)
            if contour is not None:
                corners = cv2.approxPolyDP(contour, _SILHOUETTE_PX, closed=True).reshape(-1, 2)
                silhouettes.append(np.vstack([corners, corners[:1]]) + 0.5)
                colors.append(of_limb[limb.name])
        self.send(f"{path}/picture/model", self.rr.LineStrips2D(silhouettes, radii=0.5, colors=colors))

    def depth(self, path: str, image: npt.NDArray[Any], meters_per_unit: float) -> None:
        """Log a depth image (H, W), compressed: to a quarter of a percent, and in a file not more pixels than `most_points`."""
        step = 1 if self.whole else every(image.size, self.most_points)
        millimeters = grown(rounded_millimeters(image[::step, ::step], meters_per_unit), step, image.shape)
        blob = cv2.imencode(".png", millimeters, _PNG)[1].tobytes()
        about = {"media_type": "image/png", "meter": 1000.0, "point_fill_ratio": _POINT_FILL}
        self.send(path, self.rr.EncodedDepthImage(blob, **about))

    def body_points(
        self, path: str, points: npt.NDArray[Any], pose: FloatArray, *, background: bool = True
    ) -> npt.NDArray[np.intp]:
        """Log points (N, 3) of a sensor at `pose` (4, 4), colored by limb, those on none only with `background`; the limb of
        each (N,), `limbs`: none."""
        world = np.asarray(points, dtype=np.float64) @ pose[:3, :3].T + pose[:3, 3]
        colors = np.array([*limb_colors(self.body).values(), _BACKGROUND], dtype=np.uint8)
        limbs = nearest_limb(world, self.estimate, self.body)
        displayed = np.arange(len(limbs)) if background else np.flatnonzero(limbs < self.limbs)
        if not background:
            displayed = displayed[:: max(math.ceil(len(displayed) / _BODY_POINTS), 1)]
            displayed = displayed[np.argsort(limbs[displayed], kind="stable")]  # runs of equal colors compress well
        positions = world[displayed].astype(np.float32)
        self.send(path, self.rr.Points3D(positions, radii=0.006, colors=colors[limbs[displayed]]))
        return limbs


def every(pixels: int, most: int) -> int:
    """Returns the subsampling step of rows and columns that reduces an image to approximately `most` pixels."""
    return math.ceil(math.sqrt(pixels / most))


def grown(image: npt.NDArray[Pixel], step: int, shape: tuple[int, ...]) -> npt.NDArray[Pixel]:
    """Enlarges a subsampled image (every `step`-th row and column) to `shape` (H, W) by repeating its pixels."""
    return image.repeat(step, axis=0).repeat(step, axis=1)[: shape[0], : shape[1]]


def rounded_millimeters(image: npt.NDArray[Any], meters_per_unit: float) -> npt.NDArray[np.uint16]:
    """Depths [mm] quantized in relative steps, up to 65 m; 0 without a return, or nearer than any camera measures."""
    meters = image.astype(np.float64) * meters_per_unit
    observed = np.isfinite(meters) & (meters >= NEAREST_M)
    steps = np.round(np.log(meters, where=observed, out=np.zeros_like(meters)) / _DEPTH_STEP)
    rounded = np.minimum(np.round(1000.0 * np.exp(_DEPTH_STEP * steps)), 65535.0)
    return np.where(observed, rounded, 0.0).astype(np.uint16)


def entity(name: str) -> str:
    """The name of a sensor as part of a path."""
    return name.strip("/").replace("/", "_").replace(" ", "_") or "sensor"
