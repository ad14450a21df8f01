"""Adapters: the interface of a sensor to front end, overlay and viewer.

One adapter a file; `register` makes a new one known, see examples/uwb_tag.py. A measurement that serves several inputs has an
adapter for each.
"""

from voodoo.drawing.canvas import Canvas as Canvas
from voodoo.drawing.rerun_log import Log as Log
from voodoo.sensors.adapters.base import NOBODY as NOBODY
from voodoo.sensors.adapters.base import Adapter as Adapter
from voodoo.sensors.adapters.base import Context as Context
from voodoo.sensors.adapters.base import Memory as Memory
from voodoo.sensors.adapters.color import ColorAdapter
from voodoo.sensors.adapters.depth import DepthAdapter
from voodoo.sensors.adapters.keypoints import KeypointsAdapter
from voodoo.sensors.adapters.markers import MarkersAdapter
from voodoo.sensors.adapters.points import PointsAdapter, ScanAdapter
from voodoo.sensors.adapters.registry import adapter_of as adapter_of
from voodoo.sensors.adapters.registry import adapters_of as adapters_of
from voodoo.sensors.adapters.registry import all_adapters as all_adapters
from voodoo.sensors.adapters.registry import register as register
from voodoo.sensors.adapters.registry import unregister as unregister
from voodoo.sensors.adapters.skin import SkinAdapter

for _kind in (DepthAdapter, PointsAdapter, ScanAdapter, KeypointsAdapter, SkinAdapter, ColorAdapter, MarkersAdapter):
    register(_kind())
