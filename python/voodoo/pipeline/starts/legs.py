"""A first pose from a planar laser: two moving objects of the size of a leg; and the body of two legs that is tracked with it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import combinations, permutations, product
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

import voodoo._core as _core
from voodoo._core import TaperedEllipticCylinder
from voodoo.errors import BodyError, naming
from voodoo.measurements import FloatArray, LaserScan
from voodoo.model.at_rest import proportion, sites_at_rest
from voodoo.model.body import STATURE_M, Body, Joint, Place
from voodoo.model.projection import transform
from voodoo.pipeline.starts.base import FoundStart, StartFinder, StartFrame
from voodoo.sensors.settings import Box, within_boxes

SITES = ("l_hip", "r_hip", "l_ankle", "r_ankle")
_GAP_M = 0.10
"""Neighboring returns farther apart than this belong to two objects."""
_WIDTH_M = (0.04, 0.28)
"""Widths from a child's shin, half of which is visible, to wide trousers; the center of a leg is half a shin behind its
surface."""
_SHIN_RADIUS_M = 0.05
_APART_M = (0.08, 0.70)
"""Distance of the centers of two legs, from standing to a long step."""
_COME = 0.6
"""Fraction of a leg that must be in formerly free space: its rim may share a cell with another object."""
_FASTEST = 2.5
"""Speed of the swinging shin of a walking person [m/s]."""
_PATIENCE_S = 0.6
"""One leg may occlude the other for this time [s]."""
_SHIN_HEIGHT_M = 0.30
"""Height of the laser above an unknown floor."""
_MOVED_M = 0.05
"""A pair that moved less gives no evidence for its facing direction."""
_SIGMA_M = 0.10
_LEVEL = 0.97
"""Cosine of the largest tilt at which a laser plane intersects the shins."""


class LegsStart(StartFinder):
    """Finds two legs that have moved into free space, in two consecutive scans; of several persons it selects the nearest.

    An object in formerly free space has moved there and is not furniture. A person who has not moved since the first scan
    cannot be distinguished from furniture.

    Works only for bodies that consist of legs (see `legs_body`): a laser does not determine the posture of a whole
    person. The root frame must be fixed to the floor, as odom is; in a frame that moves with the robot nobody is found.
    """

    name = "legs in a laser"

    def __init__(self) -> None:
        """Start without scans."""
        self._free: dict[str, FreeSpace] = {}
        # Of each laser: the offset of two of them is no motion.
        self._last: dict[str, tuple[float, list[FloatArray]]] = {}

    def find(self, frame: StartFrame) -> Sequence[FoundStart]:
        """See StartFinder."""
        if not serves(frame.body):
            return []
        for item in frame.measurements:
            if isinstance(item, LaserScan) and item.root_from_sensor[2, 2] >= _LEVEL:
                free = self._free.setdefault(item.sensor, FreeSpace())
                found = self._pair(item, _leg_middles(item, free, frame.settings.exclude))
                if found is not None:
                    return [_found(*found, item, frame)]
        return []

    def _pair(self, scan: LaserScan, middles: list[FloatArray]) -> tuple[FloatArray, FloatArray] | None:
        """Two legs (2, 2) [m] that were also in the previous scan, and their motion since (2,); the nearest to the laser."""
        before = self._last.get(scan.sensor)
        if len(middles) > 1:
            self._last[scan.sensor] = (scan.stamp, middles)
        if before is None or not 0.0 < scan.stamp - before[0] <= _PATIENCE_S:
            return None
        reach = _FASTEST * (scan.stamp - before[0])
        origin = scan.root_from_sensor[:2, 3]
        pairs = [
            (legs, (legs - earlier).mean(axis=0))
            for legs, earlier in product(
                map(np.array, combinations(middles, 2)), map(np.array, permutations(before[1], 2))
            )
            if _APART_M[0] <= float(np.linalg.norm(legs[0] - legs[1])) <= _APART_M[1]
            and float(np.linalg.norm(legs - earlier, axis=1).max()) <= reach
        ]
        return min(pairs, key=lambda pair: float(np.linalg.norm(pair[0].mean(axis=0) - origin)), default=None)


CELL_M, SIZE_M = 0.10, 40.0
"""Side of a cell, half the width of a leg; and side of the map, centered on the laser's first position."""
_LEAST_PASSES = 3
_FRACTION = 0.2
"""A cell that returned more than this fraction of the beams that reached it may be furniture, as may its neighbors."""
_ALL_NEW = 0.25
"""If more than this fraction of all returns is new, the map is invalid because the frame moves."""


