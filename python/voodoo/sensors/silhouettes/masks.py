"""Cleaning of masks: specks, cracks and holes."""

from __future__ import annotations

from typing import TypeAlias

import cv2
import numpy as np
import numpy.typing as npt

Mask: TypeAlias = npt.NDArray[np.bool_]
"""(height, width)."""


def without_specks(mask: Mask, *, smallest: int) -> Mask:
    """A mask without pieces of fewer pixels than `smallest`."""
    _, labels, stats, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=8)
    large = stats[:, cv2.CC_STAT_AREA] >= smallest
    large[0] = False  # label 0 is the background
    return np.asarray(large[labels], dtype=bool)


def filled(mask: Mask, *, hole: int = 40) -> Mask:
    """A mask without cracks and without holes of up to `hole` pixels: sensors leave out single pixels, and a distance
    transform takes each of them for background."""
    closed = cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((3, 3), dtype=np.uint8))
    _, labels, stats, _ = cv2.connectedComponentsWithStats(1 - closed, connectivity=4)
    small = stats[:, cv2.CC_STAT_AREA] <= hole
    return np.asarray((closed != 0) | small[labels], dtype=bool)
