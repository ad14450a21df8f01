"""Who is missing from the set of bodies and its poses: children, heavy bodies, sitters, what people wear, hold and sit in."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lab.training import raster, shapes
from lab.training.bodies import REGIONS, Body
from lab.training.poses import FORE, THIGH, UPPER, Pose, arm, crouch, sample, standing, with_arms
from lab.training.rotations import about, unit

Array = NDArray[np.float64]
Rng = np.random.Generator
Joints = dict[str, Array]

GROUPS = (
    "adult", "child", "heavy", "seated", "wheelchair", "lying", "desk", "clothes", "carrying", "near", "cut", "beside",
    "coarse",
)  # fmt: skip
"""What a scene is about, for measurement; `adult` is the distribution without any of the others."""
ALSO = {"child": 0.15, "heavy": 0.08, "clothes": 0.2, "carrying": 0.1, "seated": 0.08, "cut": 0.1, "coarse": 0.12}
"""How often a scene of a group has another group's trait, too."""
THINGS = 100  # added to a person's label: what the person holds, carries or sits in and moves with
# Proportions by stature, relative to an adult's at the same stature: head and trunk, lengths of arms and legs, girth of limbs.
# After the tables of Snyder et al. (1977), Anthropometry of infants, children, and youths: head, sitting height, crotch height.
STATURES = (0.80, 0.92, 1.16, 1.39, 1.62)
CHILD = {
    "head": (1.62, 1.52, 1.30, 1.14, 1.0), "trunk": (1.10, 1.08, 1.04, 1.01, 1.0), "arm": (0.90, 0.94, 0.97, 0.99, 1.0),
    "leg": (0.83, 0.87, 0.95, 0.98, 1.0), "girth": (1.12, 1.09, 1.0, 0.96, 1.0),
}  # fmt: skip
PARTS = {"upper": "arm", "fore": "arm", "thigh": "leg", "shank": "leg", "head": "head"}  # others go with the trunk


def traits(rng: Rng, group: str) -> frozenset[str]:
    """Traits of a scene of a group; those of `adult` are none."""
    if group == "adult":
        return frozenset()
    return frozenset({group} | {name for name, often in ALSO.items() if rng.random() < often})


def resized(body: Body, length: Mapping[str, float], girth: float, stature: float) -> Body:
    """A body whose parts are scaled: head, trunk as a whole, limbs along and across the bones; then to a stature [m].

    Bones, joints and surface are scaled together at rest, so that lengths and skinning agree in every pose.
    """
    bones, heads = body.set, body.heads
    scale = np.tile(np.eye(3) * length["trunk"], (len(heads), 1, 1))
    for region, names in REGIONS.items():
        for bone in (bones.bone[name] for name in names):
            factor = length[PARTS.get(region, "trunk")]
            if PARTS.get(region) in ("arm", "leg"):
                end = next(i for i, parent in enumerate(bones.parent) if parent == bone)
                along = unit(heads[end] - heads[bone])
                scale[bone] = girth * np.eye(3) + (factor - girth) * np.outer(along, along)
            else:
                scale[bone] = factor * np.eye(3)
    starts = heads.copy()
    for bone, parent in enumerate(bones.parent):
        if parent >= 0:
            starts[bone] = starts[parent] + scale[parent] @ (heads[bone] - heads[parent])
    shift = starts - np.einsum("bij,bj->bi", scale, heads)
    vertices = raster.skin(body.vertices, bones.skin_bone, bones.skin_weight, scale, shift)
    at = bones.site_bone
    sites = {n: scale[at[n]] @ (v - heads[at[n]]) + starts[at[n]] for n, v in body.sites.items()}
    whole, floor = stature / float(np.ptp(vertices[:, 2])), np.array([0, 0, vertices[:, 2].min()])
    return Body(
        bones, whole * (vertices - floor), whole * (starts - floor), {n: whole * (v - floor) for n, v in sites.items()}
    )


def child(rng: Rng, body: Body, low: float = 0.8, high: float = 1.5) -> Body:
    """A child of a stature between these [m], with a child's proportions."""
    stature = rng.uniform(low, high)
    of = {k: float(np.interp(stature, STATURES, v)) * (1 + rng.normal(0, 0.03)) for k, v in CHILD.items()}
    return resized(body, of, of.pop("girth"), stature)


def heavy(rng: Rng, body: Body) -> Body:
    """A very heavy body: a wide trunk, a belly, thick limbs."""
    much = rng.uniform(0.5, 1.5)
    wide = resized(body, dict.fromkeys(("head", "trunk", "arm", "leg"), 1.0), 1 + 0.3 * much, body.stature)
    points, low, high = wide.vertices.copy(), wide.sites["l_hip"][2], wide.sites["l_shoulder"][2]
    z = (points[:, 2] - (low + rng.uniform(0.15, 0.5) * (high - low))) / (0.45 * (high - low))
    grow = much * wide.set.region["trunk"] * np.exp(-(z**2))
    out = points[:, :2] - wide.sites["humanoid_root"][:2]
    points[:, 1] += 0.5 * grow * out[:, 1]
    points[:, 0] += np.where(out[:, 0] > 0, rng.uniform(0.5, 1.1), 0.3) * grow * out[:, 0]
    return Body(wide.set, points, wide.heads, wide.sites)