class FreeSpace:
    """A grid map in the plane of one laser, in a static frame: returns from cells that were free before come from new objects."""

    def __init__(self) -> None:
        """Start with an empty map."""
        self._origin: FloatArray | None = None
        count = round(SIZE_M / CELL_M)
        self._passes = np.zeros((count, count), dtype=np.float32)
        self._hits = np.zeros((count, count), dtype=np.float32)

    def come(self, scan: LaserScan) -> npt.NDArray[np.bool_]:
        """Which valid returns (N,) of a scan lie in cells that beams passed before and that have seldom returned one.

        All are False if more than a quarter of them is new.
        """
        places = transform(scan.root_from_sensor, scan.points())[:, :2]
        if self._origin is None or not len(places):
            return np.zeros(len(places), dtype=bool)
        fraction = self._hits / np.maximum(self._passes + self._hits, 1.0)
        about = cv2.dilate(fraction, np.ones((3, 3), np.uint8))
        open_ = (self._passes >= _LEAST_PASSES) & (about < _FRACTION)
        cells, inside = self._cells(places)
        new = np.zeros(len(places), dtype=bool)
        new[inside] = open_[cells[:, 0], cells[:, 1]]
        return new & (new.mean() <= _ALL_NEW)

    def learn(self, scan: LaserScan) -> None:
        """Update the map with a scan; a laser that has left the map's inner half starts a new one."""
        origin = scan.root_from_sensor[:2, 3]
        if self._origin is None or np.abs(origin - self._origin).max() > SIZE_M / 4.0:
            self._origin = np.array(origin)
            self._passes[:], self._hits[:] = 0.0, 0.0
        places = transform(scan.root_from_sensor, scan.points())[:, :2]
        way = places - origin
        reach = np.linalg.norm(way, axis=1)
        steps = np.arange(CELL_M, min(float(reach.max(initial=0.0)), SIZE_M), CELL_M)
        # A beam passes the cells before its own.
        passed = (steps[None] < reach[:, None] - CELL_M)[..., None]
        along = origin + (way / np.maximum(reach, CELL_M)[:, None])[:, None] * steps[None, :, None]
        for grid, where in ((self._passes, along[passed[..., 0]]), (self._hits, places)):
            cells, _ = self._cells(where)
            observed = np.zeros(grid.shape, dtype=bool)
            observed[cells[:, 0], cells[:, 1]] = True
            grid += observed

    def _cells(self, places: FloatArray) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.bool_]]:
        """Rows and columns (M, 2) of the positions (N, 2) within the map, and which these are (N,)."""
        origin = np.zeros(2) if self._origin is None else self._origin
        cells = np.floor((places - origin + SIZE_M / 2.0) / CELL_M).astype(np.intp)
        inside = np.asarray(((cells >= 0) & (cells < len(self._passes))).all(axis=1))
        return cells[inside], inside


def serves(body: Body) -> bool:
    """Whether a body consists of legs, which a laser can find."""
    return set(SITES) <= set(body.site_names) and "l_shoulder" not in body.site_names


