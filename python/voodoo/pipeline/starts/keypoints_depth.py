"""A first pose from keypoints and depth: each keypoint lies behind the surface that a depth camera measures there."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TypeAlias

import numpy as np

import voodoo._core as _core
from voodoo.measurements import DepthImage, FloatArray, KeypointImage
from voodoo.pipeline.starts import base
from voodoo.pipeline.starts.base import FoundStart, StartFinder, StartFrame
from voodoo.sensors.depth import depth_points
from voodoo.sensors.keypoints.sites import POINT_SIGMA_M, WINDOW_PX, SitePixel, behind_surface
from voodoo.sensors.pixels import in_sensor, world_rays

_Person: TypeAlias = dict[str, tuple[FloatArray, float]]
"""Site -> position (3,) and standard deviation [m]."""
_Points: TypeAlias = tuple[FloatArray, FloatArray]


class KeypointsDepthStart(StartFinder):
    """Finds persons whose trunk and some limbs a depth camera also measures, the nearest first."""

    name = "keypoints with depth"

    def find(self, frame: StartFrame) -> Sequence[FoundStart]:
        """See StartFinder."""
        depths = [item for item in frame.measurements if isinstance(item, DepthImage)]
        images = [item for item in frame.measurements if isinstance(item, KeypointImage)]
        found = []
        for item in images:
            for person in _people(item, depths, frame):
                joints = {name: place for name, (place, _) in person.items()}
                away = float(np.median(in_sensor(item.root_from_sensor, np.array(list(joints.values())))[:, 2]))
                sigma = {name: sigma for name, (_, sigma) in person.items()}
                found.append((away, FoundStart(joints, sigma, self.name)))
        return [one for _, one in sorted(found, key=lambda pair: pair[0])]


def _people(item: KeypointImage, depths: Sequence[DepthImage], frame: StartFrame) -> Iterator[_Person]:
    """The persons of an image that can give a first pose, with the depth image that is nearest in time."""
    near = [depth for depth in depths if abs(depth.stamp - item.stamp) <= base.TOGETHER_S]
    if not near or not item.people:
        return
    depth = min(near, key=lambda each: (abs(each.stamp - item.stamp), each.camera != item.camera))
    surface = _points_in_view(depth, item)
    for rows in item.people:
        if sites := base.visible_sites(item, rows, frame):
            person = _placed(sites, item, surface, frame, coarse=item.camera.fx / depth.camera.fx)
            kept = base.in_proportion(base.without_impossible({name: place for name, (place, _) in person.items()}))
            if len(kept) >= base.LEAST_SITES and base.fixes_pose(kept, frame.body):
                yield {name: person[name] for name in kept}


def _points_in_view(depth: DepthImage, item: KeypointImage) -> _Points:
    """Pixels (N, 2) of the points of a depth image in the image of the keypoints, and their depths there (N,) [m]."""
    points, _ = depth_points(depth)
    local = in_sensor(item.root_from_sensor, points)
    local = local[local[:, 2] > 0.0]
    return item.camera.project(local), np.ascontiguousarray(local[:, 2])


def _placed(
    sites: Sequence[SitePixel], item: KeypointImage, points: _Points, frame: StartFrame, *, coarse: float
) -> _Person:
    """The sites that have a surface behind their keypoint."""
    origin, directions = world_rays(item.camera, item.root_from_sensor, [site.pixel for site in sites])
    focal = math.sqrt(item.camera.fx * item.camera.fy)
    placed: _Person = {}
    for site, direction in zip(sites, directions, strict=True):
        # For a coarser depth camera the window is in its pixels.
        depth = _core.nearest_surface(*points, pixel=site.pixel, radius=WINDOW_PX / 2.0 * max(coarse, 1.0))
        if depth is None or not np.isfinite(direction).all():
            continue
        surface = depth / float(direction @ item.root_from_sensor[:3, 2])
        noise = frame.settings.keypoint_noise
        sigma = noise.sigma(depth, focal, confidence=site.confidence, spread=site.spread)
        place = origin + direction * (surface + behind_surface(site.site))
        placed[site.site] = np.asarray(place), math.hypot(sigma, POINT_SIGMA_M)
    return placed
