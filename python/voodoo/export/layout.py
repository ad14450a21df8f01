"""Everything that files and live outputs tell of a person, as one row of numbers."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TypeAlias

import numpy as np

import voodoo._core as _core
from voodoo.export.human_frames import angle_plan, frame_plan
from voodoo.export.skeleton import check_limbs, own_joints
from voodoo.export.track import Track
from voodoo.measurements import FloatArray
from voodoo.model.body import Body
from voodoo.model.rotations import matrix_of_turn

FoxgloveAbout: TypeAlias = tuple[tuple[str, ...], tuple[int, ...], tuple[str, ...], int, int]
"""Of a person names and parents of frames, names of limbs, number of joints and sites, and of all given numbers."""
_TURN = np.pi / 2.0
"""At rest our arms hang; those of a VRM avatar point to the sides, a quarter turn about the forward axis."""
_ARM = ("upperarm", "forearm", "hand")
_Limbs = tuple[tuple[str, int | None], ...]


@dataclass(frozen=True, eq=False)
class Layout:
    """What a row is made of for bodies with the same names.

    Args:
        core: makes the rows, and says what is in them.
        joints: names of joints and sites.
        limbs: see `Body.limb_tree`.
        angles: names of the angles.
        shapes: what Foxglove shows: the beginning of a row.
        widths: how many numbers each part of a row has.
        text: columns of joints and bones.
    """

    core: _core.Layout
    joints: tuple[str, ...]
    limbs: _Limbs
    angles: tuple[str, ...]
    shapes: FoxgloveAbout
    widths: tuple[int, ...]
    text: slice

    def parts(self, rows: FloatArray) -> tuple[FloatArray, ...]:
        """Frames (P, N, 7), cylinders, joints, bones, angles (P, A), covariances (P, 36), and limbs of an avatar (P, L, 7)."""
        frames, *others, avatar = np.split(rows.reshape(-1, sum(self.widths)), np.cumsum(self.widths)[:-1], axis=1)
        return frames.reshape(len(frames), -1, 7), *others, avatar.reshape(len(avatar), -1, 7)


@lru_cache(maxsize=64)
def layout_of(joints: tuple[str, ...], limbs: _Limbs, limb_joints: tuple[str | None, ...]) -> Layout:
    """The layout for names of joints and sites, `Body.limb_tree` and `Body.limb_joints`."""
    limb_names = tuple(limb for limb, _ in limbs)
    (names, parents, frames), (angles, turns) = frame_plan(joints, limbs), angle_plan(limb_names)
    quarter = {"l": matrix_of_turn((-_TURN, 0.0, 0.0)), "r": matrix_of_turn((_TURN, 0.0, 0.0))}
    arms = [quarter.get(limb[0], np.eye(3)) if limb.partition("_")[2] in _ARM else np.eye(3) for limb in limb_names]
    tree = np.array([(index, index, index, -1 if up is None else up) for index, (_, up) in enumerate(limbs)])
    core = _core.Layout(own_joints(limb_joints, joints), frames, turns, np.array([arms]), tree)
    widths = 7 * len(names), 12 * len(limbs), 3 * len(joints), 7 * len(limbs), len(angles), 36, 7 * len(limbs)
    shapes = names, parents, limb_names, len(joints), sum(widths)
    return Layout(core, joints, limbs, angles, shapes, widths, slice(sum(widths[:2]), sum(widths[:4])))


def rows_of(track: Track, body: Body) -> tuple[Layout, FloatArray]:
    """The layout of a track, and the rows of its frames, all of which have a pose.

    Raises:
        VoodooError: the track has no limb poses (it was read from a .csv), or is of another body.
    """
    check_limbs(track, body)
    layout = layout_of(track.joint_names, body.limb_tree, body.limb_joints)
    given = track.world_from_limb, track.joints, track.root_covariance
    poses, joints, covariances = (np.ascontiguousarray(one, dtype=np.float64) for one in given)
    return layout, layout.core.rows_of_frames(body.core, poses, joints, covariances)
