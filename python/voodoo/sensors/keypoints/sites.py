"""2-D keypoints of any network as measurements: pixels of body sites, the persons to whom they belong (networks report several
people in arbitrary order), rays, and robust 3-D points from registered depth."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

import voodoo._core as _core
from voodoo._core import Frame
from voodoo.errors import MeasurementError, of_kind
from voodoo.measurements import DepthArray, FloatArray, KeypointImage
from voodoo.model.camera import Camera
from voodoo.model.joint import numbers_of
from voodoo.model.transforms import rigid
from voodoo.recordings.keypoint_layouts import layout_of
from voodoo.sensors.gating import SiteGate
from voodoo.sensors.model import PixelNoise, SensorModel
from voodoo.sensors.pixels import ray_distance, world_rays
from voodoo.sensors.rays import SiteRay, add_rays

EDGE_M = 0.10
"""Depths in a window that differ by more than this belong to different surfaces."""
WINDOW_PX = 5
"""Side of the window around a keypoint in which the nearest surface is searched for."""


BEHIND_SURFACE_M: dict[str, float] = {
    "head_center": 0.09, "skullbase": 0.06, "skull_tip": 0.05, "vc7": 0.06, "humanoid_root": 0.11,
    "shoulder": 0.06, "elbow": 0.04, "wrist": 0.03, "hand": 0.02, "hip": 0.09, "knee": 0.055, "ankle": 0.04,
    "toe": 0.03,
}  # fmt: skip
"""How far behind the visible surface a site lies along the ray [m]: half the depth of the limb there, for an adult
(means of ANSUR II: head breadth 0.15 and length 0.19, chest depth 0.25, knee breadth 0.11, wrist breadth 0.06...)."""


def behind_surface(site: str) -> float:
    """How far behind the visible surface a site lies [m], of either side."""
    return BEHIND_SURFACE_M[site.removeprefix("l_").removeprefix("r_")]


def window_depth(depth: DepthArray, pixel: tuple[float, float], *, meters_per_unit: float = 0.001) -> float | None:
    """Depth [m] of the nearest surface around a pixel, None where fewer than a quarter of the window's pixels returned.

    The nearest surface is what lies within EDGE_M behind the window's 20 % quantile; its median is robust against
    flying pixels on either side.
    """
    u, v = round(pixel[0]), round(pixel[1])
    height, width = depth.shape
    if not (0 <= u < width and 0 <= v < height):
        return None
    radius = WINDOW_PX // 2
    window = depth[max(v - radius, 0) : v + radius + 1, max(u - radius, 0) : u + radius + 1]
    values = window.astype(np.float64).ravel() * meters_per_unit
    values = values[np.isfinite(values) & (values > 0.0)]
    if len(values) < max(window.size // 4, 1):
        return None
    near = float(np.quantile(values, 0.2, method="lower"))
    surface = values[np.abs(values - near) <= EDGE_M]
    return float(np.median(surface))


MIN_CONFIDENCE = 0.1
"""Keypoints with a lower confidence are not used."""


@dataclass(frozen=True, eq=False)
class SitePixel:
    """A site detected in an image: pixel (u, v), confidence in (0, 1], and spread of the feature around the site [m]."""

    site: str
    pixel: tuple[float, float]
    confidence: float
    spread: float


def site_pixels(
    keypoints: npt.ArrayLike, *, layout: str, min_confidence: float = MIN_CONFIDENCE
) -> tuple[list[SitePixel], list[str]]:
    """Returns the sites that a network detected.

    Args:
        keypoints: (K, 3) rows (u, v, confidence), pixels; (0, 0, 0) or NaN = not detected.
        layout: name in LAYOUTS.
        min_confidence: a site with any keypoint below this confidence is not detected.

    Returns:
        The detected sites, and the names of the others. The confidence of a site defined by several keypoints is the least
        of theirs.

    Raises:
        MeasurementError: unknown layout, wrong shape or no finite least confidence.
    """
    check_confidence(min_confidence)
    parts = layout_of(layout).parts
    found = compiled(layout).pixels(checked_rows(keypoints, layout), min_confidence)
    observed = [SitePixel(part.site, *of, part.spread) for part, of in zip(parts, found, strict=True) if of is not None]
    return observed, [part.site for part, of in zip(parts, found, strict=True) if of is None]


def checked_rows(keypoints: npt.ArrayLike, layout: str) -> FloatArray:
    """Keypoints (K, 3) of a layout, contiguous.

    Raises:
        MeasurementError: unknown layout, or another shape.
    """
    count = layout_of(layout).count
    numbers = numbers_of("keypoints", keypoints, MeasurementError, "numbers (u, v, confidence)")
    rows = np.ascontiguousarray(numbers)
    if rows.shape != (count, 3):
        raise MeasurementError(f"keypoints: expected shape ({count}, 3) for {layout}, found {rows.shape}")
    return rows


@lru_cache(maxsize=32)
def compiled(layout: str) -> _core.KeypointLayout:
    """The core's object for a layout."""
    parts = layout_of(layout).parts
    return _core.KeypointLayout([(p.site, list(p.weights.items()), p.spread, behind_surface(p.site)) for p in parts])


