"""The known kinds of inputs: those of the package, and those of registered adapters."""

from __future__ import annotations

from voodoo.names import INPUTS

KNOWN: dict[str, str] = {kind: "color" if kind == "skin" else kind for kind in INPUTS}
"""Kind of input -> kind of its sensors in recordings; adapters are registered here, too."""


def inputs() -> tuple[str, ...]:
    """All kinds a front end can use: INPUTS first, then others in the order they were registered."""
    others = tuple(kind for kind in KNOWN if kind not in INPUTS)
    return INPUTS + others


def inputs_of(recorded: str) -> tuple[str, ...]:
    """Returns the inputs that a sensor of a recorded kind provides (see `SensorInfo`)."""
    return tuple(kind for kind, name in KNOWN.items() if name == recorded)
