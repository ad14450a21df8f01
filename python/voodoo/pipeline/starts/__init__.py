"""Sources of first poses: one module for each kind of input."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from voodoo.pipeline.starts.base import FoundStart as FoundStart
from voodoo.pipeline.starts.base import StartFinder as StartFinder
from voodoo.pipeline.starts.base import StartFrame as StartFrame
from voodoo.pipeline.starts.cameras import CamerasStart
from voodoo.pipeline.starts.keypoints_depth import KeypointsDepthStart
from voodoo.pipeline.starts.legs import LegsStart
from voodoo.pipeline.starts.markers import MarkersStart


@dataclass(frozen=True, eq=False)
class Starts:
    """Sources of the first pose for a front end.

    Args:
        finders: evaluated in this order in every frame.
        by_tracker: if none of them finds a person, the tracker itself searches the depth images.
    """

    finders: Sequence[StartFinder]
    by_tracker: bool = True


def automatic_starts() -> Starts:
    """All sources for the inputs of a recording: markers, keypoints of several cameras, keypoints with depth, depth, legs in a
    laser."""
    return Starts((MarkersStart(), CamerasStart(), KeypointsDepthStart(), LegsStart()))
