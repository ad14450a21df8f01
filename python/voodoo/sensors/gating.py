"""Gates around predicted sites: what is too far from where a site must be is not a measurement of it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from voodoo.errors import MeasurementError
from voodoo.sensors.pixels import FloatArray, lengths, ray_distance

_NOWHERE = np.full(3, np.nan)


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

    def __copy__(self) -> SiteGate:
        """The same, with a memory of its own."""
        twin = SiteGate.__new__(SiteGate)
        vars(twin).update(vars(self), _last=dict(self._last))
        return twin

    def limit(self, site: str, source: str, stamp: float) -> float:
        """Radius [m] of a site's gate at `stamp` [s]."""
        waited = max(stamp - self._last.setdefault((site, source), stamp), 0.0)
        return min(self.radius + self.growth * waited, self.widest)

    def accepts_ray(
        self, site: str, predicted: FloatArray, origin: FloatArray, direction: FloatArray, stamp: float, source: str
    ) -> bool:
        """Whether a ray (unit direction) passes near enough to the predicted site (3,)."""
        return self.accepts(site, float(ray_distance(origin, direction, predicted)), stamp, source)

    def accepts_point(
        self, site: str, predicted: FloatArray, point: FloatArray, stamp: float, source: str = "points"
    ) -> bool:
        """Whether a point (3,) is near enough to the predicted site."""
        return self.accepts(site, float(np.linalg.norm(point - predicted)), stamp, source)

    def accepts(self, site: str, distance: float, stamp: float, source: str) -> bool:
        """Whether a measurement this far [m] from the predicted site is near enough."""
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
    _names: tuple[str, ...] = field(default=(), repr=False)
    _stamp: float = field(default=float("nan"), repr=False)
    _positions: FloatArray = field(default_factory=lambda: np.zeros((0, 3)), repr=False)
    _velocity: FloatArray = field(default_factory=lambda: np.zeros((0, 3)), repr=False)

    def update(self, stamp: float, names: tuple[str, ...], positions: FloatArray) -> None:
        """Take up an estimate's named positions (J, 3) [m]; a NaN stamp (after a reset) forgets the velocity."""
        velocity = np.zeros_like(positions)
        if stamp > self._stamp:
            before = self._positions
            if names != self._names:
                known = dict(zip(self._names, before, strict=True))
                before = np.array([known.get(name, _NOWHERE) for name in names])
            velocity = (positions - before) / (stamp - self._stamp)
            speeds = lengths(velocity)
            # NaN: the site is new.
            if not speeds.max(initial=0.0) <= self.max_speed:
                velocity[~(speeds <= self.max_speed)] = 0.0
        self._names, self._stamp, self._positions, self._velocity = names, stamp, positions, velocity

    def predict(self, stamp: float) -> dict[str, FloatArray]:
        """Site name -> (3,) [m] at `stamp` [s].

        Raises:
            MeasurementError: no estimate yet.
        """
        return dict(zip(self._names, self.positions(stamp), strict=True))

    def positions(self, stamp: float) -> FloatArray:
        """The same of all sites (J, 3) [m].

        Raises:
            MeasurementError: no estimate yet.
        """
        if not self._names:
            raise MeasurementError("prediction: expected an estimate first, found none")
        elapsed = self.velocity_share * (stamp - self._stamp) if math.isfinite(self._stamp) else 0.0
        return np.asarray(self._positions + elapsed * self._velocity)