def _leg_middles(scan: LaserScan, free: FreeSpace, exclude: Sequence[Box]) -> list[FloatArray]:
    """Centers (2,) [m], in the root frame, of leg-sized objects in formerly free space; updates the map with the scan."""
    points = scan.points()
    come = free.come(scan) & ~within_boxes(transform(scan.root_from_sensor, points), exclude)
    free.learn(scan)
    if len(points) < 2:
        return []
    cuts = np.flatnonzero(np.linalg.norm(np.diff(points[:, :2], axis=0), axis=1) > _GAP_M) + 1
    middles = []
    for part, new in zip(np.split(points, cuts), np.split(come, cuts), strict=True):
        beam = abs(scan.angle_increment) * float(np.linalg.norm(part[0]))
        width = float(np.linalg.norm(part[-1] - part[0])) + beam
        if len(part) >= 2 and _WIDTH_M[0] <= width <= _WIDTH_M[1] and new.mean() >= _COME:
            middle = part.mean(axis=0)
            middle *= 1.0 + _SHIN_RADIUS_M / max(float(np.linalg.norm(middle)), _SHIN_RADIUS_M)
            middles.append(transform(scan.root_from_sensor, middle[None])[0, :2])
    return middles


def _found(legs: FloatArray, moved: FloatArray, scan: LaserScan, frame: StartFrame) -> FoundStart:
    """Legs below the center of the pair; they face perpendicular to their connecting line, in the walking direction."""
    between = legs[1] - legs[0]
    middle = legs.mean(axis=0)
    ahead = np.array([-between[1], between[0]])
    if float(np.linalg.norm(moved)) > _MOVED_M:
        ahead = moved
    ahead = ahead / np.linalg.norm(ahead)
    left = np.array([-ahead[1], ahead[0]])
    height = float(scan.root_from_sensor[2, 3])
    ground = frame.settings.ground_z
    floor = height - _SHIN_HEIGHT_M if ground is None else ground
    # The start also sets the body's sizes: they stay those of the stature that is known.
    at_rest = sites_at_rest(frame.body)
    stature = float(np.linalg.norm(at_rest["l_ankle"] - at_rest["l_hip"])) / _leg()
    joints: dict[str, FloatArray] = {}
    for side, sign, leg in zip("lr", (1.0, -1.0), sorted(legs, key=lambda leg: -float(leg @ left)), strict=True):
        hip = np.array([*(middle + sign * _half_width() * stature * left), floor + _HIP * stature])
        shin = np.array([*leg, height])
        joints[f"{side}_hip"] = hip
        joints[f"{side}_ankle"] = hip + (shin - hip) / np.linalg.norm(shin - hip) * _leg() * stature
    return FoundStart(joints, dict.fromkeys(joints, _SIGMA_M), LegsStart.name)


def _leg() -> float:
    """Length of a leg, as a fraction of the stature."""
    return proportion("l_hip", "l_knee", "l_ankle")


def _half_width() -> float:
    """Half the distance of the hips, as a fraction of the stature."""
    return 0.5 * proportion("l_hip", "r_hip")


_HIP = 0.530
"""Height of the hips above the floor, as a fraction of the stature."""
_GIRTH = (0.075, 0.05)
"""Radii at hip and ankle [m], in trousers."""


def legs_body(height: float = STATURE_M) -> Body:
    """Two legs on a pelvis, without knees, as observed by a planar laser.

    Args:
        height: stature of the person [m].

    Raises:
        BodyError: the stature gives no valid body.
    """
    thick, thin = _GIRTH
    length = _leg() * height
    with naming(f"legs of a stature of {height} m", BodyError):
        shape = TaperedEllipticCylinder(length, thick, thick, thin, thin)
    limbs: list[Any] = [("pelvis", None, TaperedEllipticCylinder(0.10, 0.03, 0.03, 0.03, 0.03), None, (False, False))]
    sites = []
    beside = _half_width() * height
    for side, y in (("l", beside), ("r", -beside)):
        hip = Joint(name=f"{side}_hip", on_parent=Place(position=(0.0, y, 0.0), rotation=(math.pi, 0.0, 0.0)))
        limbs.append((f"{side}_leg", "pelvis", shape, hip.parts(), (False, False)))
        sites += [(f"{side}_{name}", f"{side}_leg", (0.0, 0.0, z)) for name, z in (("hip", 0.0), ("ankle", length))]
    return Body(_core.Body("standing legs", limbs, sites))
