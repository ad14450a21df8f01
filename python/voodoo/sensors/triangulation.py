"""Triangulates sites from the rays of several cameras, without a prediction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import numpy.typing as npt

from voodoo.measurements import FloatArray
from voodoo.sensors.rays import SiteRay, across, met, trust_at

AGREE_M = 0.08
"""A ray at this distance from a position has a quarter of the weight of a ray through it; networks have errors of 2 to 6 cm."""
TRUSTED = 0.25
"""A ray with less trust does not support the position."""
_PARALLEL = 1e-3
"""Rays whose directions differ by less than 2 degrees (sine squared) do not determine a position."""


@dataclass(frozen=True, eq=False)
class TriangulatedSite:
    """A position triangulated from rays.

    Args:
        position: (3,) [m], world.
        sigma: standard deviation along the worst direction [m].
        trust: of each ray, in [0, 1].
    """

    position: FloatArray
    sigma: float
    trust: FloatArray

    @property
    def visible_in(self) -> npt.NDArray[np.bool_]:
        """Which rays (N,) support it."""
        return np.asarray(self.trust >= TRUSTED)


def place_of(rays: Sequence[SiteRay], *, scale: float = AGREE_M) -> TriangulatedSite | None:
    """Triangulates the rays of one site by robust least squares; returns None if fewer than two rays agree.

    Every pair of rays gives an initial position. The one with the most support from all rays is refined with the
    Geman-McClure weight `(s^2 / (s^2 + r^2))^2` of a ray's distance r from it, s = `scale` [m].
    """
    if len(rays) < 2:
        return None
    origins = np.array([ray.origin for ray in rays])
    directions = np.array([ray.direction for ray in rays])
    planes = across(directions)
    information = np.array([1.0 / ray.sigma**2 for ray in rays])
    best: tuple[float, FloatArray] | None = None
    for pair in combinations(range(len(rays)), 2):
        point = _meeting(origins[list(pair)], directions[list(pair)], planes[list(pair)])
        if point is not None:
            total = float(trust_at(point, origins, directions, scale=scale).sum())
            if best is None or total > best[0]:
                best = total, point
    if best is None:
        return None
    found = met(origins, directions, information, best[1], scale=scale)
    if found is None:
        return None
    point, trust = found
    seeing = trust >= TRUSTED
    if seeing.sum() < 2:
        return None
    matrix = (information[seeing, None, None] * planes[seeing]).sum(axis=0)
    least = float(np.linalg.eigvalsh(matrix)[0])
    return TriangulatedSite(point, least**-0.5, trust) if least > 0.0 else None


def _meeting(origins: FloatArray, directions: FloatArray, planes: FloatArray) -> FloatArray | None:
    """The point nearest to two rays; None for parallel ones, and behind a camera."""
    if 1.0 - float(directions[0] @ directions[1]) ** 2 < _PARALLEL:
        return None
    point = np.linalg.solve(planes.sum(axis=0), np.einsum("nij,nj->i", planes, origins))
    ahead = np.einsum("nj,nj->n", point - origins, directions)
    return np.asarray(point) if (ahead > 0.0).all() else None
