"""Gates around predicted sites, which reject measurements too far from the prediction."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, field

import voodoo._core as _core
from voodoo.errors import MeasurementError


@dataclass
class SiteGate:
    """Accepts measurements near predicted sites, per site and source, and opens slowly while nothing is accepted.

    With a fixed gate a tracker that has drifted could never recover. So the radius grows by `growth` for every second since
    the last accepted measurement of the site, up to `widest`.

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
    core: _core.SiteGate = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Check the numbers."""
        if not (self.radius > 0.0 and self.growth >= 0.0 and self.widest >= self.radius):
            raise MeasurementError(
                f"gate: expected 0 < radius <= widest and growth >= 0, found radius {self.radius!r}, growth "
                f"{self.growth!r}, widest {self.widest!r}"
            )
        self.core = _core.SiteGate(self.radius, self.growth, self.widest)

    def __copy__(self) -> SiteGate:
        """Copy the gate with its state."""
        twin = SiteGate.__new__(SiteGate)
        vars(twin).update(vars(self), core=copy(self.core))
        return twin

    def limit(self, site: str, source: str, stamp: float) -> float:
        """Radius [m] of a site's gate at `stamp` [s]."""
        return self.core.limit(site, source, stamp)

    def accepts(self, site: str, distance: float, stamp: float, source: str) -> bool:
        """Whether a measurement this far [m] from the predicted site is near enough."""
        return self.core.accepts(site, distance, stamp, source)