def check_confidence(least: object) -> None:
    """Check that a least confidence is a finite number.

    Raises:
        MeasurementError: it is not.
    """
    # No comparison with NaN is true: every keypoint would pass.
    if not isinstance(least, (int, float, np.floating)) or not math.isfinite(least):
        raise MeasurementError(f"min_confidence: expected a finite number, found {least!r}")


def nearest_person(
    item: KeypointImage, *, predicted: Mapping[str, FloatArray], min_confidence: float = MIN_CONFIDENCE
) -> FloatArray | None:
    """The person (K, 3) whose keypoints lie nearest to the predicted sites in the image, by the median distance; None
    if none. For the least confidence see `site_pixels`.

    Raises:
        MeasurementError: wrong shapes, or an unknown layout.
    """
    nearest = compiled(item.layout).nearest(
        [checked_rows(person, item.layout) for person in item.people],
        predicted,
        world_from_sensor=rigid(item.root_from_sensor),
        camera=item.camera,
        least=min_confidence,
    )
    return None if nearest is None else item.people[nearest]


WRONG_M = 0.3
"""Greatest median distance of the rays of keypoints from a person that they belong to."""
_FEWEST = 4


def assign_keypoints(
    item: KeypointImage,
    predicted: Mapping[int, Mapping[str, FloatArray]],
    *,
    min_confidence: float = MIN_CONFIDENCE,
) -> tuple[dict[int, KeypointImage], KeypointImage]:
    """Assign the keypoints of an image to persons jointly, by the distances of their rays from the predicted sites.

    Args:
        item: the image.
        predicted: id of a person -> site -> predicted position (3,) [m], root frame.
        min_confidence: see `site_pixels`.

    Returns:
        Id of a person -> the image with only that person's keypoints, and the image with those of no person.
    """
    numbers = list(predicted)
    costs = np.array(
        [[_away(item, rows, predicted[number], min_confidence) for rows in item.people] for number in numbers]
    )
    of: dict[int, KeypointImage] = {}
    taken: set[int] = set()
    if costs.size:
        # A forbidden pair gets a cost above all possible ones.
        for row, column in _core.linear_sum_assignment(np.where(costs < WRONG_M, costs, 1e3)):
            if costs[row, column] < WRONG_M:
                of[numbers[row]] = replace(item, people=(item.people[column],))
                taken.add(column)
    rest = tuple(rows for index, rows in enumerate(item.people) if index not in taken)
    return of, replace(item, people=rest)


def _away(item: KeypointImage, rows: FloatArray, predicted: Mapping[str, FloatArray], min_confidence: float) -> float:
    """Median distance [m] of the rays of keypoints from the predicted sites; infinite with too few keypoints."""
    found, _ = site_pixels(rows, layout=item.layout, min_confidence=min_confidence)
    observed = [site for site in found if site.site in predicted]
    if len(observed) < _FEWEST:
        return float("inf")
    origin, directions = world_rays(item.camera, item.root_from_sensor, [site.pixel for site in observed])
    places = np.array([predicted[site.site] for site in observed])
    away = ray_distance(origin, directions, places)
    away = away[np.isfinite(away)]
    return float(np.median(away)) if len(away) >= _FEWEST else float("inf")


POINT_SIGMA_M = 0.03
"""Least standard deviation of a 3-D point from depth: the uncertainty of `BEHIND_SURFACE_M`."""


@dataclass(frozen=True)
class KeypointReport:
    """How the keypoints of one image were used; each field lists site names.

    Args:
        rays: added to the frame as rays.
        points: added as 3-D points.
        unseen: keypoints missing or below the least confidence.
        dropped: too far from where the site was predicted, or outside the lens model.
    """

    rays: tuple[str, ...] = ()
    points: tuple[str, ...] = ()
    unseen: tuple[str, ...] = ()
    dropped: tuple[str, ...] = ()


