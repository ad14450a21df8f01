"""Sources of first poses: one module for each kind of input."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

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
        finders: evaluated in this order in every frame; by default those of markers, keypoints of several cameras, keypoints
            with depth, and legs in a laser.
        by_tracker: if none of them finds a person, the tracker itself searches the depth images.
    """

    finders: Sequence[StartFinder] = field(
        default_factory=lambda: (MarkersStart(), CamerasStart(), KeypointsDepthStart(), LegsStart())
    )
    by_tracker: bool = True
