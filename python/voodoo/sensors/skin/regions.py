"""Regions of skin in a picture, and where in them a head or a hand may be."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

import voodoo._core as _core

Mask = npt.NDArray[np.bool_]
Labels = npt.NDArray[np.int32]

PALM_M, FACE_M = 0.045, 0.085
"""Radii of a palm and of a face."""
LONGEST_HAND = 4.6
"""A hand with stretched fingers in radii of its palm."""
LONGEST_JOINED = 3.0
"""Regions no longer than this, in radii of a palm, may be parts of one hand: a shadow between the fingers and the palm does not
make two of it. Arms that lie near each other stay apart."""


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
    smallest = max(0.2 * math.pi * palm_px**2, 6.0)
    largest = 4.0 * math.pi * (FACE_M / PALM_M * palm_px) ** 2
    labels, regions = _core.mask_regions(skin)
    found: list[Candidate] = []
    for region, ((top, bottom), (left, right), area, middle) in enumerate(regions, start=1):
        if not smallest <= area <= largest:
            continue
        if math.hypot(right - left, bottom - top) <= LONGEST_HAND * palm_px:
            found.append(Candidate(middle, region, area))
            continue
        mask = labels[top:bottom, left:right] == region
        hand = _length(mask) <= LONGEST_HAND * palm_px
        found.append(Candidate(middle, region, area, hand=hand))
        if not hand:
            found += [Candidate((u + left, v + top), region, area) for u, v in _tips(mask, palm_px)]
    return found, labels


def _length(mask: Mask) -> float:
    """The longer side of the narrowest box around a region, however turned."""
    contours, _ = cv2.findContours(mask.view(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    _, sides, _ = cv2.minAreaRect(np.concatenate(contours))
    return float(max(sides)) + 1.0


def _tips(mask: Mask, palm_px: float) -> list[tuple[float, float]]:
    """Middles of the parts of a region around its tips, farthest first, at most four."""
    contours, _ = cv2.findContours(mask.view(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    outline = max(contours, key=len).reshape(-1, 2)
    v, u = np.nonzero(mask)
    distance = (outline[:, 0] - u.mean()) ** 2 + (outline[:, 1] - v.mean()) ** 2
    # A tip is farther out than all of the contour around it.
    reach = round(2.5 * palm_px)
    around = distance.take(np.arange(-reach, len(distance) + reach), mode="wrap")
    farthest = cv2.dilate(around[None], np.ones((1, 2 * reach + 1), np.uint8))[0, reach : reach + len(distance)]
    peak = distance >= farthest
    peaks = np.flatnonzero(peak & (distance >= (1.5 * palm_px) ** 2))
    tips: list[tuple[float, float]] = []
    taken: list[list[float]] = []
    for tip in outline[peaks[np.argsort(-distance[peaks], kind="stable")]].tolist():
        if len(tips) == 4:
            break
        if any(math.dist(tip, other) < 3.0 * palm_px for other in taken):
            continue
        taken.append(tip)
        near = (u - tip[0]) ** 2 + (v - tip[1]) ** 2 < (3.2 * palm_px) ** 2
        tips.append((float(u[near].mean()), float(v[near].mean())))
    return tips
