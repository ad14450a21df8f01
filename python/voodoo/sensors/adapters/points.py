"""Point clouds and laser scans as inputs; points that may be on the body are extrapolated to the frame's time."""

from __future__ import annotations

from typing import Any

import numpy.typing as npt

from voodoo._core import Frame
from voodoo.drawing.surfaces import Canvas, Log
from voodoo.measurements import LaserScan, PointCloud
from voodoo.model.projection import transform
from voodoo.sensors.adapters.base import Adapter, Context, Memory

SCAN, CLOUD = (90, 230, 90), (225, 225, 120)
"""Colors in overlays, BGR."""


class PointsAdapter(Adapter[PointCloud]):
    """Point clouds."""

    kind = "points"
    measurement = PointCloud
    measured = "points"
    while_searching = True

    def add(self, frame: Frame, item: PointCloud, context: Context) -> None:
        """As points, those on the body moved to the frame's time."""
        chosen = context.settings
        weight = context.range_weight(chosen.depth_noise, chosen.sharing, item.root_from_sensor)
        _add(frame, item, item.points, weight, context)

    def draw(self, item: PointCloud, canvas: Canvas, memory: Memory) -> None:
        """Small dots."""
        canvas.dots(transform(item.root_from_sensor, item.points), color=CLOUD, radius=1)

    def log(self, item: PointCloud, log: Log, memory: Memory) -> None:
        """Points colored by limb."""
        some = item.points[:: max(len(item.points) // log.most_points, 1)]
        log.body_points(f"world/points/{log.entity(item.sensor)}", some, item.root_from_sensor)


class ScanAdapter(Adapter[LaserScan]):
    """Sweeps of planar lasers."""

    kind = "scan"
    measurement = LaserScan
    measured = "ranges"
    while_searching = True

    def add(self, frame: Frame, item: LaserScan, context: Context) -> None:
        """As points, those on the body moved to the frame's time."""
        chosen = context.settings
        weight = context.range_weight(chosen.scan_noise, chosen.scan_sharing, item.root_from_sensor)
        _add(frame, item, item.points(), weight, context)

    def draw(self, item: LaserScan, canvas: Canvas, memory: Memory) -> None:
        """Dots."""
        canvas.dots(transform(item.root_from_sensor, item.points()), color=SCAN, radius=2)

    def log(self, item: LaserScan, log: Log, memory: Memory) -> None:
        """Points."""
        points = transform(item.root_from_sensor, item.points())
        log.send(f"world/laser/{log.entity(item.sensor)}", log.rr.Points3D(points, radii=0.015, colors=(255, 220, 0)))


def _add(frame: Frame, item: PointCloud | LaserScan, points: npt.NDArray[Any], weight: float, context: Context) -> None:
    pose = item.root_from_sensor
    points = context.motion_compensated(points, pose, item.stamp)
    frame.add_points(points, world_from_sensor=pose, weight=weight, source=item.sensor)
