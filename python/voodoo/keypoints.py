"""2-D keypoints of any network as measurements: one table of layouts, rays, and robust 3-D points from registered
depth."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from voodoo._core import Frame
from voodoo.camera import Camera
from voodoo.errors import MeasurementError, RecordingError, reading
from voodoo.keypoint_layouts import LAYOUTS, Layout
from voodoo.poses import rigid
from voodoo.sensors.gating import SiteGate
from voodoo.sensors.model import PixelNoise, SensorModel
from voodoo.sensors.pixels import checked_camera, in_sensor, ray_distance, world_rays
from voodoo.sensors.rays import SiteRay, add_rays

FloatArray: TypeAlias = npt.NDArray[np.float64]
DepthArray: TypeAlias = npt.NDArray[np.uint16] | npt.NDArray[np.float32]

MIN_CONFIDENCE = 0.1
"""Keypoints that a network itself believes less than this are not measurements."""
POINT_SIGMA_M = 0.03
"""Least standard deviation of a 3-D point from depth: how well `BEHIND_SURFACE_M` is known."""
EDGE_M = 0.10
"""Depths in a window that differ by more than this belong to different surfaces."""

BEHIND_SURFACE_M: dict[str, float] = {
    "head_center": 0.09, "skullbase": 0.06, "skull_tip": 0.05, "vc7": 0.06, "humanoid_root": 0.11,
    "shoulder": 0.06, "elbow": 0.04, "wrist": 0.03, "hand": 0.02, "hip": 0.09, "knee": 0.055, "ankle": 0.04,
    "toe": 0.03,
}  # fmt: skip
"""How far behind the visible surface a site lies along the ray [m]: half the depth of the limb there, for an adult
(means of ANSUR II: head breadth 0.15 and length 0.19, chest depth 0.25, knee breadth 0.11, wrist breadth 0.06...)."""
GUESSED = 0.4
"""Standard deviation of a site behind so many metres of the person's own body, beyond half a limb: the network guesses it."""


@dataclass(frozen=True, eq=False)
class SitePixel:
    """A site seen in an image: pixel (u, v), confidence in (0, 1], and distance of the feature from the site [m]."""

    site: str
    pixel: tuple[float, float]
    confidence: float
    spread: float


@dataclass(frozen=True)
class KeypointReport:
    """What became of the keypoints of one image: site names.

    Args:
        rays: given to the frame as rays.
        points: given as 3-D points.
        unseen: keypoints missing or below the least confidence.
        dropped: too far from where the site was predicted, or outside the lens model.
    """

    rays: tuple[str, ...] = ()
    points: tuple[str, ...] = ()
    unseen: tuple[str, ...] = ()
    dropped: tuple[str, ...] = ()


def layout_of(name: str) -> Layout:
    """The layout called `name`, see LAYOUTS.

    Raises:
        MeasurementError: unknown; lists the known ones.
    """
    if name not in LAYOUTS:
        raise MeasurementError(f"layout {name!r}: expected one of {', '.join(LAYOUTS)}")
    return LAYOUTS[name]


