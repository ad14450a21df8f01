"""Names and joint angles of the default humans' bones in the conventions of other programs: one row for each limb.

H-Anim needs no column: limbs have the names of its segments, and joints (`Bone.joint`) those of its joints.
"""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

import numpy as np

from voodoo.export.skeleton import Skeleton
from voodoo.measurements import FloatArray
from voodoo.model.rotations import axes, euler_angles

Y_UP_RIGHT = axes("x z -y")
"""(X, Y, Z) of OpenSim and ISB = (x, z, -y) of the standing frame: X forward, Y up, Z to the right."""
Y_UP_LEFT = axes("y z x")
"""(X, Y, Z) of BVH and glTF = (y, z, x) of the standing frame: X to the left, Y up, Z forward."""


Color: TypeAlias = dict[str, float]
"""Red, green, blue and opacity: "r", "g", "b", "a"."""
_LEFT: Color = {"r": 0.9, "g": 0.6, "b": 0.3, "a": 0.6}
_RIGHT: Color = {"r": 0.3, "g": 0.6, "b": 0.9, "a": 0.6}
JOINT_COLOR: Color = {"r": 0.9, "g": 0.1, "b": 0.1, "a": 0.6}
JOINT_M = 0.04
"""Diameter of the marker of a joint."""


def limb_color(limb: str) -> Color:
    """The color of a limb in scenes of ROS and Foxglove: the person's left differs."""
    return _LEFT if limb.startswith("l_") else _RIGHT


class Names(NamedTuple):
    """A bone in other conventions.

    Attributes:
        rep155: frame of REP-155; "": none.
        vrm: humanoid bone of VRM and VMC, as VMC spells it; "": none.
        opensim: body of OpenSim's full-body model (Rajagopal 2016), or a new name in its style.
        angles: coordinates of that model, or new names in its style: the rotation from the parent as flexion about Z, then about
            the turned X, then about the long axis Y, in a frame X forward, Y up, Z right (ISB). A leading "-" means the
            opposite sign. Left of the body, X and Y have the opposite sign, so that equal motions have equal angles.
    """

    rep155: str
    vrm: str
    opensim: str
    angles: tuple[str, str, str]


_TRUNK = {
    "pelvis": Names("waist", "Hips", "pelvis", ("pelvis_tilt", "pelvis_list", "pelvis_rotation")),
    "thorax": Names("torso", "Spine", "torso", ("lumbar_extension", "lumbar_bending", "lumbar_rotation")),
    # Of a body whose trunk is one limb, which is the root.
    "torso": Names("torso", "Hips", "pelvis", ("pelvis_tilt", "pelvis_list", "pelvis_rotation")),
    "neck": Names("", "Neck", "neck", ("neck_extension", "neck_bending", "neck_rotation")),
    "head": Names("head", "Head", "head", ("head_extension", "head_bending", "head_rotation")),
}
_SIDES = {
    "clavicle": Names("", "Shoulder", "clavicle", ("clav_rot", "-clav_elev", "clav_prot")),
    "upperarm": Names("shoulder", "UpperArm", "humerus", ("arm_flex", "arm_add", "arm_rot")),
    "forearm": Names("elbow", "LowerArm", "radius", ("elbow_flex", "elbow_dev", "pro_sup")),
    "hand": Names("wrist", "Hand", "hand", ("wrist_flex", "wrist_dev", "wrist_rot")),
    "thigh": Names("hip", "UpperLeg", "femur", ("hip_flexion", "hip_adduction", "hip_rotation")),
    "calf": Names("knee", "LowerLeg", "tibia", ("-knee_angle", "knee_adduction", "knee_rotation")),
    "foot": Names("ankle", "Foot", "calcn", ("ankle_angle", "subtalar_angle", "ankle_rotation")),
}
NAMES = _TRUNK | {
    f"{side}_{limb}": Names(
        names.rep155 and f"{side}_{names.rep155}",
        f"{whole}{names.vrm}",
        f"{names.opensim}_{side}",
        (f"{names.angles[0]}_{side}", f"{names.angles[1]}_{side}", f"{names.angles[2]}_{side}"),
    )
    for side, whole in (("l", "Left"), ("r", "Right"))
    for limb, names in _SIDES.items()
}
"""Limb of the default humans -> its names."""


def plain(name: str) -> str:
    """The name in ASCII without spaces, which end names in readers."""
    return "".join(letter if letter.isascii() and letter.isprintable() else "_" for letter in name).replace(" ", "_")


def names_of(limb: str) -> Names:
    """The names of a limb; one that no convention knows keeps its own."""
    word = plain(limb)
    return NAMES.get(limb) or Names("", "", word, (f"{word}_z", f"{word}_x", f"{word}_y"))


def coordinates(posed: Skeleton) -> tuple[tuple[str, ...], FloatArray]:
    """Names of the joint angles of all bones, three a bone, and the angles (F, 3 L) [rad] of frames with a pose.

    They decompose `Skeleton.local`, which BVH and glTF hold as it is and JointState in the angles of human_description.
    The angles are continuous in time.
    """
    names: list[str] = []
    columns = np.empty((len(posed.stamps), len(posed.bones), 3))
    for index, (bone, turns) in enumerate(zip(posed.bones, posed.local().swapaxes(0, 1), strict=True)):
        own = names_of(bone.name).angles
        mirrored = np.array([1.0, -1.0, -1.0]) if bone.name.startswith("l_") else np.ones(3)
        signs = mirrored * [-1.0 if name.startswith("-") else 1.0 for name in own]
        columns[:, index] = euler_angles(Y_UP_RIGHT @ turns @ Y_UP_RIGHT.T, "ZXY") * signs
        names += [name.removeprefix("-") for name in own]
    return tuple(names), np.unwrap(columns.reshape(len(columns), len(names)), axis=0)
