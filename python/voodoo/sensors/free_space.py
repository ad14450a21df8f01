"""A free-space map of a planar laser: returns from cells that were free before come from new objects, not from furniture."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from voodoo.measurements import FloatArray, LaserScan
from voodoo.model.projection import transform

CELL_M, SIZE_M = 0.10, 40.0
"""Side of a cell, half the width of a leg; and side of the map, centered on the laser's first position."""
_LEAST_PASSES = 3
_FRACTION = 0.2
"""A cell that returned more than this fraction of the beams that reached it may be furniture, as may its neighbors."""
_ALL_NEW = 0.25
"""If more than this fraction of all returns is new, the map is invalid because the frame moves."""


class FreeSpace:
    """A grid map in the plane of one laser, in a static frame."""

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
