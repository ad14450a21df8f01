"""A robot description of a person (URDF), with the frames and joints of REP-155 that transforms and joint states name."""

from __future__ import annotations

from xml.etree import ElementTree

import numpy as np
import numpy.typing as npt

from voodoo.export.human_frames import FRAMES, frame_places, frame_plan, turns_of
from voodoo.export.skeleton import bones, skeleton_of
from voodoo.model.body import Body
from voodoo.model.rotations import euler_angles
from voodoo.tracker import Tracker

_SAME_M = 1e-4
"""Numbers of the description have this precision."""


def urdf(body: Body, person: str) -> str:
    """The description of a body in its current sizes, at rest: links are the frames of /tf, limbs are cylinders.

    What joint states leave out, the twist of an elbow and the turn of a hand, is only in /tf.

    Args:
        body: of the person.
        person: REP-155 id.
    """
    rest = {}
    for bone in bones(body):
        rest[bone.name] = np.eye(4)
        rest[bone.name][:3, :3], rest[bone.name][:3, 3] = bone.rest, bone.head - bone.rest @ bone.head_in_limb
    estimate = Tracker(body, detector=None).reset_pose(rest)
    names, limb_names = estimate.joint_names, estimate.limb_names
    joints_at_rest = estimate.joint_positions[None]
    posed = skeleton_of(body, np.zeros(1), estimate.limb_poses[None], names, joints_at_rest)
    frames, parents, plan = frame_plan(names, body.limb_tree)
    ids, places = [f"{name}_{person}" for name in frames], frame_places(plan, posed.heads, joints_at_rest)[0]
    joints: dict[str, list[tuple[str, npt.NDArray[np.float64]]]] = {}
    for joint, _, limb, axes, which, sign in turns_of(limb_names):
        axis = sign * np.eye(3)[axes[which] if axes[which] >= 0 else 1]
        joints.setdefault(FRAMES.get(limb, limb), []).append((joint, axis))
    robot = ElementTree.Element("robot", name=f"human_{person}")
    limbs = {f"{FRAMES.get(limb.name, limb.name)}_{person}": limb for limb in body.limbs}
    heads = {f"{FRAMES.get(limb, limb)}_{person}": head for limb, head in zip(limb_names, posed.heads[0], strict=True)}
    for number, (name, parent) in enumerate(zip(ids, parents, strict=True)):
        link = ElementTree.SubElement(robot, "link", name=name)
        if name in limbs:
            shape, place = limbs[name].shape, rest[limbs[name].name]
            visual = ElementTree.SubElement(link, "visual")
            middle = place[:3, 3] + 0.5 * shape.length * place[:3, 2] - places[number]
            _origin(visual, middle, euler_angles(place[None, :3, :3], "ZYX")[0][::-1])
            radius = (shape.a0 + shape.a1 + shape.b0 + shape.b1) / 4.0
            size = {"radius": f"{radius:.4f}", "length": f"{shape.length:.4f}"}
            ElementTree.SubElement(ElementTree.SubElement(visual, "geometry"), "cylinder", size)
        if parent < 0:
            continue
        turns = joints.get(name.removesuffix(f"_{person}"), ())
        # The frames of head and torso are in their middles, away from the joints that turn them.
        pivot = heads[name] if turns else places[parent]
        offset, above = pivot - places[parent], ids[parent]
        fixed = not turns or np.abs(places[number] - pivot).max() > _SAME_M
        for count, (joint, axis) in enumerate(turns, 1):
            below = f"{joint}_{person}"
            if count == len(turns):
                below = f"{joint}_turned_{person}" if fixed else name
            if below != name:
                ElementTree.SubElement(robot, "link", name=below)
            made = _joint(robot, f"{joint}_{person}", "continuous", above, below, offset)
            ElementTree.SubElement(made, "axis", xyz=_words(axis))
            offset, above = np.zeros(3), below
        if fixed:
            _joint(robot, f"{name}_fixed", "fixed", above, name, places[number] - pivot)
    ElementTree.indent(robot)
    return ElementTree.tostring(robot, encoding="unicode")


def _joint(
    robot: ElementTree.Element, name: str, kind: str, parent: str, child: str, offset: npt.NDArray[np.float64]
) -> ElementTree.Element:
    joint = ElementTree.SubElement(robot, "joint", name=name, type=kind)
    _origin(joint, offset, np.zeros(3))
    ElementTree.SubElement(joint, "parent", link=parent)
    ElementTree.SubElement(joint, "child", link=child)
    return joint


def _origin(above: ElementTree.Element, place: npt.NDArray[np.float64], turn: npt.NDArray[np.float64]) -> None:
    ElementTree.SubElement(above, "origin", xyz=_words(place), rpy=_words(turn))


def _words(values: npt.NDArray[np.float64]) -> str:
    return " ".join(f"{value:.4f}" for value in np.round(values, 4) + 0.0)
