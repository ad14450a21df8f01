"""Masks of the person in depth and colour pictures, for voodoo.ik: by connected depth, or against a still
background."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TypeAlias

import cv2
import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from voodoo.errors import MeasurementError
from voodoo.recordings import DepthImage
from voodoo.views import CameraView
from voodoo.witness import depth_points

FloatArray: TypeAlias = npt.NDArray[np.float64]
Mask: TypeAlias = npt.NDArray[np.bool_]

_STEP = 0.03
"""Two neighbours whose depths differ by more than this share lie on different things."""
_FLOOR_M = 0.05
_IN_FRONT_M, _BEHIND_M = 0.30, 0.05
"""A body's surface lies in front of its joints: depths around a known site that belong to the person."""


def from_depth(depth: DepthImage, known: Mapping[str, FloatArray], *, level: bool = True) -> Mask:
    """The person in a depth image: all that hangs together in depth with a known site.

    Args:
        depth: the image.
        known: positions (3,) [m] of sites of the person in the root frame; none of the others is used.
        level: z is up and 0 on the floor in the root frame: what is lower than 5 cm is floor.

    Returns:
        (height, width); all false when no known site is seen.

    Raises:
        MeasurementError: a position is not three finite numbers.
    """
    height, width = depth.image.shape
    points, valid = depth_points(depth)
    solid = valid & (points[:, 2] > _FLOOR_M) if level else valid
    z = np.where(solid, depth.image.astype(np.float64).reshape(-1) * depth.metres_per_unit, np.nan)
    labels = _connected(z.reshape(height, width))
    seeds = set()
    for site, position in known.items():
        place = np.asarray(position, dtype=np.float64).reshape(1, -1)
        if place.shape != (1, 3) or not np.isfinite(place).all():
            raise MeasurementError(f"known[{site}]: expected three finite numbers, found {position!r}")
        pixel, distance = CameraView(depth.camera, depth.root_from_sensor).project(place)
        if not np.isfinite(pixel).all():
            continue
        u, v = np.rint(pixel[0]).astype(int)
        if 0 <= u < width and 0 <= v < height:
            here = z[v * width + u]
            if distance[0] - _IN_FRONT_M <= here <= distance[0] + _BEHIND_M:
                seeds.add(int(labels[v * width + u]))
    mask = np.isin(labels, list(seeds)) & solid
    return filled(np.asarray(mask.reshape(height, width), dtype=bool))


def filled(mask: Mask, *, hole: int = 40) -> Mask:
    """A mask without cracks and without holes of up to `hole` pixels: sensors leave out single pixels, and a distance
    transform takes each of them for background."""
    closed = cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((3, 3), dtype=np.uint8))
    _, labels, stats, _ = cv2.connectedComponentsWithStats(1 - closed, connectivity=4)
    small = stats[:, cv2.CC_STAT_AREA] <= hole
    return np.asarray((closed != 0) | small[labels], dtype=bool)


def _connected(z: FloatArray) -> npt.NDArray[np.int32]:
    """Label (height * width,) of the surface each pixel lies on; pixels without depth are alone."""
    height, width = z.shape
    index = np.arange(height * width).reshape(height, width)
    pairs = []
    for near, far in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:])):
        with np.errstate(invalid="ignore"):
            joined = np.abs(z[near] - z[far]) < _STEP * np.minimum(z[near], z[far])
        pairs.append((index[near][joined], index[far][joined]))
    first, second = (np.concatenate([pair[side] for pair in pairs]) for side in (0, 1))
    graph = coo_array((np.ones(len(first), dtype=np.int8), (first, second)), shape=(z.size, z.size))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int32)


class StillBackground:
    """What a fixed colour camera sees without the person: the median of pictures spread over a recording."""

    def __init__(self, pictures: Sequence[npt.NDArray[np.uint8]], *, threshold: float = 30.0) -> None:
        """Learn the background.

        Args:
            pictures: some, (height, width, 3) BGR; the person should leave every place in more than half of them.
            threshold: least colour difference of the foreground, 0 to 255.

        Raises:
            MeasurementError: no picture, or pictures of different sizes.
        """
        if not pictures or len({picture.shape for picture in pictures}) != 1:
            raise MeasurementError(f"pictures: expected some of one size, found {len(pictures)}")
        self._median = np.median(np.stack(pictures), axis=0).astype(np.float32)
        self._threshold = threshold

    def mask(self, picture: npt.NDArray[np.uint8]) -> Mask:
        """The largest thing (height, width) that differs from the background, holes closed."""
        difference = np.abs(cv2.GaussianBlur(picture, (0, 0), 1.5).astype(np.float32) - self._median).max(axis=2)
        return largest(difference > self._threshold)


def largest(mask: Mask, *, close: int = 3) -> Mask:
    """The largest connected part of a mask after opening and closing it by `close` pixels; empty stays empty."""
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * close + 1, 2 * close + 1))
    small = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (3, 3))
    smooth = cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_OPEN, small)
    smooth = cv2.morphologyEx(smooth, cv2.MORPH_CLOSE, kernel)
    count, labels, stats, _ = cv2.connectedComponentsWithStats(smooth)
    if count < 2:
        return np.zeros(mask.shape, dtype=bool)
    return np.asarray(labels == 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA])), dtype=bool)
