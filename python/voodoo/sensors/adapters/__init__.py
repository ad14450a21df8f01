"""Adapters: the interface of a sensor to front end, overlay and viewer.

One adapter a file; `register` makes a new one known, see examples/uwb_tag.py. A measurement that serves several inputs has an
adapter for each.
"""

from __future__ import annotations

from typing import Any

from voodoo.drawing.surfaces import Canvas as Canvas
from voodoo.drawing.surfaces import Log as Log
from voodoo.errors import MeasurementError
from voodoo.names import INPUTS
from voodoo.sensors.adapters.base import NOBODY as NOBODY
from voodoo.sensors.adapters.base import Adapter as Adapter
from voodoo.sensors.adapters.base import Context as Context
from voodoo.sensors.adapters.base import Memory as Memory
from voodoo.sensors.adapters.color import ColorAdapter
from voodoo.sensors.adapters.depth import DepthAdapter
from voodoo.sensors.adapters.keypoints import KeypointsAdapter
from voodoo.sensors.adapters.markers import MarkersAdapter
from voodoo.sensors.adapters.points import PointsAdapter, ScanAdapter
from voodoo.sensors.adapters.skin import SkinAdapter
from voodoo.sensors.settings import KNOWN

_adapters: dict[str, Adapter[Any]] = {}
_by_class: dict[type, tuple[Adapter[Any], ...]] = {}
"""Cache of `adapters_of` by class of measurement; a front end calls it some ten times per frame."""


def register(adapter: Adapter[Any]) -> None:
    """Register an adapter with front ends, overlays and viewers.

    Raises:
        MeasurementError: its kind has an adapter already.
    """
    known = _adapters.get(adapter.kind)
    if known is not None:
        raise MeasurementError(
            f"adapter {adapter.kind!r} for {adapter.measurement.__name__}: expected a new kind, found "
            f"{known.kind!r} for {known.measurement.__name__}"
        )
    _adapters[adapter.kind] = adapter
    _by_class.clear()
    KNOWN[adapter.kind] = adapter.recorded_as or adapter.kind


def unregister(kind: str) -> None:
    """Unregister an adapter; does nothing if there is none."""
    _adapters.pop(kind, None)
    _by_class.clear()
    if kind not in INPUTS:
        KNOWN.pop(kind, None)


def all_adapters() -> tuple[Adapter[Any], ...]:
    """Returns all registered adapters."""
    return tuple(_adapters.values())


def adapters_of(item: object) -> tuple[Adapter[Any], ...]:
    """The adapters of a measurement, or of the nearest class it inherits from, in the order they were registered.

    Raises:
        MeasurementError: there is none.
    """
    found = _by_class.get(type(item))
    if found is not None:
        return found
    for known in type(item).__mro__:
        found = tuple(adapter for adapter in _adapters.values() if adapter.measurement is known)
        if found:
            _by_class[type(item)] = found
            return found
    names = ", ".join(dict.fromkeys(adapter.measurement.__name__ for adapter in _adapters.values()))
    raise MeasurementError(f"measurement: expected one of {names}, found {type(item).__name__}; see adapters.register")


def adapter_of(item: object) -> Adapter[Any]:
    """Returns the first adapter of a measurement, for display, which is the same for all adapters of one measurement.

    Raises:
        MeasurementError: there is none.
    """
    return adapters_of(item)[0]


for _kind in (DepthAdapter, PointsAdapter, ScanAdapter, KeypointsAdapter, SkinAdapter, ColorAdapter, MarkersAdapter):
    register(_kind())
