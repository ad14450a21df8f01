"""Joint angles in the convention of ROS4HRI's human_description (REP-155), from the rotations of the bones."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
import numpy.typing as npt

import voodoo._core as _core
from voodoo.export.skeleton import FloatArray, Skeleton

_TWIST, _HEAD, _SHOULDER, _HIP = (-1, -1, -1), (0, 2, 1), (2, 0, 2), (2, 0, 1)
"""Moving axes of Euler angles (x, y, z), or the twist about y."""


def joint_angles(posed: Skeleton) -> tuple[tuple[str, ...], FloatArray]:
    """Names of the joints that the body has, and their angles (F, N) [rad].

    Shoulder: R = Rz(-s y) Rx(s p) Rz(s r); hip: R = Rz(-y) Rx(s p) Ry(-r); head: R = Rx(r) Rz(y) Ry(-p), with s = 1
    on the left, -1 on the right, R = parent_from_child. Elbow and knee: the rotation about the axis -y; elbows flex to
    positive, knees to negative angles. The rest of their rotation is not in the angle (it is in /tf). The waist
    is 0: the torso is one limb.
    """
    names, plan = _plan(posed.body.limb_names)
    # Singular for a hanging arm; the third angle is then set to zero, which is one valid solution.
    return names, _core.joint_angles(posed.rotations, plan)


@lru_cache(maxsize=16)
def _plan(limbs: tuple[str, ...]) -> tuple[tuple[str, ...], npt.NDArray[np.int64]]:
    """Names of joints, and how their angles are found."""
    numbers, rows = {limb: number for number, limb in enumerate(limbs)}, turns_of(limbs)
    # On the right they are the other of the two solutions, so that abduction is positive on both sides.
    other = {"r_y_shoulder": 1, "r_p_shoulder": -1, "r_r_shoulder": 1}
    plan = [
        (numbers[above], numbers[limb], *axes, which, sign * other.get(name, 1), other.get(name, -1) > 0)
        for name, above, limb, axes, which, sign in rows
    ]
    return tuple(row[0] for row in rows), np.array(plan)


def turns_of(limbs: Sequence[str]) -> list[tuple[str, str, str, tuple[int, int, int], int, int]]:
    """The joints that limbs have: name, limb above, limb, its axes, which of their angles, and sign."""
    root = limbs[0]
    trunk = "thorax" if "thorax" in limbs else root
    rows = [("waist", root, trunk, _TWIST, 0, 1)]
    for axis, which, sign in (("r", 0, 1), ("y", 1, 1), ("p", 2, -1)):
        rows.append((f"{axis}_head", trunk, "head", _HEAD, which, sign))
    for side, s in (("l", 1), ("r", -1)):
        upperarm, forearm, thigh, calf = (f"{side}_{limb}" for limb in ("upperarm", "forearm", "thigh", "calf"))
        for axis, which, sign in (("y", 0, -s), ("p", 1, s), ("r", 2, s)):
            rows.append((f"{side}_{axis}_shoulder", trunk, upperarm, _SHOULDER, which, sign))
        rows.append((f"{side}_elbow", upperarm, forearm, _TWIST, 0, -1))
        for axis, which, sign in (("y", 0, -1), ("p", 1, s), ("r", 2, -1)):
            rows.append((f"{side}_{axis}_hip", root, thigh, _HIP, which, sign))
        rows.append((f"{side}_knee", thigh, calf, _TWIST, 0, -1))
    return [row for row in rows if {*limbs} >= {*row[1:3]}]
