"""Frames of REP-155 on a tracked body, and joint angles in the convention of ROS4HRI's human_description: names, and how they are
found."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from voodoo.export.conventions import NAMES
from voodoo.measurements import FloatArray

FRAMES = {limb: names.rep155 for limb, names in NAMES.items() if names.rep155}
"""REP-155 frame of each limb of the default humans; other limbs (the neck) keep their own name."""


def placed_names(names: Sequence[str], parents: Sequence[int], person: str, root: str) -> list[tuple[str, str]]:
    """Parent and name of each of the frames of a person."""
    names = [f"{name}_{person}" for name in names]
    return [(names[above] if above >= 0 else root, name) for name, above in zip(names, parents, strict=True)]


@lru_cache(maxsize=64)
def frame_plan(
    joint_names: tuple[str, ...], limbs: tuple[tuple[str, int | None], ...]
) -> tuple[tuple[str, ...], tuple[int, ...], npt.NDArray[np.int64]]:
    """Of each frame the name without that of the person; the parent, -1 of the first one, which is on the root frame; and the row
    of the plan of `_core.Layout`: the limb it turns with, two points in the middle of which it is (heads of limbs, then joints),
    and the parent."""
    sites = {name: len(limbs) + index for index, name in enumerate(joint_names)}
    there = {name for name, _ in limbs}

    def middle(joint: str, otherwise: int) -> tuple[int, int]:
        left, right = sites.get(f"l_{joint}"), sites.get(f"r_{joint}")
        return (otherwise, otherwise) if left is None or right is None else (left, right)

    rows: list[tuple[str, int, int, int, int]] = [("body", 0, *middle("hip", 0), -1)]
    frame_of: list[int] = []
    for number, (name, above) in enumerate(limbs):
        parent = 0 if above is None or name.endswith("_thigh") else frame_of[above]
        ends = number, number
        if name in ("torso", "thorax"):
            ends = middle("shoulder", number)
        elif above is None:
            ends = rows[0][2:4]
        elif name == "head" and "head_center" in sites:
            ends = sites["head_center"], sites["head_center"]
        frame_of.append(len(rows))
        rows.append((FRAMES.get(name, name), number, *ends, parent))
        # In bodies without hand or foot, the forearm or calf carries the frame of the wrist or ankle.
        for limb, end, site in (("_forearm", "_hand", "_wrist"), ("_calf", "_foot", "_ankle")):
            side = name.removesuffix(limb)
            if name.endswith(limb) and side + end not in there and side + site in sites:
                place = sites[side + site]
                rows.append((side + site, number, place, place, frame_of[number]))
    return tuple(row[0] for row in rows), tuple(row[-1] for row in rows), np.array([row[1:] for row in rows])


def frame_places(plan: npt.NDArray[np.int64], heads: FloatArray, joints: FloatArray) -> FloatArray:
    """Places (F, N, 3) [m] of the frames of a plan, of heads (F, L, 3) and joints (F, J, 3)."""
    points = np.concatenate([heads, joints], axis=1)
    return (points[:, plan[:, 1]] + points[:, plan[:, 2]]) / 2.0


_TWIST, _HEAD, _SHOULDER, _HIP = (-1, -1, -1), (0, 2, 1), (2, 0, 2), (2, 0, 1)
"""Moving axes of Euler angles (x, y, z), or the twist about y."""


@lru_cache(maxsize=16)
def angle_plan(limbs: tuple[str, ...]) -> tuple[tuple[str, ...], npt.NDArray[np.int64]]:
    """Names of the joints that limbs have, and how their angles are found, see `_core.Layout`.

    Shoulder: R = Rz(-s y) Rx(s p) Rz(s r); hip: R = Rz(-y) Rx(s p) Ry(-r); head: R = Rx(r) Rz(y) Ry(-p), with s = 1
    on the left, -1 on the right, R = parent_from_child. Elbow and knee: the rotation about the axis -y; elbows flex to
    positive, knees to negative angles. The rest of their rotation is not in the angle (it is in /tf). The waist
    is 0: the torso is one limb. For a hanging arm, where Euler angles are singular, the third one is zero.
    """
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
