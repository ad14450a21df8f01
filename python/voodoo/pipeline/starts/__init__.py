"""Sources of first poses: one module for each kind of input."""

from voodoo.pipeline.starts.base import FoundStart, StartFinder, StartFrame
from voodoo.pipeline.starts.cameras import CamerasStart
from voodoo.pipeline.starts.chosen import Starts, automatic_starts
from voodoo.pipeline.starts.given import EarlierStart, GivenStart
from voodoo.pipeline.starts.keypoints_depth import KeypointsDepthStart
from voodoo.pipeline.starts.legs import LegsStart
from voodoo.pipeline.starts.markers import MarkersStart

__all__ = [
    "CamerasStart",
    "EarlierStart",
    "FoundStart",
    "GivenStart",
    "KeypointsDepthStart",
    "LegsStart",
    "MarkersStart",
    "StartFinder",
    "StartFrame",
    "Starts",
    "automatic_starts",
]