def site_pixels(
    keypoints: npt.ArrayLike, *, layout: str, min_confidence: float = MIN_CONFIDENCE
) -> tuple[list[SitePixel], list[str]]:
    """Sites seen by a network.

    Args:
        keypoints: (K, 3) rows (u, v, confidence), pixels; (0, 0, 0) or NaN = not seen.
        layout: name in LAYOUTS.
        min_confidence: a site of which any keypoint has less is unseen.

    Returns:
        The sites seen, and the names of those not seen. A site made of several keypoints has the least of their
        confidences.

    Raises:
        MeasurementError: unknown layout, wrong shape or no finite least confidence.
    """
    table = layout_of(layout)
    check_confidence(min_confidence)
    try:
        rows = np.asarray(keypoints, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise MeasurementError(f"keypoints: expected numbers (u, v, confidence), found {keypoints!r}") from error
    if rows.shape != (table.count, 3):
        raise MeasurementError(f"keypoints: expected shape ({table.count}, 3) for {layout}, found {rows.shape}")
    values: list[list[float]] = rows.tolist()
    seen, unseen = [], []
    for part in table.parts:
        u = v = total = 0.0
        confidence = 1.0
        for index, share in part.shares.items():
            column, row, believed = values[index]
            u, v, total = u + share * column, v + share * row, total + believed
            confidence = min(confidence, believed)
        # What is not finite anywhere is not in the sums.
        if not math.isfinite(u + v + total) or confidence < min_confidence or confidence <= 0.0:
            unseen.append(part.site)
        else:
            seen.append(SitePixel(part.site, (u, v), confidence, part.spread))
    return seen, unseen


@dataclass(frozen=True)
class KeypointSensor:
    """How the keypoints of one camera become measurements.

    Args:
        layout: name in LAYOUTS.
        camera: calibration; keypoints are in the pixels of the distorted image.
        world_from_sensor: (4, 4) pose of the camera's optical frame.
        noise: pixels to standard deviation; the layout's own spreads apply.
        model: standard deviation to weight.
        min_confidence: see site_pixels.
        source: name for `Estimate.sources`.
        sites: use only these; None means all the layout has.

    Raises:
        MeasurementError: an unknown layout or site, no calibration, no rigid pose, or no finite least confidence.
    """

    layout: str
    camera: Camera
    world_from_sensor: FloatArray
    noise: PixelNoise = field(default_factory=PixelNoise)
    model: SensorModel = field(default_factory=SensorModel)
    min_confidence: float = MIN_CONFIDENCE
    source: str = "keypoints"
    sites: tuple[str, ...] | None = None

    def __post_init__(self) -> None:
        """Check what does not depend on a picture."""
        known = [part.site for part in layout_of(self.layout).parts]
        unknown = sorted(set(self.sites or ()) - set(known))
        if unknown:
            raise MeasurementError(f"sites: expected some of {', '.join(known)}, found {', '.join(unknown)}")
        checked_camera(self.camera)
        rigid(self.world_from_sensor)
        check_confidence(self.min_confidence)

    def add(
        self,
        frame: Frame,
        keypoints: npt.ArrayLike,
        *,
        predicted: Mapping[str, npt.NDArray[np.float64]],
        gate: SiteGate | None = None,
        depth: DepthArray | None = None,
        metres_per_unit: float = 0.001,
    ) -> KeypointReport:
        """Add the keypoints of one person in one image to a frame; for several cameras see `observe`.

        Raises:
            MeasurementError: wrong shapes, or an unknown layout.
        """
        report, rays, points = self.observe(
            keypoints,
            stamp=frame.stamp,
            predicted=predicted,
            gate=gate,
            depth=depth,
            metres_per_unit=metres_per_unit,
        )
        add_rays(frame, rays, model=self.model)
        for site, (position, sigma) in points.items():
            frame.add_position(site, position, weight=self.model.weight(sigma), source=self.source)
        return report

    def observe(
        self,
        keypoints: npt.ArrayLike,
        *,
        stamp: float,
        predicted: Mapping[str, npt.NDArray[np.float64]],
        gate: SiteGate | None = None,
        depth: DepthArray | None = None,
        metres_per_unit: float = 0.001,
        before: Mapping[str, float] | None = None,
    ) -> tuple[KeypointReport, list[SiteRay], dict[str, tuple[FloatArray, float]]]:
        """What the keypoints of one person say: rays, and with depth points.

        Without depth each site becomes a ray. With a registered depth image (same camera, same size) it becomes a 3-D
        point: the median depth of the nearest surface in a 5 x 5 window, moved behind the surface by BEHIND_SURFACE_M;
        where the image has no return, or the point is refused by the gate (the site is hidden), it stays a ray.

        Args:
            keypoints: (K, 3), see site_pixels.
            stamp: [s], for the gate.
            predicted: site name -> (3,) in the world, e.g. `tracker.estimate.joints`; sites not in it are not used.
            gate: drops what is too far from the prediction; None takes everything.
            depth: (H, W) uint16 or float32.
            metres_per_unit: of `depth`.
            before: site name -> how much of the person's body lies between it and the camera [m], see
                `voodoo.sensors.occlusion`; None: not known. Networks are as sure of what they guess as of what they see.

        Returns:
            The report, the rays, and site name -> (position (3,) in the world, standard deviation) [m].

        Raises:
            MeasurementError: wrong shapes, or an unknown layout.
        """
        pose = rigid(self.world_from_sensor)
        if depth is not None and depth.shape != (self.camera.height, self.camera.width):
            expected = (self.camera.height, self.camera.width)
            raise MeasurementError(f"depth: expected the camera's shape {expected}, found {depth.shape}")
        seen, unseen = site_pixels(keypoints, layout=self.layout, min_confidence=self.min_confidence)
        seen = [item for item in seen if item.site in predicted and (self.sites is None or item.site in self.sites)]
        rays: list[SiteRay] = []
        points: dict[str, tuple[FloatArray, float]] = {}
        dropped: list[str] = []
        if not seen:
            return KeypointReport(unseen=tuple(unseen)), rays, points
        origin, directions = world_rays(self.camera, pose, [item.pixel for item in seen])
        sites = np.array([predicted[item.site] for item in seen], dtype=np.float64)
        depths = in_sensor(pose, sites)[:, 2]
        usable = np.isfinite(directions).all(axis=1) & (depths > 0.0)
        off = ray_distance(origin, directions, sites)
        for item, direction, site, z, away, able in zip(
            seen, directions, sites, depths.tolist(), off.tolist(), usable.tolist(), strict=True
        ):
            if not able:
                dropped.append(item.site)
                continue
            sigma = self._sigma(item, z)
            if depth is not None:
                point = self._point(item, direction, pose, depth, metres_per_unit)
                if point is not None and (gate is None or gate.accepts_point(item.site, site, point, stamp)):
                    points[item.site] = (point, max(sigma, POINT_SIGMA_M))
                    continue
            if gate is None or gate.accepts(item.site, away, stamp, self.source):
                hidden = (before or {}).get(item.site, 0.0) - _behind_surface(item.site)
                sigma = math.hypot(sigma, GUESSED * max(hidden, 0.0))
                rays.append(SiteRay(item.site, origin, direction, sigma, self.source))
            else:
                dropped.append(item.site)
        report = KeypointReport(tuple(ray.site for ray in rays), tuple(points), tuple(unseen), tuple(dropped))
        return report, rays, points

    def _sigma(self, item: SitePixel, z: float) -> float:
        focal = math.sqrt(self.camera.fx * self.camera.fy)
        return self.noise.sigma(z, focal, confidence=item.confidence, spread=item.spread)

    def _point(
        self, item: SitePixel, direction: FloatArray, pose: FloatArray, depth: DepthArray, metres_per_unit: float
    ) -> FloatArray | None:
        z = window_depth(depth, item.pixel, metres_per_unit=metres_per_unit)
        if z is None:
            return None
        cosine = float(direction @ pose[:3, 2])
        return np.asarray(pose[:3, 3] + direction * (z / cosine + _behind_surface(item.site)))


def check_confidence(least: object) -> None:
    """Refuse a least confidence that is no finite number.

    Raises:
        MeasurementError: it is none.
    """
    # Nothing is less than NaN: with it every keypoint would be believed.
    if not isinstance(least, (int, float, np.floating)) or not math.isfinite(least):
        raise MeasurementError(f"min_confidence: expected a finite number, found {least!r}")


def _behind_surface(site: str) -> float:
    return BEHIND_SURFACE_M[site.removeprefix("l_").removeprefix("r_")]


def window_depth(
    depth: DepthArray, pixel: tuple[float, float], *, metres_per_unit: float = 0.001, radius: int = 2
) -> float | None:
    """Depth [m] of the nearest surface around a pixel, None where fewer than a quarter of the window's pixels returned.

    The nearest surface is what lies within EDGE_M behind the window's 20 % quantile; its median is robust against
    flying pixels on either side.
    """
    u, v = round(pixel[0]), round(pixel[1])
    height, width = depth.shape
    if not (0 <= u < width and 0 <= v < height):
        return None
    window = depth[max(v - radius, 0) : v + radius + 1, max(u - radius, 0) : u + radius + 1]
    values = window.astype(np.float64).ravel() * metres_per_unit
    values = values[np.isfinite(values) & (values > 0.0)]
    if len(values) < max(window.size // 4, 1):
        return None
    near = float(np.quantile(values, 0.2, method="lower"))
    surface = values[np.abs(values - near) <= EDGE_M]
    return float(np.median(surface))


def read_openpose_json(path: str | Path, *, layout: str) -> list[FloatArray]:
    """People in an OpenPose JSON file (one image): one (K, 3) array of (u, v, confidence) each; empty without any.

    Raises:
        RecordingError: not readable, not of that form, or another number of keypoints than the layout's.
    """
    count = layout_of(layout).count
    path = Path(path)
    with reading(path, "an OpenPose JSON file"):
        content = json.loads(path.read_text(encoding="utf-8"))
    people = content.get("people") if isinstance(content, dict) else None
    if not isinstance(people, list):
        raise RecordingError(f"{path}: expected an object with a list of people, found {content!r:.80}")
    found = []
    for index, person in enumerate(people):
        if person == {}:  # Pose2Sim writes this where it found nobody
            continue
        flat = person.get("pose_keypoints_2d") if isinstance(person, dict) else None
        if not isinstance(flat, list) or not all(isinstance(value, (int, float)) for value in flat):
            raise RecordingError(f"{path}, person {index}: expected a list of numbers pose_keypoints_2d")
        if len(flat) != 3 * count:
            raise RecordingError(
                f"{path}, person {index}: expected {count} keypoints for {layout}, found {len(flat) / 3:g}"
            )
        rows = np.array(flat, dtype=np.float64).reshape(count, 3)
        if not np.isfinite(rows).all():
            raise RecordingError(f"{path}, person {index}: expected finite keypoints, found others")
        found.append(rows)
    return found


def nearest_person(
    people: Sequence[npt.NDArray[np.float64]],
    *,
    layout: str,
    camera: Camera,
    world_from_sensor: npt.ArrayLike,
    predicted: Mapping[str, npt.NDArray[np.float64]],
) -> npt.NDArray[np.float64] | None:
    """The person (K, 3) whose keypoints lie nearest to the predicted sites in the image, by the median distance; None
    if none.

    Raises:
        MeasurementError: wrong shapes, or an unknown layout.
    """
    pose = rigid(world_from_sensor)
    best, least = None, math.inf
    for person in people:
        seen, _ = site_pixels(person, layout=layout)
        seen = [item for item in seen if item.site in predicted]
        if not seen:
            continue
        pixels = camera.project(in_sensor(pose, [predicted[item.site] for item in seen]))
        distance = np.hypot(*(pixels - [item.pixel for item in seen]).T)
        distances = distance[np.isfinite(distance)].tolist()
        if distances and (middle := median(distances)) < least:
            best, least = person, middle
    return best
