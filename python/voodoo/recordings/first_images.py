"""The first frames of a recording: their images as they are in the file, and what reveals a wrong unit or calibration before
it causes a lost or wrong body."""

from __future__ import annotations

import math
from contextlib import nullcontext
from dataclasses import dataclass
from itertools import islice

import numpy as np

from voodoo.errors import VoodooError
from voodoo.measurements import ColorImage, DepthImage, FloatArray
from voodoo.recordings.left_out import LeftOut
from voodoo.recordings.recording import Recording, RecordingInfo
from voodoo.recordings.time_units import interval_words
from voodoo.recordings.truth import STILL_FRAMES

_FRAMES = 10
"""Frames in which the first images are looked for."""
_LEAST_DEG, _MOST_DEG = 30.0, 150.0
"""Fields of view that depth cameras have."""
_SQUARE = 0.1
"""Focal lengths of a depth camera that differ by a larger fraction are not of one image: its pixels are square."""
_NEAR_M, _FAR_M = 1.2, 8.0
"""Plausible depths of a camera that observes a person: some are beyond the first limit, and the median is below the second."""
FIXED_FRAMES = (*STILL_FRAMES, "world")
"""Root frames that stay where they are while a robot drives."""


@dataclass(frozen=True)
class DepthRange:
    """Depths [m] of an image: the nearest 5 %, the middle, the farthest 5 %."""

    near: float
    middle: float
    far: float

    def __str__(self) -> str:
        """Readable line."""
        return f"{self.near:.2f} to {self.far:.2f} m (90 % of the first image, half of it before {self.middle:.2f} m)"

    @property
    def warning(self) -> str:
        """Description of the problem if depths are too small or too large for a person; "" otherwise."""
        if self.near < self.far < _NEAR_M or self.middle > _FAR_M:
            return (
                f"depths of {self.near:.2f} to {self.far:.2f} m leave no room for a person: is the unit right? "
                "(depth_factor of calibration.toml: 1000 for millimeters; --option meters_per_unit=0.001 of a bag)"
            )
        return ""


@dataclass(frozen=True)
class FirstImage:
    """A decoded image.

    Args:
        sensor: its name.
        size: width and height of the image [px].
        calibrated: width and height of the calibration [px].
        bits: of a value, e.g. "16-bit unsigned".
        meters_per_unit: scale of depth; None for color.
        field_of_view: horizontal and vertical [deg], by the calibration.
        focal_lengths: horizontal and vertical [px].
        depths: their range; None for color, and where nothing returned.
    """

    sensor: str
    size: tuple[int, int]
    calibrated: tuple[int, int]
    bits: str
    meters_per_unit: float | None
    field_of_view: tuple[float, float]
    focal_lengths: tuple[float, float]
    depths: DepthRange | None = None

    def __str__(self) -> str:
        """One line."""
        scale = "" if self.meters_per_unit is None else f", a unit is {self.meters_per_unit:g} m"
        (width, height), (wide, high), (across, up) = self.size, self.calibrated, self.field_of_view
        return (
            f"{self.sensor}: {width}x{height}, {self.bits}{scale}; calibrated for {wide}x{high}, "
            f"field of view {across:.0f} x {up:.0f} deg"
        )


@dataclass(frozen=True)
class FirstFrames:
    """What the first frames of a recording are like.

    Args:
        images: the first one of every camera.
        interval: usual time between frames [s]; NaN with less than two.
        damage: why reading ended early; "" if it did not.
    """

    images: tuple[FirstImage, ...] = ()
    interval: float = math.nan
    damage: str = ""

    @property
    def depths(self) -> DepthRange | None:
        """The range of the first image with depths."""
        return next((image.depths for image in self.images if image.depths is not None), None)


def first_frames(recording: Recording, *, left_out: LeftOut | None = None) -> FirstFrames:
    """Read the first frames of a recording.

    Args:
        recording: is read from its start.
        left_out: that of the recording, which does not count what is read here; None: it counts.
    """
    images: dict[str, FirstImage] = {}
    stamps, damage = [], ""
    with nullcontext() if left_out is None else left_out.aside():
        try:
            for recorded in islice(recording, _FRAMES):
                stamps.append(recorded.stamp)
                for item in recorded.measurements:
                    if isinstance(item, DepthImage | ColorImage) and item.sensor not in images:
                        images[item.sensor] = _of(item)
        except VoodooError as error:
            damage = str(error)
    interval = float(np.median(np.diff(stamps))) if len(stamps) > 1 else math.nan
    return FirstFrames(tuple(images.values()), interval, damage)


def _of(item: DepthImage | ColorImage) -> FirstImage:
    image, camera = item.image, item.camera
    across, down = camera.rays()[camera.height // 2, :, 0], camera.rays()[:, camera.width // 2, 1]
    angles = (float(np.rad2deg(np.ptp(np.arctan(line[np.isfinite(line)])))) for line in (across, down))
    kind = {"u": "unsigned", "f": "float"}.get(image.dtype.kind, image.dtype.name)
    return FirstImage(
        sensor=item.sensor,
        size=(image.shape[1], image.shape[0]),
        calibrated=(camera.width, camera.height),
        bits=f"{8 * image.dtype.itemsize}-bit {kind}",
        meters_per_unit=item.meters_per_unit if isinstance(item, DepthImage) else None,
        field_of_view=(next(angles), next(angles)),
        focal_lengths=(camera.fx, camera.fy),
        depths=_range_of(item.meters()) if isinstance(item, DepthImage) else None,
    )


def _range_of(meters: FloatArray) -> DepthRange | None:
    known = meters[np.isfinite(meters)]
    return DepthRange(*np.percentile(known, (5.0, 50.0, 95.0)).tolist()) if known.size else None


def _lens_words(image: FirstImage) -> str:
    """What is unlikely in the calibration of a depth camera; "" if nothing."""
    (across, down), (fx, fy) = image.field_of_view, image.focal_lengths
    if not _LEAST_DEG < across < _MOST_DEG:
        what = f"sees {across:.0f} x {down:.0f} deg by its calibration, and depth cameras 40 to 120"
    elif abs(fx - fy) > _SQUARE * max(fx, fy):
        what = f"has focal lengths of {fx:.0f} and {fy:.0f} px by its calibration, and those of depth cameras are nearly equal"
    else:
        return ""
    return f"{image.sensor} {what}: are its focal lengths right?"


def doubts(first: FirstFrames) -> list[str]:
    """What is unlikely in times and calibration: it gives wrong speeds, or a wrong person."""
    found = [interval_words(first.interval)]
    found += [_lens_words(image) for image in first.images if image.meters_per_unit is not None]
    return [words for words in found if words]


def warnings(about: RecordingInfo, left_out: LeftOut) -> list[str]:
    """What is not right with a recording, after its first frames were read."""
    found = [f"left out {count} {reason}: {left_out.first[reason]}" for reason, count in left_out.counts.items()]
    found += left_out.notes
    if about.duration < 0.0:
        found.append(
            f"its time goes backwards: the last frame is {-about.duration:.3f} s before the first; voodoo track "
            "moves stamps on where a clock was set back"
        )
    lasers = [sensor.name for sensor in about.sensors if sensor.kind in ("scan", "points")]
    if lasers and about.root_frame not in FIXED_FRAMES and not about.camera_root:
        found.append(
            f"{lasers[0]} is in {about.root_frame}, and no transform leads to {', '.join(FIXED_FRAMES)}: a robot that drives "
            "needs odometry, or what stands still seems to move"
        )
    return found
