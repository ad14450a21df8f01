"""Joint angles in the convention of ROS4HRI's human_description (REP-155), from the rotations of the bones."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import numpy.typing as npt

from voodoo.export.skeleton import FloatArray, Skeleton
from voodoo.model.rotations import euler_angles_of_quaternions, quaternions

_TWIST, _HEAD, _SHOULDER, _HIP = "", "XZY", "ZXZ", "ZXY"
"""How the angles of a joint are found: as the twist about y, or as Euler angles."""


def joint_angles(posed: Skeleton) -> tuple[tuple[str, ...], FloatArray]:
    """Names of the joints that the body has, and their angles (F, N) [rad].

    Shoulder: R = Rz(-s y) Rx(s p) Rz(s r); hip: R = Rz(-y) Rx(s p) Ry(-r); head: R = Rx(r) Rz(y) Ry(-p), with s = 1
    on the left, -1 on the right, R = parent_from_child. Elbow and knee: the rotation about the axis -y; elbows flex to
    positive, knees to negative angles. The rest of their rotation is not in the angle (it is in /tf). The waist
    is 0: the torso is one limb.
    """
    names, parents, children, columns, signs, shifted = _plan(posed.body.limb_names)
    # All joints at once: of a single frame, calls take the time.
    turns = quaternions(posed.rotations[:, parents].swapaxes(2, 3) @ posed.rotations[:, children])
    found = [_wrapped(2.0 * np.arctan2(turns[..., 1], turns[..., 3]))]
    # Singular for a hanging arm; the third angle is then set to zero, which is one valid solution.
    found += [euler_angles_of_quaternions(turns, order).reshape(len(turns), -1) for order in (_HEAD, _SHOULDER, _HIP)]
    angles = np.concatenate(found, axis=1)[:, columns]
    angles[:, shifted] = _wrapped(angles[:, shifted] + np.pi)
    return names, angles * signs


@lru_cache(maxsize=16)
def _plan(
    limbs: tuple[str, ...],
) -> tuple[tuple[str, ...], list[int], list[int], list[int], FloatArray, npt.NDArray[np.intp]]:
    """Names of joints; parents and children of which rotations are needed; of each joint the column of its angle among twists and
    Euler angles of all of them, and the sign; and the joints whose angle is turned by half a turn before."""
    numbers = {limb: number for number, limb in enumerate(limbs)}
    root = limbs[0]
    trunk = "thorax" if "thorax" in numbers else root
    # Name, limbs, kind, which of the angles, sign.
    rows = [("waist", root, trunk, _TWIST, 0, 1.0)]
    for axis, which, sign in (("r", 0, 1.0), ("y", 1, 1.0), ("p", 2, -1.0)):
        rows.append((f"{axis}_head", trunk, "head", _HEAD, which, sign))
    for side, s in (("l", 1.0), ("r", -1.0)):
        upperarm, forearm, thigh, calf = (f"{side}_{limb}" for limb in ("upperarm", "forearm", "thigh", "calf"))
        # On the right it is the other of the two solutions, so that abduction is positive on both sides.
        for axis, which, sign in (("y", 0, -s), ("p", 1, 1.0), ("r", 2, s)):
            rows.append((f"{side}_{axis}_shoulder", trunk, upperarm, _SHOULDER, which, sign))
        rows.append((f"{side}_elbow", upperarm, forearm, _TWIST, 0, -1.0))
        for axis, which, sign in (("y", 0, -1.0), ("p", 1, s), ("r", 2, -1.0)):
            rows.append((f"{side}_{axis}_hip", root, thigh, _HIP, which, sign))
        rows.append((f"{side}_knee", thigh, calf, _TWIST, 0, -1.0))
    rows = [row for row in rows if numbers.keys() >= {*row[1:3]}]
    pairs = list(dict.fromkeys(row[1:3] for row in rows))
    first = {_TWIST: 0, _HEAD: 1, _SHOULDER: 4, _HIP: 7}
    columns = [
        first[kind] * len(pairs) + pairs.index((parent, child)) * (3 if kind else 1) + which
        for _, parent, child, kind, which, _ in rows
    ]
    shifted = [index for index, row in enumerate(rows) if row[0] in ("r_y_shoulder", "r_r_shoulder")]
    parents, children = ([numbers[pair[end]] for pair in pairs] for end in (0, 1))
    signs = np.array([row[5] for row in rows])
    return tuple(row[0] for row in rows), parents, children, columns, signs, np.array(shifted, dtype=np.intp)


def _wrapped(angles: FloatArray) -> FloatArray:
    return np.asarray((angles + np.pi) % (2.0 * np.pi) - np.pi)
