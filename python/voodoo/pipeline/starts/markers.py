"""A first pose from markers and magnetic trackers: they say where sites are."""

from __future__ import annotations

import numpy as np

from voodoo.measurements import MarkerSet
from voodoo.pipeline.starts.base import Found, Seen, StartFinder, fixes_pose
from voodoo.sensors.pixels import FloatArray


class MarkersStart(StartFinder):
    """The first frame whose markers fix the pose."""

    name = "markers"

    def look(self, seen: Seen) -> Found | None:
        """See StartFinder."""
        joints: dict[str, FloatArray] = {}
        sigma: dict[str, float] = {}
        for item in seen.measurements:
            if isinstance(item, MarkerSet):
                for site, position in item.positions.items():
                    if site in seen.body.site_names and np.isfinite(position).all():
                        joints[site] = np.asarray(position, dtype=np.float64)
                        sigma[site] = seen.settings.marker_sigma if item.sigma is None else item.sigma
        return Found(joints, sigma, self.name) if fixes_pose(joints, seen.body) else None
