"""Markers and magnetic trackers as inputs: positions of named sites."""

from __future__ import annotations

import numpy as np

from voodoo._core import Frame
from voodoo.drawing.surfaces import Canvas, Log
from voodoo.measurements import MarkerSet
from voodoo.sensors.adapters.base import Adapter, Context, Memory

MARKER = (60, 60, 255)
"""Color in overlays, BGR."""


class MarkersAdapter(Adapter[MarkerSet]):
    """Sets of markers; markers on sites that the body does not have are ignored."""

    kind = "markers"
    measurement = MarkerSet

    def add(self, frame: Frame, item: MarkerSet, context: Context) -> None:
        """As positions of sites."""
        sigma = context.settings.marker_sigma if item.sigma is None else item.sigma
        weight = context.settings.model.weight(sigma)
        for site, position in item.positions.items():
            if site in context.predicted:
                frame.add_position(site, position, weight=weight, source=item.sensor)

    def draw(self, item: MarkerSet, canvas: Canvas, memory: Memory) -> None:
        """Large dots."""
        if item.positions:
            canvas.dots(np.array(list(item.positions.values()), dtype=np.float64), color=MARKER, radius=4)

    def log(self, item: MarkerSet, log: Log, memory: Memory) -> None:
        """Named points."""
        names, places = list(item.positions), list(item.positions.values())
        points = log.rr.Points3D(places, radii=0.015, colors=(255, 60, 60), labels=names, show_labels=False)
        log.send(f"world/markers/{log.entity(item.sensor)}", points)
