"""Arranges several images in one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from voodoo.drawing.ink import Picture


def in_rows(pictures: Sequence[Picture], *, columns: int) -> Picture:
    """Images in rows of `columns`, scaled to the height of the first one in a row, all rows to the width of the first one;
    black where there are too few."""
    pictures = [*pictures, *[np.zeros_like(pictures[0])] * (-len(pictures) % columns)]
    starts = range(0, len(pictures), columns)
    rows = [np.hstack(_fitted(pictures[start : start + columns], 0)) for start in starts]
    return np.asarray(np.vstack(_fitted(rows, 1)), dtype=np.uint8)


def _fitted(pictures: Sequence[Picture], axis: int) -> list[npt.NDArray[Any]]:
    """Images scaled to the size of the first one along an axis: 0 height, 1 width."""
    size = pictures[0].shape[axis]
    fitted = []
    for picture in pictures:
        height, width = (round(side * size / picture.shape[axis]) for side in picture.shape[:2])
        fitted.append(cv2.resize(picture, (width, height), interpolation=cv2.INTER_AREA))
    return fitted
