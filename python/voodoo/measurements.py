"""Measurements of the sensors of a recording, each with its own stamp and sensor pose in the root frame."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, ClassVar, Protocol, TypeAlias

import numpy as np
import numpy.typing as npt

from voodoo.model.camera import Camera
from voodoo.model.joint import FloatArray as FloatArray

ByteImage: TypeAlias = npt.NDArray[np.uint8]
DepthArray: TypeAlias = npt.NDArray[np.uint16] | npt.NDArray[np.float32]
ASSUMED_RATE_HZ = 30.0
"""Frames per second where none is known, the default of most depth cameras."""
ROUNDED_S = 1e-6
"""Times that differ by less are the same, one of them rounded or computed."""
MARKER_SIGMA_M = 0.02
"""Standard deviation of a marker of which it is not known [m]."""
_LARGEST = float(np.finfo(np.float64).max)


@dataclass(frozen=True, eq=False, repr=False)
class DepthImage:
    """A depth image; depth is measured along the optical axis (z), not along the ray.

    Args:
        sensor: topic or folder it came from.
        stamp: time of measurement [s].
        image: (H, W) uint16 or float32; 0, NaN and infinity mean "no return".
        meters_per_unit: meters of one unit of `image`.
        camera: calibration; its size is the image's.
        root_from_sensor: (4, 4) rigid transform from the optical frame to the recording's root frame.
    """

    sensor: str
    stamp: float
    image: DepthArray
    meters_per_unit: float
    camera: Camera
    root_from_sensor: FloatArray

    def meters(self) -> FloatArray:
        """Depths (H, W) [m]; NaN where there is no return."""
        z = self.image.astype(np.float64) * self.meters_per_unit
        return np.asarray(np.where(np.isfinite(z) & (z > 0.0), z, np.nan))

    def __repr__(self) -> str:
        """One line with size and type instead of the pixels."""
        height, width = self.image.shape
        return f"DepthImage({self.sensor!r}, stamp={self.stamp:.6f}, {width}x{height} {self.image.dtype})"


@dataclass(frozen=True, eq=False, repr=False)
class PointCloud:
    """Points (N, 3) [m] in the sensor's frame, rows with NaN or infinity already dropped."""

    sensor: str
    stamp: float
    points: FloatArray
    root_from_sensor: FloatArray

    def __repr__(self) -> str:
        """One line with the number of points."""
        return f"PointCloud({self.sensor!r}, stamp={self.stamp:.6f}, {len(self.points)} points)"


@dataclass(frozen=True, eq=False, repr=False)
class LaserScan:
    """One sweep of a planar laser: ranges in the sensor's x-y plane.

    Args:
        sensor: topic it came from.
        stamp: time of the first ray [s].
        ranges: (N,) float32 [m], as recorded.
        angle_min: angle of the first ray from x towards y [rad].
        angle_increment: angle between rays [rad].
        range_min, range_max: returns outside are not valid [m].
        root_from_sensor: (4, 4) from the laser's frame to the recording's root frame.
    """

    sensor: str
    stamp: float
    ranges: npt.NDArray[np.float32]
    angle_min: float
    angle_increment: float
    range_min: float
    range_max: float
    root_from_sensor: FloatArray

    def points(self) -> FloatArray:
        """Valid returns as (N, 3) points [m] in the laser's frame (z = 0), in the order of the rays."""
        ranges = self.ranges.astype(np.float64)
        # Values that are not finite fail a comparison or exceed every range. Some drivers write 0 where nothing returned, and as
        # range_min.
        valid = (ranges > 0.0) & (ranges >= self.range_min) & (ranges <= min(self.range_max, _LARGEST))
        return ranges[valid, None] * _beams(self.angle_min, self.angle_increment, len(ranges))[valid]

    def __repr__(self) -> str:
        """One line with the number of rays."""
        return f"LaserScan({self.sensor!r}, stamp={self.stamp:.6f}, {len(self.ranges)} rays)"


@lru_cache(maxsize=8)
def _beams(angle_min: float, angle_increment: float, count: int) -> FloatArray:
    """Unit vectors (N, 3) of a planar laser's rays."""
    angles = angle_min + angle_increment * np.arange(count)
    return np.column_stack([np.cos(angles), np.sin(angles), np.zeros(count)])


