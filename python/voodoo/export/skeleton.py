"""A track as a skeleton whose bones all point the same way when the body stands at rest.

Limb frames have z along the limb. Animation formats and robot descriptions use frames that agree at rest: x forward,
y to the left, z up (REP-103). Their orientation is `world_from_limb` times the inverse of the limb's orientation at
rest.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from voodoo.errors import VoodooError
from voodoo.export.track import Track
from voodoo.model.body import Body
from voodoo.model.rotations import matrix_of_turn

FloatArray: TypeAlias = npt.NDArray[np.float64]
_MOVES_M = 1e-4


@dataclass(frozen=True, eq=False)
class Bone:
    """One limb at rest, in the standing frame (x forward, y left, z up, origin at the root limb's frame).

    Args:
        name: of the limb.
        parent: index of the parent bone, None for the root.
        joint: name of the joint to the parent, or of the limb for the root.
        head: (3,) where it is joined to its parent [m]; the origin of the limb's frame for the root.
        tip: (3,) middle of its distal end [m].
        rest: (3, 3) standing_from_limb orientation.
        head_in_limb: (3,) position of `head` in the limb frame [m].
    """

    name: str
    parent: int | None
    joint: str
    head: FloatArray
    tip: FloatArray
    rest: FloatArray
    head_in_limb: FloatArray


def bones(body: Body) -> tuple[Bone, ...]:
    """The bones of a body at rest, parents first."""
    result: list[Bone] = []
    shifts: list[FloatArray] = []
    _, limbs, _ = body.parts
    design = _design(body)
    for (name, _, shape, joint, _), (above, joint_name, *_), turn in zip(limbs, design, _at_rest(design), strict=True):
        place, shift = np.zeros(3), np.zeros(3)
        if above is not None:
            place = np.asarray(joint[2][0], dtype=np.float64)
            shift = result[above].rest @ np.asarray(joint[1][0]) + shifts[above] - turn @ place
        shifts.append(shift)
        tip = turn @ np.array([0.0, 0.0, shape.length]) + shift
        result.append(Bone(name, above, joint_name, turn @ place + shift, tip, turn, place))
    return tuple(result)


_Design: TypeAlias = tuple[tuple[int | None, str, tuple[float, ...], tuple[float, ...]], ...]


def _design(body: Body) -> _Design:
    """What stays while sizes are refined: of each limb the parent, the joint's name, and its axes on both sides."""
    _, limbs, _ = body.parts
    numbers = {limb[0]: index for index, limb in enumerate(limbs)}
    return tuple(
        (None, name, (), ())
        if joint is None or parent is None
        else (numbers[parent], joint[0], tuple(joint[1][1]), tuple(joint[2][1]))
        for name, parent, _, joint, _ in limbs
    )


@lru_cache(maxsize=64)
def _at_rest(design: _Design) -> FloatArray:
    """standing_from_limb orientations (L, 3, 3)."""
    turns: list[FloatArray] = []
    for above, _, on_parent, on_limb in design:
        turns.append(
            np.eye(3) if above is None else turns[above] @ matrix_of_turn(on_parent) @ matrix_of_turn(on_limb).T
        )
    result: FloatArray = np.array(turns)
    result.setflags(write=False)
    return result


@dataclass(frozen=True, eq=False)
class Skeleton:
    """A track on its bones: F frames, L bones.

    Args:
        bones: the body at rest.
        stamps: (F,) [s].
        rotations: (F, L, 3, 3) world_from_bone: the identity when the body stands at rest and looks along x.
        heads: (F, L, 3) where each bone is joined to its parent [m]: the track's own joint of that name, else the place on the
            bone's side.

    Rotations and heads of searching frames are NaN.
    """

    bones: tuple[Bone, ...]
    stamps: FloatArray
    rotations: FloatArray
    heads: FloatArray

    def of_frames(self, chosen: npt.NDArray[np.bool_] | npt.NDArray[np.intp]) -> Skeleton:
        """The skeleton of some frames: a mask (F,), or their numbers."""
        return Skeleton(self.bones, self.stamps[chosen], self.rotations[chosen], self.heads[chosen])

    def offsets(self) -> FloatArray:
        """(F, L, 3) where each bone is joined to its parent, in the parent bone's frame [m]; zero for the root."""
        result: FloatArray = np.zeros_like(self.heads)
        for index, bone in enumerate(self.bones):
            if bone.parent is not None:
                across = self.heads[:, index] - self.heads[:, bone.parent]
                result[:, index] = np.einsum("fij,fi->fj", self.rotations[:, bone.parent], across)
        return result

    def local(self) -> FloatArray:
        """(F, L, 3, 3) rotations relative to the parent; those of the root are relative to the world."""
        result: FloatArray = self.rotations.copy()
        for index, bone in enumerate(self.bones):
            if bone.parent is not None:
                result[:, index] = self.rotations[:, bone.parent].transpose(0, 2, 1) @ self.rotations[:, index]
        return result


def skeleton(track: Track, body: Body) -> Skeleton:
    """The track on the bones of `body`; its joints are those of the track, whatever sizes the body has had since.

    Raises:
        VoodooError: the track has no limb poses (it was read from a .csv), or is of another body.
    """
    if track.limb_names != body.limb_names:
        found = ", ".join(track.limb_names) or "none (a .csv has no limb poses; use .npz)"
        raise VoodooError(f"track: expected poses of the limbs {', '.join(body.limb_names)}, found {found}")
    plan = _plan(_design(body), track.joint_names)
    return _placed(bones(body), plan, track.stamps, track.world_from_limb, track.joints, [body])


def skeleton_of_people(
    bodies: Sequence[Body], stamps: FloatArray, poses: FloatArray, joint_names: tuple[str, ...], joints: FloatArray
) -> Skeleton:
    """As `skeleton`, of one instant: persons take the place of frames.

    Args:
        bodies: P of one design, each in its sizes.
        stamps: (P,) [s].
        poses: world_from_limb (P, L, 4, 4).
        joint_names: J names of joints and sites.
        joints: (P, J, 3) [m].

    Returns:
        The skeleton; its `bones` may be in the sizes of another body.
    """
    design = _design(bodies[0])
    if design not in _known:
        _known.clear()  # programs have one design
        _known[design] = bones(bodies[0])
    return _placed(_known[design], _plan(design, joint_names), stamps, poses, joints, bodies)


_known: dict[_Design, tuple[Bone, ...]] = {}
_Plan: TypeAlias = tuple[FloatArray, list[int], list[int], list[int]]


@lru_cache(maxsize=64)
def _plan(design: _Design, joint_names: tuple[str, ...]) -> _Plan:
    """limb_from_standing orientations at rest (L, 3, 3); limbs whose joint has a position of its own, and its number; limbs whose
    joint has none."""
    jointed = [(index, joint) for index, (above, joint, *_) in enumerate(design) if above is not None]
    seen = [(index, joint_names.index(joint)) for index, joint in jointed if joint in joint_names]
    other = [index for index, joint in jointed if joint not in joint_names]
    return _at_rest(design).transpose(0, 2, 1), [index for index, _ in seen], [site for _, site in seen], other


def _placed(
    parts: tuple[Bone, ...],
    plan: _Plan,
    stamps: FloatArray,
    poses: FloatArray,
    joints: FloatArray,
    bodies: Sequence[Body],
) -> Skeleton:
    back, seen, sites, other = plan
    turn, heads = poses[:, :, :3, :3], poses[:, :, :3, 3].copy()
    heads[:, seen] = joints[:, sites]
    if other:
        places = np.array([[body.parts[1][index][3][2][0] for index in other] for body in bodies])
        heads[:, other] += (turn[:, other] @ places[..., None])[..., 0]
    return Skeleton(parts, stamps, turn @ back, heads)


def held(posed: Skeleton, found: npt.NDArray[np.bool_]) -> Skeleton:
    """The skeleton without gaps, for formats that do not support gaps.

    A frame without a pose (not in `found` (F,)) gets that of the last frame that has one, the first ones that of the first
    such frame; where there is none at all the body stands at rest.
    """
    if not found.any():
        still = Skeleton(posed.bones, posed.stamps, np.empty_like(posed.rotations), np.empty_like(posed.heads))
        still.rotations[:] = np.eye(3)
        still.heads[:] = np.array([bone.head for bone in posed.bones])
        return still
    last = np.maximum.accumulate(np.where(found, np.arange(len(found)), -1))
    last[last < 0] = int(np.argmax(found))
    return replace(posed.of_frames(last), stamps=posed.stamps)


def placed_on_parents(
    posed: Skeleton, found: npt.NDArray[np.bool_]
) -> tuple[FloatArray, FloatArray, npt.NDArray[np.bool_]]:
    """Places of bones for formats with constant offsets, which may be animated.

    Args:
        posed: without gaps, see `held`.
        found: (F,) frames that have a pose; without any all frames count.

    Returns:
        Places (F, L, 3) [m] of each bone on its parent, of the root in the world; the median (L, 3); and (L,) which of them
        change by more than 0.1 mm, because lengths are refined while tracking. The root always does.
    """
    places = posed.offsets()
    known = places[found] if found.any() else places
    still = np.median(known, axis=0)
    moving = np.abs(known - still).max(axis=(0, 2)) > _MOVES_M
    places[:, 0], moving[0] = posed.heads[:, 0], True
    return places, still, moving


def mean_interval(stamps: FloatArray) -> float:
    """Time between two frames [s], for formats with a constant rate; 1/30 s for a single frame.

    Raises:
        VoodooError: stamps that do not rise.
    """
    if len(stamps) < 2:
        return 1.0 / 30.0
    steps = np.diff(stamps)
    if (steps <= 0.0).any():
        raise VoodooError("stamps: expected rising times, found others")
    return float(np.median(steps))