@dataclass(frozen=True)
class KeypointSensor:
    """How the keypoints of one camera become measurements.

    Args:
        layout: name in LAYOUTS.
        camera: calibration; keypoints are in the pixels of the distorted image.
        world_from_sensor: (4, 4) pose of the camera's optical frame.
        noise: converts pixels to standard deviations; the spreads of the layout are added.
        model: converts standard deviations to weights.
        min_confidence: see site_pixels.
        source: name for `Estimate.sources`.
        sites: use only these; None means all sites of the layout.

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
        """Check the settings."""
        parts = layout_of(self.layout).parts
        if self.sites and (unknown := sorted(set(self.sites) - {part.site for part in parts})):
            known = [part.site for part in parts]
            raise MeasurementError(f"sites: expected some of {', '.join(known)}, found {', '.join(unknown)}")
        of_kind("camera", self.camera, Camera, MeasurementError)
        rigid(self.world_from_sensor)
        check_confidence(self.min_confidence)

    def add(
        self,
        frame: Frame,
        keypoints: npt.ArrayLike,
        *,
        predicted: Mapping[str, FloatArray],
        gate: SiteGate | None = None,
        depth: DepthArray | None = None,
        meters_per_unit: float = 0.001,
    ) -> KeypointReport:
        """Add the keypoints of one person in one image to a frame; for several cameras see `observe`.

        Raises:
            MeasurementError: wrong shapes, or an unknown layout.
        """
        how: dict[str, Any] = {"gate": gate, "depth": depth, "meters_per_unit": meters_per_unit}
        report, rays, points = self.observe(keypoints, stamp=frame.stamp, predicted=predicted, **how)
        add_rays(frame, rays, model=self.model)
        for site, (position, sigma) in points.items():
            frame.add_position(site, position, weight=self.model.weight(sigma), source=self.source)
        return report

    def observe(
        self,
        keypoints: npt.ArrayLike,
        *,
        stamp: float,
        predicted: Mapping[str, FloatArray],
        gate: SiteGate | None = None,
        depth: DepthArray | None = None,
        meters_per_unit: float = 0.001,
        before: Mapping[str, float] | None = None,
    ) -> tuple[KeypointReport, list[SiteRay], dict[str, tuple[FloatArray, float]]]:
        """Converts the keypoints of one person into rays and, with depth, 3-D points.

        Without depth each site becomes a ray. With a registered depth image (same camera, same size) it becomes a 3-D
        point: the median depth of the nearest surface in a 5 x 5 window, moved behind the surface by BEHIND_SURFACE_M;
        where the image has no return, or the gate rejects the point (the site is occluded), it stays a ray.

        Args:
            keypoints: (K, 3), see site_pixels.
            stamp: [s], for the gate.
            predicted: site name -> (3,) in the world, e.g. `tracker.estimate.joints`; sites not in it are not used.
            gate: rejects measurements too far from the prediction; None accepts all.
            depth: (H, W) uint16 or float32.
            meters_per_unit: of `depth`.
            before: site name -> length of the person's own body between it and the camera [m], see `Tracker.body_before`;
                None: not known. It raises the standard deviation, because networks report guessed sites with high confidence.

        Returns:
            The report, the rays, and site name -> (position (3,) in the world, standard deviation) [m].

        Raises:
            MeasurementError: wrong shapes, or an unknown layout.
        """
        pose = rigid(self.world_from_sensor)
        shape = (self.camera.height, self.camera.width)
        if depth is not None and depth.shape != shape:
            raise MeasurementError(f"depth: expected the camera's shape {shape}, found {depth.shape}")
        used = predicted if self.sites is None else {site: predicted[site] for site in self.sites if site in predicted}
        found, places, unseen, dropped = compiled(self.layout).observe(
            checked_rows(keypoints, self.layout),
            used,
            stamp=stamp,
            source=self.source,
            world_from_sensor=pose,
            camera=self.camera,
            noise=self.noise.pixels,
            place_sigma=POINT_SIGMA_M,
            least=self.min_confidence,
            gate=gate,
            surface=None
            if depth is None
            else lambda pixel: window_depth(depth, pixel, meters_per_unit=meters_per_unit),
            before=before,
        )
        points = {site: (place, sigma) for site, place, sigma in places}
        report = KeypointReport(tuple(ray.site for ray in found), tuple(points), tuple(unseen), tuple(dropped))
        return report, found, points