@dataclass(frozen=True, eq=False, repr=False)
class ColorImage:
    """A color image, decoded at the first access to `image`.

    Args:
        sensor: topic or folder it came from.
        stamp: time of measurement [s].
        decode: returns the (H, W, 3) BGR uint8 image; called at most once.
        camera: calibration.
        root_from_sensor: (4, 4) from the optical frame to the recording's root frame.
    """

    sensor: str
    stamp: float
    decode: Callable[[], ByteImage]
    camera: Camera
    root_from_sensor: FloatArray

    @cached_property
    def image(self) -> ByteImage:
        """The image, (H, W, 3) BGR uint8.

        Raises:
            RecordingError: the stored image is damaged or its size differs from the camera's.
        """
        return self.decode()

    def __repr__(self) -> str:
        """One line with the size."""
        return f"ColorImage({self.sensor!r}, stamp={self.stamp:.6f}, {self.camera.width}x{self.camera.height})"


@dataclass(frozen=True, eq=False, repr=False)
class KeypointImage:
    """Detections of a 2-D keypoint network in one image.

    Args:
        sensor: name of the camera.
        stamp: time of measurement [s].
        people: one (K, 3) array of (u, v, confidence) for each detected person, in pixels of the distorted image.
        layout: name of the keypoint layout in voodoo.sensors.keypoints.LAYOUTS.
        camera: calibration.
        root_from_sensor: (4, 4) from the optical frame to the recording's root frame.
    """

    sensor: str
    stamp: float
    people: tuple[FloatArray, ...]
    layout: str
    camera: Camera
    root_from_sensor: FloatArray

    @classmethod
    def of(cls, item: ColorImage | DepthImage, people: tuple[FloatArray, ...], layout: str) -> KeypointImage:
        """The people in an image, as of the sensor "NAME/keypoints"."""
        return cls(f"{item.sensor}/keypoints", item.stamp, people, layout, item.camera, item.root_from_sensor)

    def __repr__(self) -> str:
        """One line with the number of people."""
        return f"KeypointImage({self.sensor!r}, stamp={self.stamp:.6f}, {len(self.people)} people, {self.layout})"


@dataclass(frozen=True, eq=False, repr=False)
class MarkerSet:
    """Positions of named sites from markers or magnetic trackers.

    Args:
        sensor: name of the system or file.
        stamp: time of measurement [s].
        positions: site name -> (3,) [m] in the recording's root frame; missing ones are left out.
        sigma: standard deviation of each [m]; None: not known.
    """

    sensor: str
    stamp: float
    positions: Mapping[str, FloatArray]
    sigma: float | None = None

    def __repr__(self) -> str:
        """One line with the number of sites."""
        return f"MarkerSet({self.sensor!r}, stamp={self.stamp:.6f}, {len(self.positions)} sites)"


def usual_interval(stamps: FloatArray) -> float:
    """Median time between frames [s]; 1 / ASSUMED_RATE_HZ for a single one."""
    return float(np.median(np.diff(stamps))) if len(stamps) > 1 else 1.0 / ASSUMED_RATE_HZ


def nearest_stamps(stamps: FloatArray, times: npt.ArrayLike, *, within: float) -> npt.NDArray[np.intp]:
    """Index (M,) of the stamp (of N, in any order) that is nearest to each time (M,), the first one of several; -1 if it is
    farther than `within` [s]."""
    times = np.asarray(times, dtype=np.float64)
    if not len(stamps):
        return np.full(len(times), -1, dtype=np.intp)
    order = np.argsort(stamps, kind="stable")
    rising = stamps[order]
    after = np.searchsorted(rising, times).clip(max=len(rising) - 1)
    before = np.maximum(after - 1, 0)
    near = np.where(np.abs(times - rising[before]) <= np.abs(rising[after] - times), before, after)
    # Of equal stamps the first one.
    near = np.searchsorted(rising, rising[near])
    return np.where(np.abs(rising[near] - times) <= within, order[near], -1)


class Measurement(Protocol):
    """Attributes of every measurement. The classes above and those of other adapters are frozen dataclasses with them."""

    __dataclass_fields__: ClassVar[dict[str, Any]]

    @property
    def sensor(self) -> str:
        """Topic, file or folder it came from."""

    @property
    def stamp(self) -> float:
        """Time of measurement [s]."""


@dataclass(frozen=True, eq=False)
class RecordedFrame:
    """One step of a recording: the measurement that defines the frame, and the others since the previous frame.

    Args:
        stamp: [s], that of the measurement that defines the frame.
        measurements: in the order of arrival; the defining one is last.
    """

    stamp: float
    measurements: tuple[Measurement, ...]
