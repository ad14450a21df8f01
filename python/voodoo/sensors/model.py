"""The sensor model: a standard deviation for every datum, which becomes its weight (K06 IV-C).

K06 weights each datum "with a measure that describes its accuracy" and gives numbers without units: 3-D point 1, face 30,
hand 20. Here the weight follows from a standard deviation. A datum whose position has the standard deviation `sigma` in
meters has the weight

    weight = min( (reference_sigma / sigma)^2 / sharing, max_weight )

with `reference_sigma` = 0.10 m. A ray with a sigma of 2.2 cm at the body then has weight 20, and one of 1.8 cm has weight 30.
This is the accuracy of the center of a skin region, so the published numbers follow from this model. `sharing` is the number
of data that share one error: every pixel of a depth image measures the surface, but the misfit between model and clothes is
common to a patch of pixels. With 25 (a patch of 5 x 5) a time-of-flight point at 3 m has weight 1.

The tracker's run time does not depend on weights.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from voodoo.errors import MeasurementError
from voodoo.model.joint import number_of

N = TypeVar("N", float, npt.NDArray[np.float64])
PAPER_WEIGHTS: dict[str, float] = {"point": 1.0, "face": 30.0, "hand": 20.0}
"""Weights of K06 section V: a 3-D point, the ray of the face tracker, the ray of a hand tracker."""

POINTS_SHARING = 25.0
"""Neighboring pixels of a depth image that share one error."""

TYPICAL_RANGE_M = 3.0
"""Assumed range of a person whose position is not known yet [m]."""


def check_number(name: str, value: float, *, zero: bool = True) -> None:
    """Raise an error for what is no number, not finite, negative, or zero if that is not allowed."""
    expected = f"a finite number {'>=' if zero else '>'} 0"
    number = number_of(name, value, expected, error=MeasurementError)
    if not math.isfinite(number) or number < 0.0 or (number == 0.0 and not zero):
        raise MeasurementError(f"{name}: expected {expected}, found {value!r}")


@dataclass(frozen=True)
class SensorModel:
    """How standard deviations become weights.

    Args:
        reference_sigma: standard deviation [m] of a datum with weight 1.
        max_weight: upper limit of weights, because no measurement is more accurate than the body model.

    Raises:
        MeasurementError: a number is not above zero.
    """

    reference_sigma: float = 0.10
    max_weight: float = 40.0

    def __post_init__(self) -> None:
        """Check both."""
        check_number("reference_sigma", self.reference_sigma, zero=False)
        check_number("max_weight", self.max_weight, zero=False)

    def weight(self, sigma: N, *, sharing: float = 1.0) -> N:
        """Weight of a datum.

        Args:
            sigma: standard deviation of its position [m], scalar or any shape.
            sharing: how many data share this error.

        Raises:
            MeasurementError: a sigma that is not a number above zero, or sharing below 1.
        """
        if not sharing >= 1.0:
            raise MeasurementError(f"sharing: expected a number of data >= 1, found {sharing!r}")
        if isinstance(sigma, float) and 0.0 < sigma < math.inf:
            # Rays are weighted one by one, and an array of one number takes ten times as long.
            return min((self.reference_sigma / sigma) ** 2 / sharing, self.max_weight)
        values = np.asarray(sigma, dtype=np.float64)
        if not np.isfinite(values).all() or (values <= 0.0).any():
            raise MeasurementError(f"sigma: expected finite meters > 0, found {sigma!r}")
        weights: Any = np.minimum((self.reference_sigma / values) ** 2 / sharing, self.max_weight)
        return weights if weights.ndim else weights.item()

    def sigma(self, weight: float) -> float:
        """Returns the standard deviation [m] that corresponds to a weight, such as those of K06."""
        check_number("weight", weight, zero=False)
        return self.reference_sigma / math.sqrt(weight)


@dataclass(frozen=True)
class RangeNoise:
    """Standard deviation of a range sensor: `constant + linear z + quadratic z^2` at range z.

    Args:
        constant: [m].
        linear: [m/m].
        quadratic: [m/m^2]; see `stereo_noise`.

    Raises:
        MeasurementError: a negative number, or all zero.
    """

    constant: float = 0.0
    linear: float = 0.0
    quadratic: float = 0.0

    def __post_init__(self) -> None:
        """Check all three."""
        for name in ("constant", "linear", "quadratic"):
            check_number(f"range noise {name}", getattr(self, name))
        if self.constant == self.linear == self.quadratic == 0.0:
            raise MeasurementError("range noise: expected one coefficient above zero, found none")

    def sigma(self, z: N) -> N:
        """Standard deviation [m] at range z [m]."""
        return self.constant + self.linear * z + self.quadratic * z * z


TIME_OF_FLIGHT = RangeNoise(constant=0.008, linear=0.004)
"""A SwissRanger-like camera (K06 III-A: "within a few centimeters" up to 7.5 m)."""
STRUCTURED_LIGHT = RangeNoise(quadratic=0.0015)
"""A Kinect-like camera: 1.5 mm z^2."""
PLANAR_LASER = RangeNoise(constant=0.030)
"""A beam is accurate to 1 cm; the rest is the difference between the model's legs and the trousers."""


def stereo_noise(*, focal: float, baseline: float, disparity_sigma: float = 0.5) -> RangeNoise:
    """Noise of stereo depth z = f b / d: dz = z^2 / (f b) dd.

    Args:
        focal: focal length of the rectified images [px].
        baseline: distance of the cameras [m].
        disparity_sigma: standard deviation of the disparity [px].

    Raises:
        MeasurementError: a number that is not above zero.
    """
    for name, value in (("focal", focal), ("baseline", baseline), ("disparity_sigma", disparity_sigma)):
        check_number(name, value, zero=False)
    return RangeNoise(quadratic=disparity_sigma / (focal * baseline))


@dataclass(frozen=True)
class PixelNoise:
    """Standard deviation of a feature in an image.

    At depth z the standard deviation perpendicular to the ray is `pixels / confidence * z / focal`, so a confidence of 0.5
    doubles it. `spread` is added in quadrature: the distance in meters, at any depth, between the feature and the site
    that it represents (networks define a hip differently).

    Args:
        pixels: at confidence 1 [px].
        spread: [m].

    Raises:
        MeasurementError: a negative number.
    """

    pixels: float = 4.0
    spread: float = 0.02

    def __post_init__(self) -> None:
        """Check both."""
        check_number("pixel noise", self.pixels, zero=False)
        check_number("spread", self.spread)

    def sigma(self, z: float, focal: float, *, confidence: float = 1.0, spread: float | None = None) -> float:
        """Standard deviation [m] perpendicular to the ray.

        Args:
            z: depth of the predicted site along the optical axis [m].
            focal: focal length [px].
            confidence: of the detection, in (0, 1]; larger ones count as 1.
            spread: replaces that of the model [m].

        Raises:
            MeasurementError: depth, focal length or confidence not above zero.
        """
        for name, value in (("depth", z), ("focal length", focal), ("confidence", confidence)):
            check_number(name, value, zero=False)
        across = self.pixels / min(confidence, 1.0) * z / focal
        return math.hypot(across, self.spread if spread is None else spread)
