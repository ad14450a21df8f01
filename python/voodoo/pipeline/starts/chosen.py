"""Which sources of first poses are asked, best first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from voodoo.pipeline.starts.base import StartFinder
from voodoo.pipeline.starts.cameras import CamerasStart
from voodoo.pipeline.starts.keypoints_depth import KeypointsDepthStart
from voodoo.pipeline.starts.legs import LegsStart
from voodoo.pipeline.starts.markers import MarkersStart


@dataclass(frozen=True, eq=False)
class Starts:
    """Where a front end takes the first pose from.

    Args:
        finders: asked in this order, frame by frame.
        by_tracker: where none of them finds anybody, the tracker looks into the depth images itself.
    """

    finders: Sequence[StartFinder]
    by_tracker: bool = True


def automatic_starts() -> Starts:
    """Whatever a recording offers: markers, keypoints of several cameras, keypoints with depth, depth, two legs in a laser."""
    return Starts((MarkersStart(), CamerasStart(), KeypointsDepthStart(), LegsStart()))
