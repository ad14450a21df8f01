"""Masks of the person in depth pictures, for voodoo.ik: what hangs together with the known sites, and what stands before the
still scene near them. Those of colour pictures are in voodoo.sensors.background."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TypeAlias

import cv2
import numpy as np
import numpy.typing as npt

from voodoo.camera import Camera
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
_REACH_M = 0.6
"""No elbow or knee is farther from a known shoulder, hand, hip or ankle, girth included."""
_BESIDE_M, _TRUNK_M, _GIRTH_M = 0.35, 0.15, 0.12
"""How far the person reaches beyond known sites: any, those of the trunk, the bones of arms and legs."""
_TRUNK = {"l_shoulder", "r_shoulder", "l_hip", "r_hip"}
_LIMBS = tuple(
    (f"{side}_{first}", f"{side}_{middle}", f"{side}_{last}", share)
    for side in "lr"
    for first, middle, last, share in (
        ("shoulder", "elbow", "wrist", 0.332),
        ("shoulder", "elbow", "hand", 0.377),
        ("hip", "knee", "ankle", 0.491),
    )
)
"""Joints of arms and legs, and their length as a share of the stature (Winter, fig. 4.1)."""
_BEFORE = (0.04, 0.012)
"""What stands before the scene is nearer by this: metres, and share of the depth (three deviations of a structured-light camera
at 4 m)."""
_SPECK_PX = 30


class StillScene:
    """How far a depth camera that stands still sees without the person: in each pixel what it saw farthest away."""

    def __init__(self, images: Sequence[DepthImage]) -> None:
        """Learn the scene from images spread over a recording, some tens.

        Raises:
            MeasurementError: no image, or images of different sizes.
        """
        if not images or len({image.image.shape for image in images}) != 1:
            raise MeasurementError(f"images: expected some of one size, found {len(images)}")
        depths = np.sort(np.stack([metres(image) for image in images]), axis=0)  # NaN comes last
        last = np.isfinite(depths).sum(axis=0)[None] - 1
        # The farthest but one, since one alone may be an error; then the middle of what lies as deep.
        deep = np.take_along_axis(depths, np.maximum(last - 1, 0), axis=0)
        with np.errstate(invalid="ignore"):
            first = (depths < _nearest_of(deep)).sum(axis=0)[None]
        self._depth = np.take_along_axis(depths, np.maximum((first + last) // 2, 0), axis=0)[0]

    def before(self, z: FloatArray) -> Mask:
        """Where depths (height, width) [m] lie before the scene.

        Raises:
            MeasurementError: another size.
        """
        if z.shape != self._depth.shape:
            raise MeasurementError(f"depth: expected shape {self._depth.shape} as learnt, found {z.shape}")
        with np.errstate(invalid="ignore"):
            return np.asarray(z < _nearest_of(self._depth), dtype=bool)


def from_depth(
    depth: DepthImage, known: Mapping[str, FloatArray], *, scene: StillScene | None = None, level: bool = True
) -> Mask:
    """The person in a depth image: all that hangs together in depth with a known site.

    With a scene also what stands before it within 0.6 m of a known site, so that a leg behind the other one is not lost; and
    nothing of the scene farther from all of them, if the person touches it.

    Args:
        depth: the image.
        known: positions (3,) [m] of sites of the person in the root frame; none of the others is used.
        scene: the still scene behind the person.
        level: z is up and 0 on the floor in the root frame: what is lower than 5 cm is floor.

    Returns:
        (height, width); all false when no known site is seen.

    Raises:
        MeasurementError: a position is not three finite numbers, or the scene has another size.
    """
    height, width = depth.image.shape
    places = {site: _place(site, position) for site, position in known.items()}
    points, valid = depth_points(depth)
    solid = valid & (points[:, 2] > _FLOOR_M) if level else valid
    z = np.where(solid.reshape(height, width), metres(depth), np.nan)
    view = CameraView(depth.camera, depth.root_from_sensor)
    seeds = []
    for place in places.values():
        pixel, distance = view.project(place[None])
        if not np.isfinite(pixel).all():
            continue
        u, v = np.rint(pixel[0]).astype(int)
        if 0 <= u < width and 0 <= v < height and distance[0] - _IN_FRONT_M <= z[v, u] <= distance[0] + _BEHIND_M:
            seeds.append((int(u), int(v)))
    mask = _connected(z, seeds)
    if scene is not None and seeds:
        before = scene.before(z)
        near = np.zeros(len(points), dtype=bool)
        for place in places.values():
            with np.errstate(invalid="ignore"):
                near |= np.square(points - place).sum(axis=1) < _REACH_M**2
        close = near.reshape(height, width)
        mask = (mask & (before | close)) | (before & close)
    return filled(without_specks(mask & np.isfinite(z), smallest=_SPECK_PX))


def without_specks(mask: Mask, *, smallest: int) -> Mask:
    """A mask without pieces of fewer pixels than `smallest`."""
    _, labels, stats, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=8)
    large = stats[:, cv2.CC_STAT_AREA] >= smallest
    large[0] = False  # label 0 is the background
    return np.asarray(large[labels], dtype=bool)


def surroundings(
    known: Mapping[str, FloatArray], camera: Camera, root_from_sensor: FloatArray, *, height: float = 1.75
) -> Mask:
    """Where in a picture (height, width) the person may be, as far as known sites tell.

    Arms and legs with both ends known are segments, widened by as much as they can be bent and by their girth, or two segments
    of their girth if elbow or knee are known, too; all else is the hull of the known sites, widened by 15 cm if shoulders and
    hips are among them, else by 35 cm.

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
    places = {site: _place(site, position) for site, position in known.items()}
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
    for first, middle, last, share in _LIMBS:
        if first in ends and middle in ends and last in ends:
            widened([first, middle], _GIRTH_M)
            widened([middle, last], _GIRTH_M)
            rest -= {middle, last}
        elif first in ends and last in ends:
            straight = float(np.linalg.norm(places[first] - places[last]))
            bend = 0.5 * float(np.sqrt(max((share * height) ** 2 - straight**2, 0.0)))
            widened([first, last], bend + _GIRTH_M)
            rest.discard(last)
    if rest:
        widened(sorted(rest), _TRUNK_M if rest >= _TRUNK else _BESIDE_M)
    return np.asarray(mask != 0, dtype=bool)


