"""Joint angles in the convention of ROS4HRI's human_description (REP-155), from the rotations of the bones."""

from __future__ import annotations

import numpy as np

from voodoo.export.skeleton import FloatArray, Skeleton
from voodoo.model.rotations import euler_angles_of_quaternions, quaternions


def joint_angles(posed: Skeleton) -> tuple[tuple[str, ...], FloatArray]:
    """Names of the joints that the body has, and their angles (F, N) [rad].

    Shoulder: R = Rz(-s y) Rx(s p) Rz(s r); hip: R = Rz(-y) Rx(s p) Ry(-r); head: R = Rx(r) Rz(y) Ry(-p), with s = 1
    on the left, -1 on the right, R = parent_from_child. Elbow and knee: the rotation about the axis -y; elbows flex to
    positive, knees to negative angles. The rest of their rotation is not in the angle (it is in /tf). The waist
    is 0: the torso is one limb.
    """
    turns = {bone.name: posed.rotations[:, number] for number, bone in enumerate(posed.bones)}
    root = posed.bones[0].name
    trunk = "thorax" if "thorax" in turns else root
    pairs = [(root, trunk), (trunk, "head")]
    for side in "lr":
        pairs += [(trunk, f"{side}_upperarm"), (f"{side}_upperarm", f"{side}_forearm")]
        pairs += [(root, f"{side}_thigh"), (f"{side}_thigh", f"{side}_calf")]
    pairs = [pair for pair in pairs if turns.keys() >= set(pair)]
    # All at once: one call of `quaternions` for each joint takes most of the time of a single frame.
    relative = [turns[parent].transpose(0, 2, 1) @ turns[child] for parent, child in pairs]
    between = dict(zip(pairs, quaternions(np.array(relative)), strict=True))
    columns: dict[str, FloatArray] = {"waist": _turn_about_y(between[root, trunk])}
    if (trunk, "head") in between:
        r, y, p = _euler(between[trunk, "head"], "XZY")
        columns |= {"r_head": r, "y_head": y, "p_head": -p}
    for side, s in (("l", 1.0), ("r", -1.0)):
        upperarm, thigh = f"{side}_upperarm", f"{side}_thigh"
        if (trunk, upperarm) in between:
            a, b, c = _euler(between[trunk, upperarm], "ZXZ")
            if s < 0.0:  # the other of the two solutions, so that abduction is positive on both sides
                a, b, c = _wrapped(a + np.pi), -b, _wrapped(c - np.pi)
            columns |= {f"{side}_y_shoulder": -s * a, f"{side}_p_shoulder": s * b, f"{side}_r_shoulder": s * c}
        if (upperarm, f"{side}_forearm") in between:
            columns[f"{side}_elbow"] = -_turn_about_y(between[upperarm, f"{side}_forearm"])
        if (root, thigh) in between:
            a, b, c = _euler(between[root, thigh], "ZXY")
            columns |= {f"{side}_y_hip": -a, f"{side}_p_hip": s * b, f"{side}_r_hip": -c}
        if (thigh, f"{side}_calf") in between:
            columns[f"{side}_knee"] = -_turn_about_y(between[thigh, f"{side}_calf"])
    return tuple(columns), np.column_stack(list(columns.values()))


def _euler(turns: FloatArray, order: str) -> tuple[FloatArray, FloatArray, FloatArray]:
    # Singular for a hanging arm; the third angle is then set to zero, which is one valid solution.
    first, second, third = euler_angles_of_quaternions(turns, order).T
    return first, second, third


def _wrapped(angles: FloatArray) -> FloatArray:
    return np.asarray((angles + np.pi) % (2.0 * np.pi) - np.pi)


def _turn_about_y(turns: FloatArray) -> FloatArray:
    """Angle of the twist about y in the swing-twist decomposition."""
    _, y, _, w = turns.T
    return _wrapped(2.0 * np.arctan2(y, w))
