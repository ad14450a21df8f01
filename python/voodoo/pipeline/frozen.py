"""Detects frozen sensors. The points of a frozen depth camera would all be false evidence that nobody moves."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from voodoo.measurements import Measurement
from voodoo.sensors.adapters import adapters_of

_STRIDE = 16
"""Every n-th row of an array is compared first."""


class FrozenSensors:
    """Detects frozen sensors; `names` are those found in the last frame."""

    def __init__(self) -> None:
        """Start without measurements."""
        self.names: tuple[str, ...] = ()
        self._contents: dict[str, npt.NDArray[Any]] = {}

    def __copy__(self) -> FrozenSensors:
        """A copy; measurements are shared because they are never changed in place."""
        twin = FrozenSensors()
        twin.names, twin._contents = self.names, dict(self._contents)
        return twin

    def without(
        self,
        measurements: Sequence[Measurement],
        *,
        use: Sequence[str],
        idle: Callable[[Measurement], bool],
    ) -> list[Measurement]:
        """The measurements whose sensor is not frozen.

        A sensor is frozen if it repeats its last measurement bit by bit while another sensor measures something new: real
        sensors have noise. Only kinds in `use` count. Measurements in `idle` are not used in this frame. Comparing them would
        require decoding images, so they are compared only when another sensor repeats its measurement.
        """
        repeats: list[Measurement] = []
        changes = False
        for item in sorted(measurements, key=idle):
            if idle(item) and not repeats:
                continue
            content = next((one.content(item) for one in adapters_of(item) if one.kind in use), None)
            if content is None:
                continue
            before = self._contents.get(item.sensor)
            self._contents[item.sensor] = content
            if before is not None and unchanged(before, content):
                repeats.append(item)
            else:
                changes = changes or before is not None
        stuck = repeats if changes else []
        self.names = tuple(item.sensor for item in stuck)
        if not stuck:
            return list(measurements)
        return [item for item in measurements if not any(item is other for other in stuck)]


def unchanged(before: npt.NDArray[Any], content: npt.NDArray[Any]) -> bool:
    """Whether measured data are bit by bit those before."""
    known, some = {"equal_nan": content.dtype.kind == "f"}, slice(None, None, _STRIDE)
    # Noise makes the first rows differ, so that all are seldom compared.
    alike = before.shape == content.shape and np.array_equal(before[some], content[some], **known)
    return alike and np.array_equal(before, content, **known)
