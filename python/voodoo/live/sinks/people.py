"""The persons of a step, upright, for sinks: arrays that are made once for all of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from threading import Lock

import numpy as np

import voodoo._core as _core
from voodoo._core import Estimate
from voodoo.export.human_frames import HumanFrames, human_frames, joint_angles
from voodoo.export.skeleton import FloatArray, Skeleton, skeleton_of
from voodoo.export.upright import SUFFIX, Turn, by_axes
from voodoo.live.follow import Step
from voodoo.model.body import Body


@dataclass(frozen=True, eq=False)
class Shown:
    """Persons P of a step who have a pose: frame with z up of everything, and how the root frame was turned to it;
    numbers; estimates in the root frame; bodies; joints (P, J, 3) [m]; and limb poses (P, L, 4, 4)."""

    frame: str
    turn: Turn
    numbers: tuple[int, ...]
    estimates: Sequence[Estimate]
    bodies: Sequence[Body]
    joints: FloatArray
    limb_poses: FloatArray

    @cached_property
    def posed(self) -> Skeleton:
        """Their skeletons; persons are in the place of frames."""
        first = self.estimates[0]
        stamps = np.full(len(self.numbers), first.stamp)
        return skeleton_of(self.bodies, stamps, self.limb_poses, tuple(first.joint_names), self.joints)

    @cached_property
    def present(self) -> list[int]:
        """Indices of those who are not lost."""
        return [index for index, one in enumerate(self.estimates) if one.status != "lost"]

    @cached_property
    def frames(self) -> HumanFrames:
        """Their frames of REP-155."""
        return human_frames(tuple(self.estimates[0].joint_names), self.joints, self.posed)

    @cached_property
    def angles(self) -> tuple[tuple[str, ...], FloatArray]:
        """See joint_angles."""
        return joint_angles(self.posed)

    @cached_property
    def covariances(self) -> FloatArray:
        """Covariances (P, 6, 6) of the poses of their frames "body"; NaN where unknown."""
        found = np.array([one.root_covariance for one in self.estimates])
        if self.turn.words:
            turned = np.kron(np.eye(2), self.turn.pose[:3, :3])
            found = turned @ found @ turned.T
        return _core.moved_covariances(found, self.frames.places[:, 0] - self.limb_poses[:, 0, :3, 3])


_lock = Lock()
"""Sinks ask for the same step at the same time."""


def shown(step: Step, root_frame: str) -> Shown:
    """The persons of a step who have a pose."""
    with _lock:
        return _shown(step, root_frame)


@lru_cache(maxsize=2)
def _shown(step: Step, root_frame: str) -> Shown:
    turn = by_axes(root_frame) if step.turn is None else step.turn
    positions = {number: places for number, one in step.estimates.items() if len(places := one.joint_positions)}
    there = {number: step.estimates[number] for number in positions}
    joints = np.array(list(positions.values()))
    poses = np.array([one.limb_poses for one in there.values()])
    if there and turn.words:
        joints, poses = joints @ turn.pose[:3, :3].T + turn.pose[:3, 3], turn.pose @ poses
    bodies = [step.bodies[number] for number in there]
    frame = f"{root_frame}{SUFFIX}" if turn.words else root_frame
    return Shown(frame, turn, tuple(there), tuple(there.values()), bodies, joints, poses)
