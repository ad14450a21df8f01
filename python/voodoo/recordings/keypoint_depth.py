"""Whether keypoints lie on a person in the depth images beside them, and if not, the likely reason."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from voodoo.errors import RecordingError
from voodoo.measurements import DepthImage, FloatArray, KeypointImage
from voodoo.recordings.keypoint_check import Change, readings
from voodoo.recordings.keypoint_layouts import LIMBS, layout_of

_OFF, _ON = 0.5, 0.75
"""Share of limbs that stand out: below the first the keypoints may not lie on a person, above the second they do. It is 0.9 of a
person in a room, 0.2 and less of keypoints on walls and furniture; also of who lies on a sofa, hence the second number."""
_FEWEST = 20
"""Limbs that a judgment needs."""
_BESIDE_M, _FARTHER_M = 0.3, 0.15
"""Beside a limb by the first, at least on one side, the surface is farther than the limb by the second."""
_CELL = 8
"""Width of the cells in which the nearest depth is kept [px]."""
_FARTHEST_PX = 1e6
"""Pixels beyond, which damaged files have, are in no picture."""
_CONFIDENT = 0.3
_MOST = 8


def check_on_depth(where: object, pairs: Sequence[tuple[KeypointImage, DepthImage]]) -> None:
    """Compare keypoints with the depth they lie on.

    Args:
        where: named in errors.
        pairs: keypoint images with a depth image of about the same time; some are used.

    Raises:
        RecordingError: limbs do not stand out from what is behind them, but would with another reading of the keypoints, which
            is named.
    """
    pairs = [pair for pair in pairs if pair[0].people]
    views = [(image, _nearest(image, depth)) for image, depth in pairs[:: max(len(pairs) // _MOST, 1)][:_MOST]]
    found = _standing_out(views, lambda at, _: at)
    if found is None or found >= _OFF:
        return
    tried = [(_standing_out(views, change) or 0.0, words) for words, change in readings(views[0][0].camera)]
    share, words = max(tried, key=lambda each: each[0])
    if share >= _ON:
        raise RecordingError(
            f"{where}: expected keypoints on a person in the depth images, found {found:.0%} of the limbs before what is behind "
            f"them; {words}: then {share:.0%} are"
        )


def _standing_out(views: Sequence[tuple[KeypointImage, FloatArray]], change: Change) -> float | None:
    """Share of the limbs whose middle is nearer than the surface on one of their sides; None: too few limbs."""
    near, count = 0, 0
    for image, nearest in views:
        at = {part.site: next(iter(part.weights)) for part in layout_of(image.layout).parts}
        ends = np.array([(at[above], at[below]) for above, below in LIMBS if above in at and below in at])
        for rows in image.people:
            pixels = np.clip(rows[:, :2], -_FARTHEST_PX, _FARTHEST_PX)
            pixels = change(pixels, (image.camera.width, image.camera.height))
            a, b = pixels[ends[(rows[ends, 2] >= _CONFIDENT).all(axis=1)]].transpose(1, 0, 2)
            middle, along = (a + b) / 2.0, b - a
            across = np.column_stack([-along[:, 1], along[:, 0]]) / np.maximum(np.hypot(*along.T), 1e-9)[:, None]
            depth = _at(nearest, middle)
            seen = np.isfinite(depth)
            aside = np.where(seen, image.camera.fx * _BESIDE_M / np.where(seen, depth, 1.0), 0.0)[:, None] * across
            behind = np.maximum(_at(nearest, middle + aside), _at(nearest, middle - aside))
            near += int((seen & (behind > np.where(seen, depth, 0.0) + _FARTHER_M)).sum())
            count += len(a)
    return near / count if count >= _FEWEST else None


def _nearest(image: KeypointImage, depth: DepthImage) -> FloatArray:
    """The nearest depth [m] in cells of the keypoints' picture; infinite where nothing is seen."""
    z = depth.image.astype(np.float64) * depth.meters_per_unit
    rays = depth.camera.rays().astype(np.float64)
    valid = np.isfinite(z) & (z > 0.0) & np.isfinite(rays).all(axis=2)
    points = np.column_stack([rays[valid] * z[valid][:, None], z[valid]])
    pose = np.linalg.inv(image.root_from_sensor) @ depth.root_from_sensor
    points = points @ pose[:3, :3].T + pose[:3, 3]
    cells = np.floor(image.camera.project(points) / _CELL)
    shape = np.array([image.camera.width, image.camera.height]) // _CELL + 1
    inside = (np.isfinite(cells) & (cells >= 0) & (cells < shape)).all(axis=1)
    nearest = np.full(shape[::-1], np.inf)
    u, v = cells[inside].astype(int).T
    np.minimum.at(nearest, (v, u), points[inside, 2])
    return nearest


def _at(nearest: FloatArray, pixels: FloatArray) -> FloatArray:
    u, v = np.floor(pixels / _CELL).astype(int).T
    inside = (u >= 0) & (v >= 0) & (v < nearest.shape[0]) & (u < nearest.shape[1])
    return np.where(inside, nearest[np.where(inside, v, 0), np.where(inside, u, 0)], np.inf)
