"""The floor that depth images of a recording show, and who stands on it."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import nullcontext, suppress
from itertools import islice

import numpy as np

from voodoo._core import Detector, Frame
from voodoo.detectors.base import Detection
from voodoo.errors import VoodooError
from voodoo.measurements import DepthImage, FloatArray, RecordedFrame
from voodoo.recordings.left_out import LeftOut
from voodoo.recordings.recording import Recording
from voodoo.sensors.settings import LEVEL_FRAMES

_FRAMES, EVERY = 60, 6
"""How many frames at the start, and which of them, are searched."""
_ON_FLOOR_M = 0.3
"""An ankle at most this high stands on the floor that is seen; a plane elsewhere is a table."""
_ALIKE = 0.995
"""Least cosine between the normals of one floor (6 degrees); where they differ more, the root frame moves on the floor."""
_ENOUGH = 3
"""So many floors that are seen are enough to judge the poses of cameras."""
_SURE = 0.994
"""Confidence of a detection that is enough to start a track."""
_UP = (0.0, 0.0, 1.0)


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
        statures: of those who are surely persons [m].
    """

    def __init__(self, *, up: tuple[float, float, float] | None = None) -> None:
        """Nothing is seen yet."""
        self._detector, self._up = Detector(), up
        self.planes: list[tuple[float, ...]] = []
        self.statures: list[float] = []

    def observe(self, recorded: RecordedFrame) -> None:
        """Search a frame.

        Raises:
            VoodooError: an image is damaged.
        """
        for found in detections(self._detector, recorded, up=self._up):
            if found.confidence > _SURE:
                self.statures.append(found.stature)
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


def _look(
    recording: Recording,
    *,
    up: tuple[float, float, float] | None,
    left_out: LeftOut | None = None,
    enough: int = _FRAMES,
) -> FloorSight:
    """What a recording shows in its first seconds, until enough floors are seen; `left_out`: that of the recording, which does
    not count what is read."""
    sight = FloorSight(up=up)
    # Tracking reports damage; what was seen before it counts.
    with nullcontext() if left_out is None else left_out.aside(), suppress(VoodooError):
        for recorded in islice(recording, 0, _FRAMES, EVERY):
            sight.observe(recorded)
            if len(sight.planes) >= enough:
                break
    return sight


def visible_floor(recording: Recording, *, left_out: LeftOut | None = None) -> tuple[FloatArray, float] | None:
    """The floor that a recording shows in its first seconds, in the root frame; see `FloorSight` and `look`."""
    return _look(recording, up=None if recording.info().camera_root else _UP, left_out=left_out).floor


def look(recording: Recording, *, left_out: LeftOut | None = None) -> FloorSight:
    """Look for persons and floor in the first seconds of a recording, whatever the poses of its cameras are.

    Args:
        recording: is read from its start.
        left_out: that of the recording, which does not count what is read here.
    """
    if not recording.info().camera_root:
        sight = _look(recording, up=_UP, left_out=left_out, enough=_ENOUGH)
        if sight.planes:
            return sight
    return _look(recording, up=None, left_out=left_out, enough=_ENOUGH)  # upwards in the images


def floor_words(floor: tuple[FloatArray, float] | None, root_frame: str) -> str:
    """What a floor that is seen says against the poses of the cameras in a root frame with z up; "" if nothing."""
    if floor is None:
        return ""
    (*_, up), height = floor
    if up < _ALIKE:
        tilt = np.rad2deg(np.arccos(np.clip(up, -1.0, 1.0)))
        return (
            f"the floor that depth shows is tilted by {tilt:.0f} deg in {root_frame}, whose z axis should point up: is the pose "
            "of the camera right, or is it the inverse? (root_from_sensor of calibration.toml, transforms of a bag)"
        )
    if root_frame in LEVEL_FRAMES and abs(height) > _ON_FLOOR_M:
        side = "above" if height > 0.0 else "below"
        return (
            f"the floor that depth shows is {abs(height):.1f} m {side} z = 0 of {root_frame}, where it is expected: is the "
            "height of the camera right, and the unit of depth?"
        )
    return ""
