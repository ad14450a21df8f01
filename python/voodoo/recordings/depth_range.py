"""The range of depths in a recording's depth images, which reveals a wrong unit before it causes a lost body."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import islice

import numpy as np

from voodoo.errors import VoodooError
from voodoo.measurements import DepthImage
from voodoo.recordings.recording import Recording

_IMAGES = 5
"""Number of images at the start that are searched for valid depths."""
_NEAR_M, _FAR_M = 1.2, 8.0
"""Plausible depths of a camera that observes a person: some are beyond the first limit, and the median is below the second."""


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


def depth_range(recording: Recording) -> DepthRange | None:
    """The range of the first depth image with valid depths; None without one, or if it cannot be read."""
    try:
        for recorded in islice(recording, _IMAGES):
            for item in recorded.measurements:
                if isinstance(item, DepthImage):
                    meters = item.image.astype(np.float64).ravel() * item.meters_per_unit
                    meters = meters[np.isfinite(meters) & (meters > 0.0)]
                    if meters.size:
                        near, middle, far = (float(value) for value in np.percentile(meters, (5.0, 50.0, 95.0)))
                        return DepthRange(near, middle, far)
    except VoodooError:
        return None  # reading the frames reports the error
    return None