def shaped(rng: Rng, body: Body, which: frozenset[str]) -> Body:
    """The body with the traits that change it; adults and children stand side by side."""
    if "child" in which or ("beside" in which and rng.random() < 0.25):
        return child(rng, body)
    return heavy(rng, body) if "heavy" in which else body


def pose(rng: Rng, poses: list[Pose], which: frozenset[str]) -> Pose:
    """A pose that the traits need."""
    if "lying" in which:
        x = rng.random()
        out = standing(rng) if x < 0.5 else crouch(rng, "sit") if x < 0.75 else poses[rng.integers(len(poses))]
        flat = about("y", rng.choice([-1.0, 1.0], p=[0.7, 0.3]) * np.pi / 2) @ about("z", rng.uniform(-np.pi, np.pi))
        out = replace(out.turned(flat), lying=True, seat=False)
    elif which & {"seated", "wheelchair"} or ("desk" in which and rng.random() < 0.6):
        out = crouch(rng, "sit")
        for k in range(2):
            if rng.random() < 0.4:
                out = out.with_arm(k, poses[rng.integers(len(poses))], int(rng.integers(2)))
    elif which & {"clothes", "carrying", "desk"}:
        out = standing(rng)
        for _ in range(20):
            if rng.random() < 0.5:
                break
            walk = poses[rng.integers(len(poses))]
            if (walk.limbs[:, THIGH, 2] < -0.8).all() and walk.chest[2, 2] > 0.8:
                out = walk
    else:
        out = sample(rng, poses)
    return apart(out) if "heavy" in which else out


def apart(pose: Pose) -> Pose:
    """The arms of heavy people hang beside the belly."""
    limbs = pose.limbs.copy()
    for k, outward in enumerate((pose.chest[:, 1], -pose.chest[:, 1])):
        hangs = np.clip(-limbs[k, UPPER] @ pose.chest[:, 2], 0, 1)
        limbs[k, UPPER] = unit(limbs[k, UPPER] + 0.45 * hangs * outward)
        limbs[k, FORE] = unit(limbs[k, FORE] + 0.25 * hangs * outward)
    return replace(pose, limbs=limbs)


HOLDS = ("box", "cane", "crutches", "frame", "bag")


def holding(rng: Rng, pose: Pose, what: str) -> Pose:
    """The arms as they hold something."""
    u = rng.uniform
    if what == "bag" or pose.lying:
        return pose
    side = int(rng.integers(2))
    bent = {"box": (u(0.0, 0.7), u(1.1, 1.8)), "frame": (u(0.2, 0.6), u(0.3, 0.9))}
    flex, elbow = bent.get(what, (u(0, 0.4), u(0.1, 0.6)))
    arms = np.stack([arm(k, flex + rng.normal(0, 0.08), u(-0.05, 0.15), u(0, 0.5), elbow) for k in range(2)])
    return with_arms(pose, arms, (side,) if what == "cane" else (0, 1))


Meshes = list[shapes.Mesh]


def garments(
    rng: Rng, points: Array, joints: Joints, pose: Pose, body: Body, *, upright: bool | None = None
) -> tuple[Meshes, Meshes]:
    """A long skirt, a coat, a hat; and a bag on the back. The first are the person's surface, the others its things.

    Only who is upright has a skirt or a coat; told by the pose by default.
    """
    size, worn, things = body.stature / 1.7, [], []
    if upright is None:
        upright = bool((pose.limbs[:, THIGH, 2] < -0.75).all() and pose.pelvis[2, 2] > 0.85 and not pose.lying)
    x = rng.random()
    if upright and x < 0.6:
        top = joints["humanoid_root"][2] + 0.08 * size if x < 0.35 else joints["vc7"][2] - 0.12 * size
        ankle, knee = sorted((joints["l_ankle"][2], joints["l_knee"][2]))
        hem = rng.uniform(ankle - 0.04, knee) if x < 0.35 else rng.uniform(0.6 * ankle + 0.4 * knee, knee + 0.3 * size)
        near = body.set.region["thigh"] + body.set.region["shank"] + body.set.region["trunk"] > 0.5
        worn.append(_hung(points[near], top, hem, rng.uniform(0.01, 0.05), rng.uniform(0, 0.08)))
    up, skull = pose.head[:, 2], joints["head_center"]
    head = 0.5 * np.ptp(points[body.set.region["head"] > 0.9] @ up)
    if rng.random() < 0.4:
        crown, brim = rng.uniform(0.85, 1.0) * head, rng.uniform(0.0, 1.0) * head + head
        start, end = skull + 0.25 * head * up, skull + rng.uniform(1.0, 1.7) * head * up
        worn.append(shapes.tube(start, end, (crown, crown, 0.9 * crown)))
        if rng.random() < 0.6:
            worn.append(shapes.tube(start, start + 0.02 * up, (brim, brim), n=16))
    elif rng.random() < 0.25:  # a hood, a helmet, much hair
        worn.append(shapes.ball(skull + 0.1 * head * up - 0.15 * head * pose.head[:, 0], (1.15 * head,) * 3))
    if rng.random() < 0.45:
        deep, wide, high = rng.uniform(0.1, 0.3) * size, rng.uniform(0.22, 0.42) * size, rng.uniform(0.3, 0.62) * size
        box, faces, closed = shapes.box((deep, wide, high), (-deep / 2 - 0.1 * size, 0, -0.62 * high))
        middle = 0.35 * joints["humanoid_root"] + 0.65 * joints["vc7"]
        things.append((box @ pose.chest.T + middle, faces, closed))
    return worn, things


