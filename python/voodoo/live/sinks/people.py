"""The persons of a step, upright, for sinks: of each a row with all numbers that any sink tells, made once for all of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from itertools import compress
from typing import NamedTuple

import numpy as np

import voodoo._core as _core
from voodoo._core import Estimate
from voodoo.export.foxglove import FoxgloveAbout
from voodoo.export.human_frames import angle_plan, frame_plan
from voodoo.export.ros2 import person_id
from voodoo.export.skeleton import FloatArray, own_joints
from voodoo.export.upright import SUFFIX, Turn, by_axes
from voodoo.live.follow import Step
from voodoo.model.rotations import matrix_of_turn

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
def _layout(joints: tuple[str, ...], limbs: _Limbs, limb_joints: tuple[str | None, ...]) -> Layout:
    limb_names = tuple(limb for limb, _ in limbs)
    (names, parents, frames), (angles, turns) = frame_plan(joints, limbs), angle_plan(limb_names)
    quarter = {"l": matrix_of_turn((-_TURN, 0.0, 0.0)), "r": matrix_of_turn((_TURN, 0.0, 0.0))}
    arms = [quarter.get(limb[0], np.eye(3)) if limb.partition("_")[2] in _ARM else np.eye(3) for limb in limb_names]
    tree = np.array([(index, index, index, -1 if up is None else up) for index, (_, up) in enumerate(limbs)])
    core = _core.Layout(own_joints(limb_joints, joints), frames, turns, np.array([arms]), tree)
    widths = 7 * len(names), 12 * len(limbs), 3 * len(joints), 7 * len(limbs), len(angles), 36, 7 * len(limbs)
    shapes = names, parents, limb_names, len(joints), sum(widths)
    return Layout(core, joints, limbs, angles, shapes, widths, slice(sum(widths[:2]), sum(widths[:4])))


class Shown(NamedTuple):
    """Persons P of a step who have a pose.

    Attributes:
        frame: frame with z up of everything.
        turn: how the root frame was turned to it.
        estimates: number -> estimate in the root frame.
        layout: of their rows; None if there are no persons.
        rows: (P, ...).
        there: numbers of those who are not lost.
        ids: REP-155 ids of these.
        rows_there: rows of these.
        sure: whether the covariance of each of these is known.
    """

    frame: str
    turn: Turn
    estimates: Mapping[int, Estimate]
    layout: Layout | None
    rows: FloatArray
    there: tuple[int, ...] = ()
    ids: tuple[str, ...] = ()
    rows_there: FloatArray = np.empty((0, 0))
    sure: tuple[bool, ...] = ()


@lru_cache(maxsize=2)
def shown(step: Step, root_frame: str) -> Shown:
    """The persons of a step who have a pose."""
    turn = by_axes(root_frame) if step.turn is None else step.turn
    frame = f"{root_frame}{SUFFIX}" if turn.words else root_frame
    statuses = {number: one.status for number, one in step.estimates.items()}
    found = {number: step.estimates[number] for number, status in statuses.items() if status != "searching"}
    if not found:
        return Shown(frame, turn, found, None, np.empty((0, 0)))
    number, first = next(iter(found.items()))
    layout = _layout(first.joint_names, step.bodies[number].limb_tree, step.bodies[number].limb_joints)
    cores = [step.bodies[number].core for number in found]
    rows, known = layout.core.rows(list(found.values()), cores, turn.pose if turn.words else None)
    seen = [statuses[number] != "lost" for number in found]
    there, sure = tuple(compress(found, seen)), tuple(compress(known, seen))
    return Shown(
        frame, turn, found, layout, rows, there, tuple(map(person_id, there)), rows if all(seen) else rows[seen], sure
    )
