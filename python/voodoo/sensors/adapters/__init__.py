"""Adapters: the interface of a sensor to front end, overlay and viewer.

One adapter a file; `register` makes a new one known, see examples/uwb_tag.py. A measurement that serves several inputs has an
adapter for each.
"""

from voodoo.drawing.canvas import Canvas
from voodoo.drawing.rerun_log import Log
from voodoo.sensors.adapters.base import NOBODY, Adapter, Context, Memory
from voodoo.sensors.adapters.color import ColorAdapter
from voodoo.sensors.adapters.depth import DepthAdapter
from voodoo.sensors.adapters.keypoints import KeypointsAdapter
from voodoo.sensors.adapters.markers import MarkersAdapter
from voodoo.sensors.adapters.points import PointsAdapter, ScanAdapter
from voodoo.sensors.adapters.registry import adapter_of, adapters_of, all_adapters, register, unregister
from voodoo.sensors.adapters.skin import SkinAdapter

for _adapter in (
    DepthAdapter(),
    PointsAdapter(),
    ScanAdapter(),
    KeypointsAdapter(),
    SkinAdapter(),
    ColorAdapter(),
    MarkersAdapter(),
):
    register(_adapter)

__all__ = [
    "NOBODY",
    "Adapter",
    "Canvas",
    "Context",
    "Log",
    "Memory",
    "adapter_of",
    "adapters_of",
    "all_adapters",
    "register",
    "unregister",
]
