"""A first pose from markers and magnetic trackers, which measure positions of sites."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from voodoo.measurements import FloatArray, MarkerSet
from voodoo.pipeline.starts.base import FoundStart, StartFinder, StartFrame, fixes_pose


class MarkersStart(StartFinder):
    """Finds a person in every set of markers that determines the pose; else in all sets together, as those of single trackers."""

    name = "markers"

    def find(self, frame: StartFrame) -> Sequence[FoundStart]:
        """See StartFinder."""
        sets = [item for item in frame.measurements if isinstance(item, MarkerSet)]
        return self._found([[item] for item in sets], frame) or self._found([sets], frame)

    def _found(self, groups: Sequence[Sequence[MarkerSet]], frame: StartFrame) -> list[FoundStart]:
        """The persons whose pose the sets of a group determine."""
        found, names = [], frame.body.site_names
        for group in groups:
            joints: dict[str, FloatArray] = {}
            sigma: dict[str, float] = {}
            for item in group:
                for site, position in item.positions.items():
                    if site in names and np.isfinite(position).all():
                        joints[site] = np.asarray(position, dtype=np.float64)
                        sigma[site] = frame.settings.marker_sigma if item.sigma is None else item.sigma
            if fixes_pose(joints, frame.body):
                found.append(FoundStart(joints, sigma, self.name))
        return found
