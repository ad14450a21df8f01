"""The floor that depth images of a recording show."""

from __future__ import annotations

from itertools import islice

import numpy as np

from voodoo._core import Detector, Frame
from voodoo.errors import VoodooError
from voodoo.measurements import DepthImage, FloatArray
from voodoo.recordings.recording import Recording

_FRAMES, _EVERY = 60, 6
"""How many frames at the start, and which of them, are searched."""
_ON_FLOOR_M = 0.3
"""An ankle at most this high stands on the floor that is seen; a plane elsewhere is a table."""
_ALIKE = 0.995
"""Least cosine between the normals of one floor (6 degrees); where they differ more, the root frame moves on the floor."""


def seen_floor(recording: Recording) -> tuple[FloatArray, float] | None:
    """The floor under the persons that the detector sees in depth images: unit normal upwards (3,) and height along it [m], in
    the root frame; None if no floor is seen, or not always the same.
    """
    up = None if recording.info().camera_root else (0.0, 0.0, 1.0)
    detector, planes = Detector(), []
    try:
        for recorded in islice(recording, 0, _FRAMES, _EVERY):
            frame = Frame(stamp=recorded.stamp)
            for item in recorded.measurements:
                if isinstance(item, DepthImage):
                    how = {"meters_per_unit": item.meters_per_unit, "world_from_sensor": item.root_from_sensor}
                    frame.add_depth(item.image, camera=item.camera, source=item.sensor, **how)  # type: ignore[arg-type]
            if not any(isinstance(item, DepthImage) for item in recorded.measurements):
                continue
            for found in detector.detect(frame, up=up):
                low = [found.joints[name] for name in ("l_ankle", "r_ankle") if name in found.joints]
                if found.floor is not None and low:
                    normal, height = np.asarray(found.floor[0]), found.floor[1]
                    if abs(min(float(normal @ ankle) for ankle in low) - height) < _ON_FLOOR_M:
                        planes.append((*normal, height))
    except VoodooError:
        pass  # tracking reports damage; what was seen before it counts
    if not planes:
        return None
    middle = np.median(planes, axis=0)
    normal, height = middle[:3] / np.linalg.norm(middle[:3]), float(middle[3])
    alike = np.asarray(planes)[:, :3] @ normal >= _ALIKE
    return (normal, height) if alike.mean() > 0.5 else None
