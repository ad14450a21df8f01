"""Persons found in the keypoints of two or more calibrated cameras, triangulated."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, product
from math import inf
from typing import TypeAlias

import numpy as np

from voodoo.measurements import FloatArray, KeypointImage
from voodoo.pipeline.starts import base
from voodoo.pipeline.starts.base import FoundStart, StartFinder, StartFrame
from voodoo.sensors.model import TYPICAL_RANGE_M
from voodoo.sensors.pixels import ray_distance, world_rays
from voodoo.sensors.rays import SiteRay, TriangulatedSite, place_of

_BASELINE_M = 0.1
"""Cameras with a shorter baseline give no usable depth with 4 px of error."""
_SAME_PERSON_M = 0.15
"""Largest median distance of a person's rays in one camera from the triangulated positions: half the distance to a neighbor."""
_WORST_SIGMA_M = 0.10
_GONE_S = 1.0
"""A camera without an image for this time has gone: it does not count among those that could see a person."""


_Person: TypeAlias = dict[str, SiteRay]
"""A person in one camera: a ray for each site."""
_View: TypeAlias = Sequence[_Person]
"""The persons in one camera."""


class CamerasStart(StartFinder):
    """Finds persons on whose whole trunk and some limbs cameras agree, the one observed best first.

    Where several persons are tracked, only those count who are seen by most of the cameras: other people stand in the
    background of one or two images, and wrong matches may agree by chance. A single person is one whom two cameras see.
    """

    name = "keypoints of several cameras"

    def __init__(self) -> None:
        """Start without observations."""
        self._latest: dict[str, KeypointImage] = {}

    def find(self, frame: StartFrame) -> Sequence[FoundStart]:
        """See StartFinder."""
        for item in frame.measurements:
            if isinstance(item, KeypointImage):
                self._latest[item.sensor] = item
        self._latest = {name: item for name, item in self._latest.items() if abs(frame.stamp - item.stamp) <= _GONE_S}
        images = [item for item in self._latest.values() if abs(frame.stamp - item.stamp) <= base.TOGETHER_S]
        views = [[person for rows in item.people if (person := _person(item, rows, frame))] for item in images]
        found = []
        while (best := _best([view for view in views if view], frame)) is not None:
            joints = _joints(best.places)
            sigma = {name: best.places[name].sigma for name in joints}
            most = 2 * len(best.persons) > len(self._latest)
            found.append(FoundStart(joints, sigma, self.name, log_odds=inf if most else 0.0))
            taken = {id(person) for person in best.persons}
            views = [[person for person in view if id(person) not in taken] for view in views]
        return found


@dataclass(frozen=True, eq=False)
class _Group:
    """One person in several cameras, and the positions of their sites."""

    persons: Sequence[_Person]
    places: dict[str, TriangulatedSite]

    @property
    def score(self) -> float:
        """Number of rays that agree."""
        return sum(float(place.trust.sum()) for place in self.places.values())


def _best(views: Sequence[_View], frame: StartFrame) -> _Group | None:
    """The person with the most agreeing rays."""
    best: _Group | None = None
    for one, other in combinations(views, 2):
        for pair in product(one, other):
            group = _together(pair, [view for view in views if view is not one and view is not other])
            if group is not None and (best is None or group.score > best.score) and _stands(group.places, frame):
                best = group
    return best


def _joints(places: dict[str, TriangulatedSite]) -> dict[str, FloatArray]:
    return base.without_impossible({name: place.position for name, place in places.items()})


def _stands(places: dict[str, TriangulatedSite], frame: StartFrame) -> bool:
    """Whether positions form a person to which the body can be fitted."""
    joints = _joints(places)
    return len(joints) >= base.LEAST_SITES and base.fixes_pose(joints, frame.body)


def _person(item: KeypointImage, rows: FloatArray, frame: StartFrame) -> _Person:
    """One person of one image; {} with too few keypoints."""
    if not (sites := base.visible_sites(item, rows, frame)):
        return {}
    origin, directions = world_rays(item.camera, item.root_from_sensor, [site.pixel for site in sites])
    noise, focal = frame.settings.keypoint_noise, float(np.sqrt(item.camera.fx * item.camera.fy))
    rays = {}
    for site, direction in zip(sites, directions, strict=True):
        if np.isfinite(direction).all():
            sigma = noise.sigma(TYPICAL_RANGE_M, focal, confidence=site.confidence, spread=site.spread)
            rays[site.site] = SiteRay(site.site, origin, direction, sigma, item.sensor)
    return rays if len(rays) >= base.LEAST_SITES else {}


def _together(pair: tuple[_Person, _Person], others: Sequence[_View]) -> _Group | None:
    """A person in two cameras, with the matching detections in the other cameras."""
    persons = list(pair)
    places = _places(persons) if _gap(*pair) < 2.0 * _SAME_PERSON_M else {}
    if len(places) < base.LEAST_SITES:
        return None
    for view in others:
        away, nearest = min(((_away(person, places), person) for person in view), key=lambda each: each[0])
        if away < _SAME_PERSON_M:
            persons.append(nearest)
    return _Group(persons, places if len(persons) == len(pair) else _places(persons))


def _gap(one: _Person, other: _Person) -> float:
    """Median distance [m] of the rays of the same sites in two cameras; it is large for different persons."""
    common = [name for name in one if name in other]
    if len(common) < base.LEAST_SITES:
        return float("inf")
    first, second = ([person[name] for name in common] for person in (one, other))
    across = np.cross([ray.direction for ray in first], [ray.direction for ray in second])
    between = second[0].origin - first[0].origin
    return float(np.median(np.abs(across @ between) / np.maximum(np.linalg.norm(across, axis=1), 1e-9)))


def _away(person: _Person, places: dict[str, TriangulatedSite]) -> float:
    """Median distance [m] of a person's rays from positions."""
    common = [name for name in person if name in places]
    if len(common) < base.LEAST_SITES:
        return float("inf")
    rays = [person[name] for name in common]
    directions = np.array([ray.direction for ray in rays])
    positions = np.array([places[name].position for name in common])
    return float(np.median(ray_distance(rays[0].origin, directions, positions)))


def _places(group: Sequence[_Person]) -> dict[str, TriangulatedSite]:
    """Positions where the rays of one person in several cameras intersect."""
    origins = [next(iter(person.values())).origin for person in group]
    if max(float(np.linalg.norm(a - b)) for a, b in combinations(origins, 2)) < _BASELINE_M:
        return {}
    found = {}
    for name in {name: None for person in group for name in person}:
        place = place_of([person[name] for person in group if name in person])
        if place is not None and place.sigma < _WORST_SIGMA_M:
            found[name] = place
    return found
