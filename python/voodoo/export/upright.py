"""Turns results upright whose root frame is a camera's, for formats that are read with z up."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from voodoo.export.track import Track
from voodoo.measurements import FloatArray
from voodoo.model.rotations import axes
from voodoo.model.standing import HIGH_M, is_optical, standing_along
from voodoo.model.transforms import pose_of
from voodoo.recordings.marker_trajectories import Z_UP_FROM
from voodoo.sensors.settings import LEVEL_FRAMES

UPRIGHT_FROM_OPTICAL = axes("z -x -y")
"""Rotation from the axes of an optical frame (x right, y down, z forward) to those of REP-103 (x forward, y left, z up)."""
_ANKLE_M = 0.08
"""Height of the ankle of a standing foot."""
_TURNED = {"-Y": "90 degrees clockwise", "+Y": "90 degrees counterclockwise", "-Z": "180 degrees"}
"""Axis along which a body stands that is seen by a level camera -> how its images are turned."""
SUFFIX = "_upright"
"""Ends the name of the frame with z up."""


class Turn(NamedTuple):
    """How a root frame is turned upright.

    Args:
        pose: upright_from_root, rigid (4, 4).
        words: what it goes by; "" if nothing is turned.
    """

    pose: FloatArray
    words: str


UNTURNED = Turn(np.eye(4), "")


def by_axes(root_frame: str, *, optical: bool | None = None) -> Turn:
    """A level camera's optical axes turned to those of REP-103; another root frame stays.

    Args:
        root_frame: its name.
        optical: whether it is an optical frame; None: by its name.
    """
    if not (is_optical(root_frame) if optical is None else optical):
        return UNTURNED
    return Turn(pose_of(UPRIGHT_FROM_OPTICAL), f"by the axes of {root_frame}, a camera's; it leans as the camera does")


def by_floor(floor: tuple[FloatArray, float], *, optical: bool) -> Turn:
    """The floor becomes z = 0, below the origin of the root frame; x is forward in an optical frame, else x of the root frame.

    Args:
        floor: unit normal (3,) upwards and height along it [m], in the root frame.
        optical: whether the root frame is an optical frame.
    """
    up = np.asarray(floor[0], dtype=np.float64)
    left = np.cross(up, (0.0, 0.0, 1.0) if optical else (1.0, 0.0, 0.0))
    left /= np.linalg.norm(left)
    pose = pose_of([np.cross(left, up), left, up], (0.0, 0.0, -floor[1]))
    return Turn(pose, "by the floor that is seen, now z = 0")


def by_feet(tracks: Sequence[Track], root_frame: str, *, optical: bool | None = None) -> Turn:
    """Without a floor that is seen: by the optical axes, and the axis along which bodies stand, with the feet on z = 0."""
    turn = by_axes(root_frame, optical=optical)
    tried = [upright(track, root_frame, turn) for track in tracks]
    standing = [(standing_along(track.joint_names, track.joints), frame) for track, frame in tried]
    axis, frame = next((found for found in standing if found[0]), ("+Z", root_frame))
    if axis != "+Z" or not turn.words:
        turn = Turn(pose_of(Z_UP_FROM[axis]) @ turn.pose, f"by {axis} of {frame}, along which the body stands")
    heights = [low for track in tracks for low in _ankles(turned(track, turn))]
    if heights:
        turn.pose[2, 3] += _ANKLE_M - float(np.median(heights))
    return Turn(turn.pose, f"{turn.words}; the feet are on z = 0")


def lying_words(track: Track, root_frame: str, turn: Turn | None = None) -> str:
    """What speaks against a z axis that points up from the floor: a body along another axis, or far above it; "" if nothing."""
    standing, frame = upright(track, root_frame, turn)
    along = standing_along(standing.joint_names, standing.joints)
    if along not in ("", "+Z"):
        causes = "are images turned, are they stamped with an optical frame, and is its transform right?"
        if along in _TURNED and frame != root_frame:
            causes = (
                f"are the images turned by {_TURNED[along]}? voodoo track --upright turns results; transforms, or "
                "root_from_sensor in a calibration.toml, say how a camera is mounted"
            )
        return f"the body stands along {along} of {frame}, whose z axis should point up; {causes}"
    low = _ankles(standing)
    if frame in LEVEL_FRAMES and low.size and float(np.min(low)) > HIGH_M:
        return f"the feet are {np.min(low):.1f} m and more above the floor, z = 0 of {frame}; are the transforms right?"
    return ""


def upright(track: Track, root_frame: str, turn: Turn | None = None) -> tuple[Track, str]:
    """A track with z up, and the name of its root frame: turned if the root is an optical frame, else as it is.

    Args:
        track: in the root frame.
        root_frame: its name.
        turn: how it is turned; None: `by_axes`.
    """
    turn = by_axes(root_frame) if turn is None else turn
    return (turned(track, turn), f"{root_frame}{SUFFIX}") if turn.words else (track, root_frame)


def turned(track: Track, turn: Turn) -> Track:
    """The track in the upright frame."""
    rotation, shift = turn.pose[:3, :3], turn.pose[:3, 3]
    both = np.kron(np.eye(2), rotation)
    return replace(
        track,
        joints=track.joints @ rotation.T + shift,
        world_from_limb=turn.pose @ track.world_from_limb,
        covariance=rotation @ track.covariance @ rotation.T,
        root_covariance=both @ track.root_covariance @ both.T,
    )


def _ankles(track: Track) -> FloatArray:
    """Height of the lower ankle in the frames that have one [m]."""
    feet = [index for index, name in enumerate(track.joint_names) if name in ("l_ankle", "r_ankle")]
    heights = track.joints[:, feet, 2]
    rows: FloatArray = heights[np.isfinite(heights).any(axis=1)]
    return np.nanmin(rows, axis=1) if rows.size else np.empty(0)
