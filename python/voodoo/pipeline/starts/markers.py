"""A first pose from markers and magnetic trackers, which measure positions of sites."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from voodoo.measurements import MarkerSet
from voodoo.pipeline.starts.base import FoundStart, StartFinder, StartFrame, fixes_pose
from voodoo.sensors.pixels import FloatArray


class MarkersStart(StartFinder):
    """Finds a person in a frame whose markers determine the pose."""

    name = "markers"

    def find(self, frame: StartFrame) -> Sequence[FoundStart]:
        """See StartFinder."""
        joints: dict[str, FloatArray] = {}
        sigma: dict[str, float] = {}
        for item in frame.measurements:
            if isinstance(item, MarkerSet):
                for site, position in item.positions.items():
                    if site in frame.body.site_names and np.isfinite(position).all():
                        joints[site] = np.asarray(position, dtype=np.float64)
                        sigma[site] = frame.settings.marker_sigma if item.sigma is None else item.sigma
        return [FoundStart(joints, sigma, self.name)] if fixes_pose(joints, frame.body) else []
