"""Turns results upright whose root frame is a camera's, for formats that are read with z up."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from voodoo.export.track import FloatArray, Track
from voodoo.model.standing import is_optical, standing_along
from voodoo.sensors.settings import LEVEL_FRAMES

UPRIGHT_FROM_OPTICAL: FloatArray = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""Rotation from the axes of an optical frame (x right, y down, z forward) to those of REP-103 (x forward, y left, z up)."""
_HIGH_M = 1.5
"""Feet that are never below this height above z = 0 are not on a floor there; stairs and platforms are lower."""
SUFFIX = "_upright"
"""Ends the name of the frame with the origin of an optical frame and upright axes."""


def lying_words(track: Track, root_frame: str, *, optical: bool | None = None) -> str:
    """What speaks against a z axis that points up from the floor: a body along another axis, or far above it; "" if nothing."""
    turned, frame = upright(track, root_frame, optical=optical)
    along = standing_along(turned.joint_names, turned.joints)
    if along not in ("", "+Z"):
        frames = "are images stamped with an optical frame, and its transform right?"
        return f"the body stands along {along} of {frame}, whose z axis should point up; {frames}"
    feet = [index for index, name in enumerate(turned.joint_names) if name in ("l_ankle", "r_ankle")]
    heights = turned.joints[turned.found][:, feet, 2]
    if frame in LEVEL_FRAMES and heights.size and float(np.nanmin(heights)) > _HIGH_M:
        return f"the feet are {np.nanmin(heights):.1f} m and more above the floor, z = 0 of {frame}; are the transforms right?"
    return ""


def upright(track: Track, root_frame: str, *, optical: bool | None = None) -> tuple[Track, str]:
    """A track with z up, and the name of its root frame: with the axes turned if the root is an optical frame, else as it is.

    The camera is taken to be level: the track leans as the camera does.

    Args:
        track: in the root frame.
        root_frame: its name.
        optical: whether it is an optical frame; None: by its name.
    """
    if not (is_optical(root_frame) if optical is None else optical):
        return track, root_frame
    turn = UPRIGHT_FROM_OPTICAL
    limbs = track.world_from_limb.copy()
    limbs[..., :3, :] = turn @ limbs[..., :3, :]
    both = np.kron(np.eye(2), turn)
    turned = replace(
        track,
        joints=track.joints @ turn.T,
        world_from_limb=limbs,
        covariance=turn @ track.covariance @ turn.T,
        root_covariance=both @ track.root_covariance @ both.T,
    )
    return turned, f"{root_frame}{SUFFIX}"
