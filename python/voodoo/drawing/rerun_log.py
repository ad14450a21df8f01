"""Logging of a step to Rerun, used by adapters."""

from __future__ import annotations

import colorsys
import math
from dataclasses import dataclass
from typing import Any, TypeVar

import cv2
import numpy as np
import numpy.typing as npt

from voodoo._core import Estimate
from voodoo.drawing.canvas import Pictured
from voodoo.measurements import FloatArray
from voodoo.model.body import Body
from voodoo.model.projection import CameraView, limb_silhouette

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
_NEAREST_M = 0.05
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
        self.send(
            f"{path}/picture",
            rr.Pinhole(
                image_from_camera=camera.matrix,
                resolution=(camera.width, camera.height),
                camera_xyz=rr.ViewCoordinates.RDF,
                image_plane_distance=0.3,
            ),
        )
        return path

    def silhouettes(self, path: str, item: Pictured) -> None:
        """Log the silhouettes of the limbs in the camera's image at a path."""
        silhouettes, colors = [], []
        for limb in self.body.limbs if self.estimate.joints else ():
            view = CameraView(item.camera, item.root_from_sensor)
            contour = limb_silhouette(limb.shape, self.estimate.world_from_limb[limb.name], view)
            if contour is not None:
                corners = cv2.approxPolyDP(contour, _SILHOUETTE_PX, closed=True).reshape(-1, 2)
                silhouettes.append(np.vstack([corners, corners[:1]]) + 0.5)
                colors.append(limb_colors(self.body)[limb.name])
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
    observed = np.isfinite(meters) & (meters >= _NEAREST_M)
    steps = np.round(np.log(meters, where=observed, out=np.zeros_like(meters)) / _DEPTH_STEP)
    rounded = np.minimum(np.round(1000.0 * np.exp(_DEPTH_STEP * steps)), 65535.0)
    return np.where(observed, rounded, 0.0).astype(np.uint16)


def entity(name: str) -> str:
    """The name of a sensor as part of a path."""
    return name.strip("/").replace("/", "_").replace(" ", "_") or "sensor"
