"""Cleaning of masks: specks, cracks and holes."""

from __future__ import annotations

from typing import TypeAlias

import cv2
import numpy as np
import numpy.typing as npt

from voodoo.errors import MeasurementError
from voodoo.measurements import FloatArray

Mask: TypeAlias = npt.NDArray[np.bool_]
"""(height, width)."""
_HOLE_PX = 40


def without_specks(mask: Mask, *, smallest: int) -> Mask:
    """Removes regions of fewer than `smallest` pixels from a mask."""
    _, labels, stats, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=8)
    large = stats[:, cv2.CC_STAT_AREA] >= smallest
    large[0] = False  # label 0 is the background
    return np.asarray(large[labels], dtype=bool)


def filled(mask: Mask) -> Mask:
    """Closes cracks and holes of up to 40 pixels in a mask. Sensors miss single pixels, which a distance transform would
    treat as background."""
    closed = cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((3, 3), dtype=np.uint8))
    _, labels, stats, _ = cv2.connectedComponentsWithStats(1 - closed, connectivity=4)
    small = stats[:, cv2.CC_STAT_AREA] <= _HOLE_PX
    return np.asarray((closed != 0) | small[labels], dtype=bool)


def known_place(site: str, position: npt.ArrayLike) -> FloatArray:
    """The position (3,) [m] of a known site, checked.

    Raises:
        MeasurementError: it is not three finite numbers.
    """
    place = np.asarray(position, dtype=np.float64).reshape(-1)
    if place.shape != (3,) or not np.isfinite(place).all():
        raise MeasurementError(f"known[{site}]: expected three finite numbers, found {position!r}")
    return place
