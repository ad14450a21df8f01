"""The floor that depth images of a recording show."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import islice

import numpy as np

from voodoo._core import Detector, Frame
from voodoo.detectors.base import Detection
from voodoo.errors import VoodooError
from voodoo.measurements import DepthImage, FloatArray, RecordedFrame
from voodoo.recordings.recording import Recording

_FRAMES, EVERY = 60, 6
"""How many frames at the start, and which of them, are searched."""
_ON_FLOOR_M = 0.3
"""An ankle at most this high stands on the floor that is seen; a plane elsewhere is a table."""
_ALIKE = 0.995
"""Least cosine between the normals of one floor (6 degrees); where they differ more, the root frame moves on the floor."""


def detections(
    detector: Detector, recorded: RecordedFrame, *, up: tuple[float, float, float] | None = None
) -> Sequence[Detection]:
    """The persons that the detector sees in the depth images of a frame.

    Raises:
        VoodooError: an image is damaged.
    """
    images = [item for item in recorded.measurements if isinstance(item, DepthImage)]
    frame = Frame(stamp=recorded.stamp)
    for item in images:
        how = {"meters_per_unit": item.meters_per_unit, "world_from_sensor": item.root_from_sensor}
        frame.add_depth(item.image, camera=item.camera, source=item.sensor, **how)  # type: ignore[arg-type]
    return detector.detect(frame, up=up) if images else ()


class FloorSight:
    """Looks for the floor under the persons that the detector sees in depth images.

    Args:
        up: direction upwards in the root frame; None: unknown.

    Attributes:
        planes: the floors that were seen.
    """

    def __init__(self, *, up: tuple[float, float, float] | None = None) -> None:
        """Nothing is seen yet."""
        self._detector, self._up = Detector(), up
        self.planes: list[tuple[float, ...]] = []

    def observe(self, recorded: RecordedFrame) -> None:
        """Search a frame.

        Raises:
            VoodooError: an image is damaged.
        """
        for found in detections(self._detector, recorded, up=self._up):
            low = [found.joints[name] for name in ("l_ankle", "r_ankle") if name in found.joints]
            if found.floor is not None and low:
                normal, height = np.asarray(found.floor[0]), found.floor[1]
                if abs(min(float(normal @ ankle) for ankle in low) - height) < _ON_FLOOR_M:
                    self.planes.append((*normal, height))

    @property
    def floor(self) -> tuple[FloatArray, float] | None:
        """Unit normal upwards (3,) and height along it [m]; None if no floor was seen, or not always the same."""
        if not self.planes:
            return None
        middle = np.median(self.planes, axis=0)
        normal, height = middle[:3] / np.linalg.norm(middle[:3]), float(middle[3])
        alike = np.asarray(self.planes)[:, :3] @ normal >= _ALIKE
        return (normal, height) if alike.mean() > 0.5 else None


def visible_floor(recording: Recording) -> tuple[FloatArray, float] | None:
    """The floor that a recording shows in its first seconds, in the root frame; see `FloorSight`."""
    sight = FloorSight(up=None if recording.info().camera_root else (0.0, 0.0, 1.0))
    try:
        for recorded in islice(recording, 0, _FRAMES, EVERY):
            sight.observe(recorded)
    except VoodooError:
        pass  # tracking reports damage; what was seen before it counts
    return sight.floor
