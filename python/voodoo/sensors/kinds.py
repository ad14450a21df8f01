"""Which kinds of inputs there are: those of the package, and those of adapters that were registered."""

from __future__ import annotations

from voodoo.names import INPUTS

_SERVES: dict[str, str] = {kind: kind for kind in INPUTS if kind != "skin"} | {"color": "skin"}
_known: dict[str, str] = {kind: recorded for recorded, kind in _SERVES.items()}


def inputs() -> tuple[str, ...]:
    """All kinds a front end can use: INPUTS first, then others in the order they were registered."""
    others = tuple(kind for kind in _known if kind not in INPUTS)
    return INPUTS + others


def input_of(recorded: str) -> str | None:
    """Which input a recording's sensor of a kind serves (see `SensorInfo`); None: none."""
    return next((kind for kind, name in _known.items() if name == recorded), None)


def add_kind(kind: str, recorded: str) -> None:
    """Make a kind known; `recorded` is what recordings call its sensors."""
    _known[kind] = recorded


def remove_kind(kind: str) -> None:
    """Forget a kind that was added."""
    if kind not in INPUTS:
        _known.pop(kind, None)
