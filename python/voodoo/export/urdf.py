"""A robot description of a person (URDF), with the frames and joints of REP-155 that transforms and joint states name."""

from __future__ import annotations

from xml.etree import ElementTree

import numpy as np

from voodoo.export.human_frames import FRAMES, frame_places, frame_plan, turns_of
from voodoo.export.skeleton import SAME_M, bones
from voodoo.measurements import FloatArray
from voodoo.model.at_rest import limbs_at_rest, sites_at_rest
from voodoo.model.body import Body
from voodoo.model.rotations import euler_angles


def urdf(body: Body, person: str) -> str:
    """The description of a body in its current sizes, at rest: links are the frames of /tf, limbs are cylinders.

    What joint states leave out, the twist of an elbow and the turn of a hand, is only in /tf.

    Args:
        body: of the person.
        person: REP-155 id.
    """
    heads, sites = np.array([bone.head for bone in bones(body)]), np.array(list(sites_at_rest(body).values()))
    frames, parents, plan = frame_plan(body.site_names, body.limb_tree)
    ids, places = [f"{name}_{person}" for name in frames], frame_places(plan, heads[None], sites[None])[0]
    joints: dict[str, list[tuple[str, FloatArray]]] = {}
    for joint, _, limb, axes, which, sign in turns_of(body.limb_names):
        axis = sign * np.eye(3)[axes[which] if axes[which] >= 0 else 1]
        joints.setdefault(FRAMES.get(limb, limb), []).append((joint, axis))
    robot = ElementTree.Element("robot", name=f"human_{person}")
    parts = zip(body.limbs, heads, *limbs_at_rest(body), strict=True)
    limbs = {f"{FRAMES.get(limb.name, limb.name)}_{person}": (limb.shape, *rest) for limb, *rest in parts}
    for number, (name, parent) in enumerate(zip(ids, parents, strict=True)):
        link = ElementTree.SubElement(robot, "link", name=name)
        if name in limbs:
            shape, _, turn, origin = limbs[name]
            visual = ElementTree.SubElement(link, "visual")
            middle = origin + 0.5 * shape.length * turn[:, 2] - places[number]
            _origin(visual, middle, euler_angles(turn[None], "ZYX")[0][::-1])
            radius = (shape.a0 + shape.a1 + shape.b0 + shape.b1) / 4.0
            size = {"radius": f"{radius:.4f}", "length": f"{shape.length:.4f}"}
            ElementTree.SubElement(ElementTree.SubElement(visual, "geometry"), "cylinder", size)
        if parent < 0:
            continue
        turns = joints.get(name.removesuffix(f"_{person}"), ())
        # The frames of head and torso are in their middles, away from the joints that turn them.
        pivot = limbs[name][1] if turns else places[parent]
        offset, above = pivot - places[parent], ids[parent]
        fixed = not turns or np.abs(places[number] - pivot).max() > SAME_M
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
    robot: ElementTree.Element, name: str, kind: str, parent: str, child: str, offset: FloatArray
) -> ElementTree.Element:
    joint = ElementTree.SubElement(robot, "joint", name=name, type=kind)
    _origin(joint, offset, np.zeros(3))
    ElementTree.SubElement(joint, "parent", link=parent)
    ElementTree.SubElement(joint, "child", link=child)
    return joint


def _origin(above: ElementTree.Element, place: FloatArray, turn: FloatArray) -> None:
    ElementTree.SubElement(above, "origin", xyz=_words(place), rpy=_words(turn))


def _words(values: FloatArray) -> str:
    return " ".join(f"{value:.4f}" for value in np.round(values, 4) + 0.0)
