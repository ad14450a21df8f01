"""The adapters that are known: one for each kind of measurement."""

from __future__ import annotations

from typing import Any

from voodoo.errors import MeasurementError
from voodoo.sensors.adapters.base import Adapter
from voodoo.sensors.kinds import add_kind, remove_kind

_adapters: dict[type, Adapter[Any]] = {}


def register(adapter: Adapter[Any]) -> None:
    """Make a sensor known to front ends, overlays and viewers.

    Raises:
        MeasurementError: its kind or its measurement has an adapter already.
    """
    for known in _adapters.values():
        if adapter.kind == known.kind or adapter.measurement is known.measurement:
            raise MeasurementError(
                f"adapter {adapter.kind!r} for {adapter.measurement.__name__}: expected a new kind and measurement, found "
                f"{known.kind!r} for {known.measurement.__name__}"
            )
    _adapters[adapter.measurement] = adapter
    add_kind(adapter.kind, adapter.recorded_as or adapter.kind)


def unregister(kind: str) -> None:
    """Forget an adapter; nothing happens if there is none."""
    for measurement in [known.measurement for known in _adapters.values() if known.kind == kind]:
        del _adapters[measurement]
    remove_kind(kind)


def all_adapters() -> tuple[Adapter[Any], ...]:
    """All that are known."""
    return tuple(_adapters.values())


def adapter_of(item: object) -> Adapter[Any]:
    """The adapter of a measurement, or of the nearest class it inherits from.

    Raises:
        MeasurementError: there is none.
    """
    for known in type(item).__mro__:
        if known in _adapters:
            return _adapters[known]
    names = ", ".join(measurement.__name__ for measurement in _adapters)
    raise MeasurementError(f"measurement: expected one of {names}, found {type(item).__name__}; see adapters.register")
