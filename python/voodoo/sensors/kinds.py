"""Which kinds of inputs there are: those of the package, and those of adapters that were registered."""

from __future__ import annotations

from voodoo.names import INPUTS

_known: dict[str, str] = {kind: "color" if kind == "skin" else kind for kind in INPUTS}
"""Kind -> what recordings call its sensors."""


def inputs() -> tuple[str, ...]:
    """All kinds a front end can use: INPUTS first, then others in the order they were registered."""
    others = tuple(kind for kind in _known if kind not in INPUTS)
    return INPUTS + others


def inputs_of(recorded: str) -> tuple[str, ...]:
    """Which inputs a recording's sensor of a kind serves (see `SensorInfo`)."""
    return tuple(kind for kind, name in _known.items() if name == recorded)


def add_kind(kind: str, recorded: str) -> None:
    """Make a kind known; `recorded` is what recordings call its sensors."""
    _known[kind] = recorded


def remove_kind(kind: str) -> None:
    """Forget a kind that was added."""
    if kind not in INPUTS:
        _known.pop(kind, None)
