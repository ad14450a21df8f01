"""2-D keypoints of any network as measurements: one table of layouts, rays, and robust 3-D points from registered
depth."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from voodoo._core import Frame
from voodoo.errors import MeasurementError
from voodoo.measurements import DepthArray, FloatArray
from voodoo.model.camera import Camera
from voodoo.model.transforms import rigid
from voodoo.recordings.keypoint_layouts import layout_of
from voodoo.sensors.gating import SiteGate
from voodoo.sensors.keypoints.sites import MIN_CONFIDENCE, check_confidence, checked_rows, compiled, window_depth
from voodoo.sensors.model import PixelNoise, SensorModel
from voodoo.sensors.pixels import checked_camera
from voodoo.sensors.rays import SiteRay, add_rays

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
        meters_per_unit: float = 0.001,
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
            meters_per_unit=meters_per_unit,
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
        if depth is not None and depth.shape != (self.camera.height, self.camera.width):
            expected = (self.camera.height, self.camera.width)
            raise MeasurementError(f"depth: expected the camera's shape {expected}, found {depth.shape}")
        camera = self.camera
        found, places, unseen, dropped = compiled(self.layout).observe(
            checked_rows(keypoints, self.layout),
            predicted,
            stamp=stamp,
            source=self.source,
            world_from_sensor=pose,
            camera=camera,
            noise=self.noise.pixels,
            place_sigma=POINT_SIGMA_M,
            least=self.min_confidence,
            only=self.sites,
            gate=None if gate is None else gate.core,
            surface=None
            if depth is None
            else lambda pixel: window_depth(depth, pixel, meters_per_unit=meters_per_unit),
            before=before,
        )
        points = {site: (place, sigma) for site, place, sigma in places}
        report = KeypointReport(tuple(ray.site for ray in found), tuple(points), tuple(unseen), tuple(dropped))
        return report, found, points
