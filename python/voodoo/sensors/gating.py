"""Gates around predicted sites: what is too far from where a site must be is not a measurement of it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from voodoo.errors import MeasurementError
from voodoo.sensors.pixels import FloatArray, ray_distance


@dataclass
class SiteGate:
    """Accepts measurements near predicted sites, per site and source, and opens slowly while nothing is accepted.

    A gate that stays closed would never let a tracker that drifted off come back, so it widens by `growth` for every
    second since the last measurement of that site it accepted, up to `widest`.

    Args:
        radius: [m].
        growth: [m/s].
        widest: [m].

    Raises:
        MeasurementError: a number is negative, or `widest` is less than `radius`.
    """

    radius: float = 0.15
    growth: float = 0.5
    widest: float = 0.40
    _last: dict[tuple[str, str], float] = field(default_factory=dict, repr=False)

    def __post_init__(self) -> None:
        """Check the numbers."""
        if not (self.radius > 0.0 and self.growth >= 0.0 and self.widest >= self.radius):
            raise MeasurementError(
                f"gate: expected 0 < radius <= widest and growth >= 0, found radius {self.radius!r}, growth "
                f"{self.growth!r}, widest {self.widest!r}"
            )

    def limit(self, site: str, source: str, stamp: float) -> float:
        """Radius [m] of a site's gate at `stamp` [s]."""
        waited = max(stamp - self._last.setdefault((site, source), stamp), 0.0)
        return min(self.radius + self.growth * waited, self.widest)

    def accepts_ray(
        self, site: str, predicted: FloatArray, origin: FloatArray, direction: FloatArray, stamp: float, source: str
    ) -> bool:
        """Whether a ray (unit direction) passes near enough to the predicted site (3,)."""
        return self._accept(site, source, float(ray_distance(origin, direction, predicted)), stamp)

    def accepts_point(
        self, site: str, predicted: FloatArray, point: FloatArray, stamp: float, source: str = "points"
    ) -> bool:
        """Whether a point (3,) is near enough to the predicted site."""
        return self._accept(site, source, float(np.linalg.norm(point - predicted)), stamp)

    def _accept(self, site: str, source: str, distance: float, stamp: float) -> bool:
        if distance > self.limit(site, source, stamp):
            return False
        self._last[site, source] = stamp
        return True


@dataclass
class SitePredictor:
    """Where sites will be: the last estimate moved on by a share of its velocity.

    Args:
        velocity_share: 0 predicts rest, 1 constant velocity; 0.6 is what prototypes measured best.
        max_speed: a faster estimate [m/s] is a jump, not a movement, and predicts rest.
    """

    velocity_share: float = 0.6
    max_speed: float = 8.0
    _last: tuple[float, dict[str, FloatArray]] | None = field(default=None, repr=False)
    _velocity: dict[str, FloatArray] = field(default_factory=dict, repr=False)

    def update(self, stamp: float, joints: Mapping[str, npt.NDArray[np.float64]]) -> None:
        """Take up an estimate; a NaN stamp (after a reset) forgets the velocity."""
        current = {name: np.asarray(position, dtype=np.float64) for name, position in joints.items()}
        self._velocity = {}
        if self._last is not None and stamp > self._last[0]:
            elapsed = stamp - self._last[0]
            for name, position in current.items():
                if name in self._last[1]:
                    velocity = (position - self._last[1][name]) / elapsed
                    if math.hypot(*velocity.tolist()) <= self.max_speed:
                        self._velocity[name] = velocity
        self._last = (stamp, current)

    def predict(self, stamp: float) -> dict[str, FloatArray]:
        """Site name -> (3,) [m] at `stamp` [s].

        Raises:
            MeasurementError: no estimate yet.
        """
        if self._last is None:
            raise MeasurementError("prediction: expected an estimate first, found none")
        last, positions = self._last
        elapsed = self.velocity_share * (stamp - last) if np.isfinite(last) else 0.0
        return {name: position + elapsed * self._velocity.get(name, 0.0) for name, position in positions.items()}
