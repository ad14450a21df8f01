"""Masks: without specks, cracks and holes, and of the pixels where a person may be."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TypeAlias

import cv2
import numpy as np
import numpy.typing as npt

from voodoo.errors import MeasurementError
from voodoo.measurements import FloatArray
from voodoo.model.at_rest import proportion
from voodoo.model.body import STATURE_M
from voodoo.model.camera import Camera
from voodoo.model.joint import numbers_of
from voodoo.model.projection import CameraView

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


def known_places(known: Mapping[str, npt.ArrayLike]) -> dict[str, FloatArray]:
    """The positions (3,) [m] of known sites, checked.

    Raises:
        MeasurementError: one is not three finite numbers.
    """
    kind, expected = MeasurementError, "three finite numbers"
    return {site: numbers_of(f"known[{site}]", place, kind, expected, count=3) for site, place in known.items()}


_BESIDE_M, _TRUNK_M, _GIRTH_M = 0.35, 0.15, 0.12
"""How far the person extends beyond known sites [m]: beyond any, beyond those of the trunk, beyond the bones of the limbs."""


_TRUNK = {"l_shoulder", "r_shoulder", "l_hip", "r_hip"}


_LIMBS = tuple(
    (f"{side}_{first}", f"{side}_{middle}", f"{side}_{last}")
    for side in "lr"
    for first, middle, last in (("shoulder", "elbow", "wrist"), ("shoulder", "elbow", "hand"), ("hip", "knee", "ankle"))
)
"""Joints of arms and legs."""


def surroundings(
    known: Mapping[str, FloatArray], camera: Camera, root_from_sensor: FloatArray, *, height: float = STATURE_M
) -> Mask:
    """Mask (height, width) of the pixels where the person may be, given known sites.

    An arm or leg with both ends known is a segment, widened by how far it can be bent and by its girth; if its elbow or knee
    is known too, it is two segments of its girth. The rest of the body is the convex hull of the known sites, widened by 15 cm
    if shoulders and hips are among them, else by 35 cm.

    Args:
        known: positions (3,) [m] of sites in the root frame.
        camera: of the picture.
        root_from_sensor: (4, 4) pose of its optical frame.
        height: stature [m].

    Returns:
        True everywhere if a site is behind the camera, or none is known.

    Raises:
        MeasurementError: a position is not three finite numbers.
    """
    places = known_places(known)
    pixels, depths = CameraView(camera, root_from_sensor).project(np.array(list(places.values())).reshape(-1, 3))
    mask = np.zeros((camera.height, camera.width), dtype=np.uint8)
    if not places or not np.isfinite(pixels).all():
        return np.ones(mask.shape, dtype=bool)
    ends = dict(zip(places, np.rint(np.clip(pixels, -16_000, 16_000)).astype(np.int32), strict=True))
    scale = camera.fx / float(depths.min())

    def widened(sites: Sequence[str], by: float) -> None:
        hull = cv2.convexHull(np.stack([ends[site] for site in sites]))
        cv2.fillPoly(mask, [hull], 1)
        cv2.polylines(mask, [hull], True, 1, max(round(2.0 * by * scale), 1))

    rest = set(ends)
    for first, middle, last in _LIMBS:
        if first in ends and middle in ends and last in ends:
            widened([first, middle], _GIRTH_M)
            widened([middle, last], _GIRTH_M)
            rest -= {middle, last}
        elif first in ends and last in ends:
            straight = float(np.linalg.norm(places[first] - places[last]))
            length = proportion(first, middle, last) * height
            bend = 0.5 * float(np.sqrt(max(length**2 - straight**2, 0.0)))
            widened([first, last], bend + _GIRTH_M)
            rest.discard(last)
    if rest:
        widened(sorted(rest), _TRUNK_M if rest >= _TRUNK else _BESIDE_M)
    return np.asarray(mask != 0, dtype=bool)
