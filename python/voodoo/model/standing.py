"""Which way is up: frames of cameras, and the axis along which bodies stand."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

_UPRIGHT = 0.7
"""Least mean component of trunk, thighs and calves along the axis; it is 0.9 of who walks, and less of who sits or bends."""
HIGH_M = 1.5
"""Feet that are never below this height above z = 0 are not on a floor there; stairs and platforms are lower."""
_SIDES = (("shoulder", "hip"), ("hip", "knee"), ("knee", "ankle"))


def is_optical(frame: str) -> bool:
    """Whether a frame is a camera's optical frame by its name (REP-103): x right, y down, z forward."""
    return "optical" in frame


def standing_along(names: Sequence[str], positions: npt.NDArray[np.float64]) -> str:
    """The axis along which a body stands from its feet to its shoulders, e.g. "+Z"; "" if it stands along none.

    Args:
        names: J names of joints or sites.
        positions: (F, J, 3); NaN = missing.
    """
    at = {name: index for index, name in enumerate(names)}
    ends = [(f"{side}_{high}", f"{side}_{low}") for side in "lr" for high, low in _SIDES]
    up = [positions[:, at[high]] - positions[:, at[low]] for high, low in ends if high in at and low in at]
    rows = np.concatenate(up) if up else np.empty((0, 3))
    rows = rows[np.isfinite(rows).all(axis=1)]
    length = float(np.linalg.norm(rows, axis=1).sum())
    mean = rows.sum(axis=0) / length if length > 0.0 else np.zeros(3)
    axis = int(np.argmax(np.abs(mean)))
    return f"{'+' if mean[axis] > 0.0 else '-'}{'XYZ'[axis]}" if abs(mean[axis]) >= _UPRIGHT else ""
