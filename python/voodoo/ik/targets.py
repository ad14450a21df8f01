"""Targets of sites: positions, and lines of sight."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from voodoo.errors import MeasurementError
from voodoo.ik.values import Vector, three
from voodoo.model.joint import short

TargetParts: TypeAlias = tuple[str, str, tuple[float, float, float, float, float, float], float, int]
"""Site, kind, values, weight and priority of a target."""


@dataclass(frozen=True)
class Target:
    """A target of a site. Create it with `at` or `on_ray`.

    Args:
        site: name of a site on the chain.
        kind: "position" or "line".
        values: x, y, z [m], 0, 0, 0; or unit direction and moment of a line in Pluecker form (R07 eq. 11).
        weight: weight relative to the other targets of the same priority.
        priority: 0 is the highest; a target never disturbs one of higher priority.
    """

    site: str
    kind: Literal["position", "line"]
    values: tuple[float, float, float, float, float, float]
    weight: float = 1.0
    priority: int = 0

    def __post_init__(self) -> None:
        """Check the numbers.

        Raises:
            MeasurementError: it names the field.
        """
        if self.kind not in ("position", "line"):
            raise MeasurementError(f"target {self.site}: kind: expected position or line, found {self.kind!r}")
        if len(self.values) != 6 or not all(map(math.isfinite, self.values)):
            raise MeasurementError(f"target {self.site}: expected finite meters, found {self.values}")
        if not (isinstance(self.weight, (int, float)) and math.isfinite(self.weight) and self.weight > 0.0):
            raise MeasurementError(f"target {self.site}: weight: expected a number above zero, found {self.weight!r}")
        if isinstance(self.priority, bool) or not isinstance(self.priority, int) or self.priority < 0:
            raise MeasurementError(f"target {self.site}: priority: expected 0, 1, ..., found {self.priority!r}")

    @classmethod
    def at(cls, site: str, position: Vector, *, weight: float = 1.0, priority: int = 0) -> Target:
        """A site at a world position (3,) [m].

        Raises:
            MeasurementError: not three finite numbers, or a weight that is not above zero.
        """
        x, y, z = three(f"target {site}: position", position)
        return cls(site, "position", (x, y, z, 0.0, 0.0, 0.0), weight, priority)

    @classmethod
    def on_ray(cls, site: str, *, origin: Vector, direction: Vector, weight: float = 1.0, priority: int = 0) -> Target:
        """A site on the line through `origin` (3,) [m] along `direction` (3,), e.g. the ray of a pixel.

        Raises:
            MeasurementError: not three finite numbers, no direction, or a weight that is not above zero.
        """
        o = np.array(three(f"target {site}: origin", origin))
        n = np.array(three(f"target {site}: direction", direction))
        length = float(np.linalg.norm(n))
        if not 1e-12 < length < math.inf:
            raise MeasurementError(f"target {site}: direction: expected a vector other than zero, found {direction!r}")
        n /= length
        a, b, c, d, e, f = (float(value) for value in np.concatenate([n, np.cross(o, n)]))
        return cls(site, "line", (a, b, c, d, e, f), weight, priority)

    def parts(self) -> TargetParts:
        """The target in the form that the core takes."""
        return (self.site, self.kind, self.values, self.weight, self.priority)


Targets: TypeAlias = Mapping[str, Vector] | Sequence[Target]


def target_parts(targets: Targets) -> list[TargetParts]:
    """Targets in the form that the core takes; a mapping holds positions.

    Raises:
        MeasurementError: neither, or a position is not three finite numbers.
    """
    if not isinstance(targets, Mapping):
        if not isinstance(targets, Sequence) or not all(isinstance(target, Target) for target in targets):
            raise MeasurementError(
                f"targets: expected site -> position (3,), or a list of Target, found {short(targets)}"
            )
        return [target.parts() for target in targets]
    parts: list[TargetParts] = []
    for site, position in targets.items():
        if not isinstance(site, str):
            raise MeasurementError(f"targets: expected names of sites, found {short(site)}")
        x, y, z = three(f"target {site}: position", position)
        if not (math.isfinite(x) and math.isfinite(y) and math.isfinite(z)):
            raise MeasurementError(f"target {site}: expected finite meters, found {short(position)}")
        parts.append((site, "position", (x, y, z, 0.0, 0.0, 0.0), 1.0, 0))
    return parts
