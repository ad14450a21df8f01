"""Rays on which named sites were detected, from any number of cameras: their mutual agreement, and where they meet."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from voodoo._core import Frame
from voodoo._core import SiteRay as SiteRay
from voodoo.measurements import FloatArray
from voodoo.model.rays import passing
from voodoo.sensors.model import SensorModel

AGREE_M = 0.08
"""A ray at this distance from a position has a quarter of the weight of a ray through it; networks have errors of 2 to 6 cm."""
TRUSTED = 0.25
"""A ray with less trust does not support the position."""
_LEAST_TRUST = 0.05
"""Rays with less trust are not used."""


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


def place_of(rays: Sequence[SiteRay]) -> TriangulatedSite | None:
    """Triangulates the rays of one site by robust least squares; returns None if fewer than two rays agree.

    Every pair of rays gives an initial position. The one with the most support from all rays is refined with the
    Geman-McClure weight `(s^2 / (s^2 + r^2))^2` of a ray's distance r from it, s = AGREE_M.
    """
    if len(rays) < 2:
        return None
    origins = np.array([ray.origin for ray in rays])
    directions = np.array([ray.direction for ray in rays])
    planes = across(directions)
    information = np.array([1.0 / ray.sigma**2 for ray in rays])
    one, other = np.array(list(combinations(range(len(rays)), 2))).T
    _, points, ahead = passing(origins[one], directions[one], origins[other], directions[other])
    best = max(points[ahead], key=lambda point: trust_at(point, origins, directions).sum(), default=None)
    found = None if best is None else met(origins, directions, information, best)
    if found is None:
        return None
    point, trust = found
    seeing = trust >= TRUSTED
    if seeing.sum() < 2:
        return None
    matrix = (information[seeing, None, None] * planes[seeing]).sum(axis=0)
    least = float(np.linalg.eigvalsh(matrix)[0])
    return TriangulatedSite(point, least**-0.5, trust) if least > 0.0 else None


_STEPS = 20
_MOVED_M = 1e-4


def agreed(rays: Sequence[SiteRay], *, predicted: Mapping[str, FloatArray]) -> list[SiteRay]:
    """Returns the rays with a trust that measures how well those of one site agree.

    With three rays or more to a site, its position is found by reweighted least squares from the predicted position;
    the Geman-McClure weight `(s^2 / (s^2 + r^2))^2` of a ray's distance r from it is the ray's trust, s = AGREE_M.
    So a camera whose network confuses a joint is outvoted by the others instead of pulling the limb half way. With
    fewer than three rays the trust is unchanged.
    """
    groups: dict[str, list[int]] = {}
    for index, ray in enumerate(rays):
        groups.setdefault(ray.site, []).append(index)
    result = list(rays)
    for site, members in groups.items():
        if len(members) < 3 or site not in predicted:
            continue
        origins = np.array([rays[index].origin for index in members])
        directions = np.array([rays[index].direction for index in members])
        information = np.array([rays[index].trust / rays[index].sigma ** 2 for index in members])
        # The prediction is a weak prior, so that the position is determined for parallel rays too.
        prior = 0.01 * float(information.max())
        found = met(origins, directions, information, predicted[site], prior=prior)
        for index, trust in zip(members, found[1], strict=True) if found else ():
            result[index] = result[index].trusted(result[index].trust * float(trust))
    return result


def across(directions: FloatArray) -> FloatArray:
    """Projections (N, 3, 3) onto the planes perpendicular to unit directions (N, 3)."""
    return np.asarray(np.eye(3) - directions[:, :, None] * directions[:, None, :])


def trust_at(point: FloatArray, origins: FloatArray, directions: FloatArray) -> FloatArray:
    """The Geman-McClure weights (N,) of the distances of rays from a point; 0 of rays that lead away from it."""
    towards = point - origins
    along = (towards * directions).sum(axis=1)
    distance2 = np.square(towards - along[:, None] * directions).sum(axis=1)
    return np.where(along > 0.0, (AGREE_M**2 / (AGREE_M**2 + distance2)) ** 2, 0.0)


def met(
    origins: FloatArray,
    directions: FloatArray,
    information: FloatArray,
    start: FloatArray,
    *,
    prior: float = 0.0,
) -> tuple[FloatArray, FloatArray] | None:
    """Where rays meet, by reweighted least squares, and the trust of each; None if they do not determine a point.

    Args:
        origins, directions: (N, 3) of the rays.
        information: (N,) inverse variances [1/m^2].
        start: the first position (3,) [m].
        prior: information of `start` [1/m^2].
    """
    planes, point = across(directions), start
    offsets = np.einsum("nij,nj->ni", planes, origins)
    for _ in range(_STEPS):
        weights = information * trust_at(point, origins, directions)
        matrix = (weights[:, None, None] * planes).sum(axis=0) + prior * np.eye(3)
        if not prior and float(np.linalg.eigvalsh(matrix)[0]) <= 0.0:
            return None
        before, point = point, np.linalg.solve(matrix, weights @ offsets + prior * start)
        if float(np.linalg.norm(point - before)) < _MOVED_M:
            break
    return point, trust_at(point, origins, directions)


def add_rays(frame: Frame, rays: Sequence[SiteRay], *, model: SensorModel) -> int:
    """Add rays with the weights of their standard deviations; those that others contradict are left out.

    Returns:
        The number of rays added.

    Raises:
        MeasurementError: a standard deviation that is not a number above zero.
    """
    if not rays:
        return 0
    return frame._add_site_rays(
        rays, reference_sigma=model.reference_sigma, max_weight=model.max_weight, min_trust=_LEAST_TRUST
    )
