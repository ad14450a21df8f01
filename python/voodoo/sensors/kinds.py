"""The known kinds of inputs: those of the package, and those of registered adapters."""

from __future__ import annotations

from voodoo.names import INPUTS

KNOWN: dict[str, str] = {kind: "color" if kind == "skin" else kind for kind in INPUTS}
"""Kind of input -> kind of its sensors in recordings (see `SensorInfo`): INPUTS first, then others in the order in which their
adapters were registered."""
