"""Regions of skin in a picture, and where in them a head or a hand may be."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

import voodoo._core as _core

Mask = npt.NDArray[np.bool_]
Labels = npt.NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class Candidate:
    """A place in the image where a head or hand may be.

    Args:
        pixel: (u, v).
        region: number of the region it is of.
        area: of that region [px].
        hand: False for the middle of a region that is longer than a hand: it may be a face, but not a hand.
    """

    pixel: tuple[float, float]
    region: int
    area: int
    hand: bool = True


def candidates(skin: Mask, *, palm_px: float) -> tuple[list[Candidate], Labels]:
    """Where in a skin mask (H, W) a head or a hand may be.

    Regions with less than a fifth of a palm's area are noise. Each other one offers its middle, unless it is larger
    than four faces (a door); one that is longer than a hand also offers its tips: the middles of what lies within a
    palm's reach of the contour's farthest points.

    Args:
        skin: True where the colour is skin's.
        palm_px: radius of a palm in the image [px].

    Returns:
        The candidates, and the number of its region in each pixel (H, W).
    """
    found, labels = _core.skin_candidates(skin, palm_px)
    return [Candidate(*item) for item in found], labels