def _hung(points: Array, top: float, hem: float, off: float, flare: float) -> shapes.Mesh:
    """Cloth about the hull of the points (V, 3) of each height, which never narrows downwards."""
    angle = np.arange(32) * (2 * np.pi / 32)
    way = np.stack([np.cos(angle), np.sin(angle)], 1)
    facing = np.cos(angle[:, None] - angle)
    heights, rows, least = np.linspace(top, hem, 8), [], np.zeros(32)
    middle = points[np.abs(points[:, 2] - top) < 0.1, :2].mean(0)
    for i, z in enumerate(heights):
        at = points[np.abs(points[:, 2] - z) < 0.06, :2] - middle
        reach = (at @ way.T).max(0) if len(at) else np.zeros(32)
        radius = np.where(facing > 0.1, reach[:, None] / np.maximum(facing, 0.1), np.inf).min(0)
        least = np.maximum(radius + off + flare * i / 7, 0.97 * least)
        rows.append(np.concatenate([middle + least[:, None] * way, np.full((32, 1), z)], 1))
    grid = np.stack(rows)
    return shapes.sheet(np.concatenate([grid, grid[:, :1]], 1))


def wheelchair(rng: Rng, root: Array, pose: Pose, size: float) -> Meshes:
    """The wheelchair in which somebody sits whose pelvis is at `root`; `size` is relative to an adult's."""
    ahead, yaw = _ahead(pose)
    at = root[:2] - 0.05 * ahead
    return shapes.moved(shapes.wheelchair(rng, float(root[2] - 0.09 * size), size), (at[0], at[1]), yaw)


def desk(rng: Rng, root: Array, pose: Pose, size: float, *, sits: bool, near: float) -> Meshes:
    """The desk or counter before somebody whose body reaches `near` meters ahead of the pelvis at `root`."""
    height = root[2] + rng.uniform(0.1, 0.3) * size if sits else rng.uniform(0.9, 1.15) * min(size, 1.0)
    ahead, yaw = _ahead(pose)
    at = root[:2] + (near + rng.uniform(0.2, 0.55)) * ahead
    return shapes.moved(shapes.desk(rng, float(height)), (at[0], at[1]), yaw)


def _ahead(pose: Pose) -> tuple[Array, float]:
    """The level direction (2,) that the pelvis faces, and its angle."""
    yaw = float(np.arctan2(pose.pelvis[1, 0], pose.pelvis[0, 0]))
    return np.array([np.cos(yaw), np.sin(yaw)]), yaw


def held(rng: Rng, joints: Joints, pose: Pose, what: str, body: Body) -> Meshes:
    """What is held by arms that `holding` has placed: on the floor z = 0."""
    left, right = joints["l_hand"], joints["r_hand"]
    ahead = unit(pose.chest[:, 0] * [1, 1, 0])
    yaw, size, middle = float(np.arctan2(ahead[1], ahead[0])), body.stature / 1.7, 0.5 * (left + right)
    if what == "box":
        edge = size * np.array([rng.uniform(0.15, 0.4), np.linalg.norm(left - right) / size, rng.uniform(0.15, 0.45)])
        at = middle + (edge[0] / 2 - 0.06) * ahead - [0, 0, rng.uniform(0.2, 0.7) * edge[2]]
        return [shapes.box((edge[0], edge[1], edge[2]), (at[0], at[1], at[2]), yaw)]
    if what == "bag":
        edge = size * rng.uniform((0.08, 0.2, 0.2), (0.25, 0.45, 0.45))
        return [shapes.box((edge[0], edge[1], edge[2]), (left[0], left[1], max(left[2] - edge[2], 0.0)), yaw + 1.57)]
    if what == "frame":
        return shapes.moved(shapes.walking_frame(rng, max(middle[2], 0.3), size), (middle[0], middle[1]), yaw)
    out = []
    for hand, elbow, used in ((left, joints["l_elbow"], True), (right, joints["r_elbow"], what == "crutches")):
        if used:
            foot = np.array([*(hand + rng.uniform(-0.1, 0.25) * ahead)[:2], 0.0])
            out.append(shapes.tube(foot, elbow if what == "crutches" else hand, (0.015, 0.018)))
    return out
