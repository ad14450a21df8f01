"""The known kinds of inputs: those of the package, and those of registered adapters."""

from __future__ import annotations

from voodoo.names import INPUTS

_known: dict[str, str] = {kind: "color" if kind == "skin" else kind for kind in INPUTS}
"""Kind of input -> kind of its sensors in recordings."""


def inputs() -> tuple[str, ...]:
    """All kinds a front end can use: INPUTS first, then others in the order they were registered."""
    others = tuple(kind for kind in _known if kind not in INPUTS)
    return INPUTS + others


def inputs_of(recorded: str) -> tuple[str, ...]:
    """Returns the inputs that a sensor of a recorded kind provides (see `SensorInfo`)."""
    return tuple(kind for kind, name in _known.items() if name == recorded)


def add_kind(kind: str, recorded: str) -> None:
    """Register a kind; `recorded` is the kind of its sensors in recordings."""
    _known[kind] = recorded


def remove_kind(kind: str) -> None:
    """Unregister a kind that was added."""
    if kind not in INPUTS:
        _known.pop(kind, None)