def filled(mask: Mask, *, hole: int = 40) -> Mask:
    """A mask without cracks and without holes of up to `hole` pixels: sensors leave out single pixels, and a distance
    transform takes each of them for background."""
    closed = cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((3, 3), dtype=np.uint8))
    _, labels, stats, _ = cv2.connectedComponentsWithStats(1 - closed, connectivity=4)
    small = stats[:, cv2.CC_STAT_AREA] <= hole
    return np.asarray((closed != 0) | small[labels], dtype=bool)


def _nearest_of(scene: FloatArray) -> FloatArray:
    """Depths [m] from which on a return belongs to a scene at depths [m]."""
    return np.asarray(scene - _BEFORE[0] - _BEFORE[1] * scene)


def metres(depth: DepthImage) -> FloatArray:
    """Depths (height, width) [m], NaN where nothing returned."""
    z = depth.image.astype(np.float64) * depth.metres_per_unit
    return np.asarray(np.where(z > 0.0, z, np.nan))


def _place(site: str, position: npt.ArrayLike) -> FloatArray:
    place = np.asarray(position, dtype=np.float64).reshape(-1)
    if place.shape != (3,) or not np.isfinite(place).all():
        raise MeasurementError(f"known[{site}]: expected three finite numbers, found {position!r}")
    return place


def _connected(z: FloatArray, seeds: Sequence[tuple[int, int]]) -> Mask:
    """All (height, width) that hangs together with the pixels (u, v) of the seeds in depths (height, width) [m]."""
    height, width = z.shape
    # A share of the depth is a difference of its logarithm.
    logarithm = np.log(np.where(np.isfinite(z), z, 1.0)).astype(np.float32)
    reached = np.zeros((height + 2, width + 2), dtype=np.uint8)
    reached[1:-1, 1:-1] = ~np.isfinite(z)
    step = float(np.log1p(_STEP))
    for u, v in seeds:
        if reached[v + 1, u + 1] == 0:
            flags = 4 | (2 << 8) | cv2.FLOODFILL_MASK_ONLY
            cv2.floodFill(logarithm, reached, (u, v), 0.0, loDiff=(step,), upDiff=(step,), flags=flags)
    return np.asarray(reached[1:-1, 1:-1] == 2, dtype=bool)
