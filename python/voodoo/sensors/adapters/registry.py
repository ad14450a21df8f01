"""The registered adapters: one for each kind of input. A class of measurements may have several."""

from __future__ import annotations

from typing import Any

from voodoo.errors import MeasurementError
from voodoo.sensors.adapters.base import Adapter
from voodoo.sensors.kinds import add_kind, remove_kind

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
    add_kind(adapter.kind, adapter.recorded_as or adapter.kind)


def unregister(kind: str) -> None:
    """Unregister an adapter; does nothing if there is none."""
    _adapters.pop(kind, None)
    _by_class.clear()
    remove_kind(kind)


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
