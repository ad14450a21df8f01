"""First poses set by the user for a given time, and from an earlier result."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from voodoo.export.track import Track
from voodoo.measurements import ROUNDED_S, nearest_stamps, usual_interval
from voodoo.pipeline.starts.base import FoundStart, StartFinder, StartFrame, fixes_pose

_SAME_TIME_S = 0.02
"""Stamps that differ by less belong to one frame; at most half a period of the result."""
_GIVEN_SIGMA_M = 0.03
_USABLE = ("tracking", "degraded")


class GivenStart(StartFinder):
    """Joints in the first frame at or after a time.

    Args:
        joints: site name -> (x, y, z) [m], root frame.
        stamp: [s].
    """

    name = "given"
    given = True

    def __init__(self, joints: Mapping[str, Sequence[float]], stamp: float) -> None:
        """Store joints and stamp."""
        self._joints = {name: np.asarray(position, dtype=np.float64) for name, position in joints.items()}
        self._stamp = stamp

    def find(self, frame: StartFrame) -> Sequence[FoundStart]:
        """See StartFinder."""
        if frame.stamp < self._stamp - ROUNDED_S:
            return []
        return [FoundStart(self._joints, dict.fromkeys(self._joints, _GIVEN_SIGMA_M), self.name)]


class EarlierStart(StartFinder):
    """The pose of an earlier result in the first frame that has one.

    Args:
        result: of `voodoo track`, of this recording or of another of the same scene and clock.
    """

    name = "earlier result"
    given = True

    def __init__(self, result: Track) -> None:
        """Keep the reliable frames."""
        self._near = min(_SAME_TIME_S, 0.5 * usual_interval(result.stamps)) if len(result) > 1 else _SAME_TIME_S
        self._result = result.of_frames(np.array([word in _USABLE for word in result.status], dtype=bool))

    def find(self, frame: StartFrame) -> Sequence[FoundStart]:
        """See StartFinder."""
        result = self._result
        row = int(nearest_stamps(result.stamps, [frame.stamp], within=self._near)[0])
        if row < 0:
            return []
        pairs = zip(result.joint_names, result.joints[row], strict=True)
        joints = {name: position for name, position in pairs if name in frame.body.site_names}
        sigma = dict.fromkeys(joints, _GIVEN_SIGMA_M)
        return [FoundStart(joints, sigma, self.name)] if fixes_pose(joints, frame.body) else []
