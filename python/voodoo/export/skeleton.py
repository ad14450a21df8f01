"""A track as a skeleton whose bones all point the same way when the body stands at rest.

Limb frames have z along the limb. Animation formats and robot descriptions use frames that agree at rest: x forward,
y to the left, z up (REP-103). Their orientation is `world_from_limb` times the inverse of the limb's orientation at
rest.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
import numpy.typing as npt

import voodoo._core as _core
from voodoo.errors import VoodooError
from voodoo.export.track import Track
from voodoo.measurements import FloatArray, usual_interval
from voodoo.model.at_rest import limbs_at_rest
from voodoo.model.body import Body
from voodoo.model.rotations import quaternions

SAME_M = 1e-4
"""Lengths that differ by less are the same: numbers of files have this precision."""


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
    _, limbs, _ = body.core.parts()
    parents = [above for _, above in body.limb_tree]
    at_rest = zip(limbs, parents, *limbs_at_rest(body), body.core.at_rest()[1], strict=True)
    for (name, _, shape, joint, _), above, turn, origin, place in at_rest:
        tip = turn @ np.array([0.0, 0.0, shape.length]) + origin
        result.append(Bone(name, above, joint[0] if joint else name, turn @ place + origin, tip, turn, place))
    return tuple(result)


@dataclass(frozen=True, eq=False)
class Skeleton:
    """A track on its bones: F frames, L bones.

    Args:
        body: whose bones they are.
        stamps: (F,) [s].
        rotations: (F, L, 3, 3) world_from_bone: the identity when the body stands at rest and looks along x.
        heads: (F, L, 3) where each bone is joined to its parent [m]: the track's own joint of that name, else the place on the
            bone's side.

    Rotations and heads of searching frames are NaN.
    """

    body: Body
    stamps: FloatArray
    rotations: FloatArray
    heads: FloatArray

    @cached_property
    def bones(self) -> tuple[Bone, ...]:
        """The body at rest."""
        return bones(self.body)

    def of_frames(self, chosen: npt.NDArray[np.bool_] | npt.NDArray[np.intp]) -> Skeleton:
        """The skeleton of some frames: a mask (F,), or their numbers."""
        return Skeleton(self.body, self.stamps[chosen], self.rotations[chosen], self.heads[chosen])

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
    check_limbs(track, body)
    return skeleton_of(body, track.stamps, track.world_from_limb, track.joint_names, track.joints)


def check_limbs(track: Track, body: Body) -> None:
    """Check that a track has poses of the limbs of a body.

    Raises:
        VoodooError: it has none (it was read from a .csv), or those of another body.
    """
    if track.limb_names != body.limb_names:
        found = ", ".join(track.limb_names) or "none (a .csv has no limb poses; use .npz)"
        raise VoodooError(f"track: expected poses of the limbs {', '.join(body.limb_names)}, found {found}")


def skeleton_of(
    body: Body, stamps: FloatArray, poses: FloatArray, joint_names: tuple[str, ...], joints: FloatArray
) -> Skeleton:
    """The skeleton of F poses (F, L, 4, 4) with joints (F, J, 3) of a body."""
    poses, joints = (np.ascontiguousarray(one, dtype=np.float64) for one in (poses, joints))
    own = own_joints(body.limb_joints, joint_names)
    return Skeleton(body, stamps, *_core.skeleton(body.core, poses, joints, own))


@lru_cache(maxsize=64)
def own_joints(joints: tuple[str | None, ...], names: tuple[str, ...]) -> npt.NDArray[np.int64]:
    """Limbs whose joint to the parent has a position of its own, and the number of that."""
    own = [(index, names.index(joint)) for index, joint in enumerate(joints) if joint in names]
    return np.array(own, dtype=np.int64).reshape(-1, 2)


def held(posed: Skeleton, found: npt.NDArray[np.bool_]) -> Skeleton:
    """The skeleton without gaps, for formats that do not support gaps.

    A frame without a pose (not in `found` (F,)) gets that of the last frame that has one, the first ones that of the first
    such frame; where there is none at all the body stands at rest.
    """
    if not found.any():
        still = Skeleton(posed.body, posed.stamps, np.empty_like(posed.rotations), np.empty_like(posed.heads))
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
    moving = np.abs(known - still).max(axis=(0, 2)) > SAME_M
    places[:, 0], moving[0] = posed.heads[:, 0], True
    return places, still, moving


def ellipsoids(covariances: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Half-axes (N, 3) [m] and rotations x, y, z, w (N, 4) of the ellipsoids of one standard deviation of positions (N, 3, 3)."""
    variances, axes = np.linalg.eigh(covariances)
    axes[np.linalg.det(axes) < 0.0, :, 0] *= -1.0
    return np.sqrt(np.maximum(variances, 0.0)), quaternions(axes)


def mean_interval(stamps: FloatArray) -> float:
    """The usual interval, for formats with a constant rate.

    Raises:
        VoodooError: stamps that do not rise.
    """
    if (np.diff(stamps) <= 0.0).any():
        raise VoodooError("stamps: expected rising times, found others")
    return usual_interval(stamps)
