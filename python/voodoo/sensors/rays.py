"""Rays on which named sites were seen, from any number of cameras, and how far they agree with each other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from voodoo._core import Frame
from voodoo.sensors.model import SensorModel
from voodoo.sensors.pixels import FloatArray

_STEPS = 20
_MOVED_M = 1e-4


@dataclass(frozen=True, eq=False)
class SiteRay:
    """A site was seen on a ray.

    Args:
        site: its name.
        origin: focal point (3,) in the world [m].
        direction: (3,) unit vector in the world.
        sigma: standard deviation across the ray at the site [m].
        source: name for `Estimate.sources`.
        trust: factor of its weight, in [0, 1].
        bias: it may always be this far off [m]; see `Frame.add_position`.
        place: (3,) where on the ray the site is [m], if a depth camera saw it; None: not known.
        place_sigma: standard deviation of `place` along the ray [m].
    """

    site: str
    origin: FloatArray
    direction: FloatArray
    sigma: float
    source: str
    trust: float = 1.0
    bias: float = 0.0
    place: FloatArray | None = None
    place_sigma: float = 0.04

    def moved(self, shift: FloatArray) -> SiteRay:
        """The ray of a site that has gone on by (3,) [m] since it was seen."""
        place = None if self.place is None else self.place + shift
        return replace(self, origin=self.origin + shift, place=place)


def agreed(
    rays: Sequence[SiteRay], *, predicted: Mapping[str, npt.NDArray[np.float64]], scale: float = 0.08
) -> list[SiteRay]:
    """The rays with a trust that tells how well those of one site agree.

    With three rays or more to a site, its position is found by reweighted least squares from the predicted position;
    the Geman-McClure weight `(s^2 / (s^2 + r^2))^2` of a ray's distance r from it is the ray's trust, s = `scale`
    [m]. A camera whose network confuses a joint thus loses to the others instead of pulling the limb half way. Fewer
    rays keep their trust.
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
        start = np.asarray(predicted[site], dtype=np.float64)
        for index, trust in zip(members, _trust(origins, directions, information, start, scale), strict=True):
            result[index] = replace(result[index], trust=result[index].trust * float(trust))
    return result


def _trust(
    origins: FloatArray, directions: FloatArray, information: FloatArray, start: FloatArray, scale: float
) -> FloatArray:
    across = np.eye(3) - directions[:, :, None] * directions[:, None, :]
    offsets = np.einsum("nij,nj->ni", across, origins)
    # The prediction takes part as one weak datum, so that parallel rays leave no direction open.
    prior = 0.01 * float(information.max())
    point = start
    for _ in range(_STEPS):
        distance2 = (np.einsum("nij,j->ni", across, point) - offsets) ** 2
        trust = (scale**2 / (scale**2 + distance2.sum(axis=1))) ** 2
        weights = information * trust
        matrix = (weights[:, None, None] * across).sum(axis=0) + prior * np.eye(3)
        moved = np.linalg.solve(matrix, (weights[:, None] * offsets).sum(axis=0) + prior * start)
        done = float(np.linalg.norm(moved - point)) < _MOVED_M
        point = moved
        if done:
            break
    distance2 = (np.einsum("nij,j->ni", across, point) - offsets) ** 2
    return np.asarray((scale**2 / (scale**2 + distance2.sum(axis=1))) ** 2)


def add_rays(frame: Frame, rays: Sequence[SiteRay], *, model: SensorModel, min_trust: float = 0.05) -> int:
    """Add rays with the weights of their standard deviations; those trusted less than `min_trust` are left out.

    Returns:
        How many were added.
    """
    count = 0
    for ray in rays:
        if ray.trust >= min_trust:
            weight = model.weight(ray.sigma) * ray.trust
            frame.add_ray(
                ray.site, origin=ray.origin, direction=ray.direction, weight=weight, bias=ray.bias, source=ray.source
            )
            if ray.place is not None:
                along = model.weight(ray.place_sigma) * ray.trust
                frame.add_position(ray.site, ray.place, weight=along, bias=ray.bias, source=ray.source)
            count += 1
    return count
