"""Motion of held-out people for `lab.training.unseen`: captured clips, and ways through captured poses and those made by rule."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lab.training import anybody, poses
from lab.training.bodies import JOINTS, Body
from lab.training.poses import THIGH, Pose
from lab.training.rotations import about, part, shortest, unit
from lab.training.shapes import Mesh

Array = NDArray[np.float64]
Rng = np.random.Generator
RATE = 30.0
MILLIMETER = 1000.0
Clips = dict[str, tuple[list[Pose], Array]]


@dataclass(frozen=True)
class Motion:
    """A surface (V, 3) and joints (17, 3) a frame [m], on the floor, and what they are."""

    surfaces: list[Array]
    joints: Array
    words: str
    poses: list[Pose]
    seat: float | None = None
    things: list[list[Mesh]] = field(default_factory=list)

    def moved(self, turn: Array, shifts: Array) -> Motion:
        """The motion turned by (F, 3, 3) or (3, 3), then shifted by (F, 3) or (3,)."""
        count = len(self.surfaces)
        turns, shifts = np.broadcast_to(turn, (count, 3, 3)), np.broadcast_to(shifts, (count, 3))
        each = list(zip(turns, shifts, strict=True))
        return replace(
            self,
            surfaces=[points @ r.T + t for points, (r, t) in zip(self.surfaces, each, strict=True)],
            joints=np.einsum("fij,fkj->fki", turns, self.joints) + shifts[:, None],
            things=[
                [(points @ r.T + t, faces, closed) for points, faces, closed in parts]
                for parts, (r, t) in zip(self.things, each, strict=False)
            ],
        )


def clips_of(data: Path) -> Clips:
    """Held-out clips: poses turned as they were captured, and places of the root (F, 3)."""
    stored = np.load(data / "mocap" / "sequences.npz")
    names = [str(name) for name in stored["joint_names"]]
    kept = sorted(set(stored["clip"].tolist()))[poses.HELD_OUT_CLIPS // 2 :: poses.HELD_OUT_CLIPS]
    found = {}
    for clip in kept:
        positions = stored["positions_m"][stored["clip"] == clip] / MILLIMETER
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # clips in which nobody stands upright give nothing
            made = poses.from_positions(positions, names)
        if len(made) < 3 * RATE / 2 or not all(np.isfinite(pose.pelvis).all() for pose in made):
            continue
        across = positions[:, names.index("l_hip")] - positions[:, names.index("r_hip")]
        heading = np.arctan2(-across[:, 0], across[:, 1])
        turned = [pose.turned(about("z", float(angle))) for pose, angle in zip(made, heading, strict=True)]
        found[clip] = (turned, positions[:, names.index("root")])
    return found


def walk(rng: Rng, body: Body, dress: int, clips: Clips, change: Callable[[Pose], Pose] = lambda pose: pose) -> Motion:
    """A part of a captured clip, of which each pose is changed; in turn to and fro where it is short."""
    clip = str(rng.choice(sorted(clips)))
    made, roots = clips[clip]
    count = min(len(made), int(rng.integers(90, 160)))
    first = int(rng.integers(len(made) - count + 1))
    part_of = made[first : first + count]
    places = roots[first : first + count] * body.stature / 1.75
    if rng.random() < 0.5:
        part_of, places = [pose.mirrored() for pose in part_of], places * [1.0, -1.0, 1.0]
    if count < 90:
        part_of, places = part_of + part_of[-2::-1], np.concatenate([places, places[-2::-1]])
    surfaces, joints, part_of = [], [], [change(pose) for pose in part_of]
    for pose, place in zip(part_of, places, strict=True):
        surface, at = body.posed(pose, np.random.default_rng(dress))
        surfaces.append(surface + place)
        joints.append([at[name] + place for name in JOINTS])
    lowest = np.array([surface[:, 2].min() for surface in surfaces])
    # Legs of another length would sink into the floor; who jumps stays in the air.
    lift = np.maximum(-np.median(lowest), -lowest)
    surfaces = [surface + [0, 0, up] for surface, up in zip(surfaces, lift, strict=True)]
    return Motion(surfaces, np.array(joints) + lift[:, None, None] * [0, 0, 1.0], f"clip {clip}", part_of)


def story(
    rng: Rng,
    body: Body,
    dress: int,
    still: list[Pose],
    change: Callable[[Pose], Pose] = lambda pose: pose,
    posture: str | None = None,
) -> Motion:
    """From pose to pose by rule and from motion capture, with the feet at one place; at times on a chair.

    `posture` may be "sit" or "stand" throughout.
    """
    kinds = [
        str(rng.choice(["squat", "bend", "kneel", "lunge", "kick", "captured", "captured", "stand"])) for _ in range(3)
    ]
    sits = rng.random() < 0.25 if posture is None else posture == "sit"
    if sits:
        kinds = ["sit", "sit", "sit"]
    elif posture:
        kinds = ["stand", "stand", "stand"]
    turn = rng.normal(0, 0.2, 4)
    if posture == "sit":
        turn[:] = turn[0]
    keys = [poses.standing(rng)]
    for kind in kinds:
        if kind == "stand":
            keys.append(poses.standing(rng))
        elif kind == "captured":
            keys.append(still[int(rng.integers(len(still)))])
        else:
            keys.append(poses.crouch(rng, kind))
    if sits:  # one seat, of which the arms and the trunk move
        keys = [keys[1], *(_legs_of(keys[1], key) for key in keys[2:])]
    keys = [key.turned(about("z", float(angle))) for key, angle in zip(keys, turn, strict=False)]
    surfaces, joints, made = [], [], []
    seat = None
    for number, key in enumerate(keys):
        other = keys[min(number + 1, len(keys) - 1)]
        rest, move = int(rng.integers(6, 20)), int(rng.integers(18, 38))
        for step in range(rest + (move if other is not key else 0)):
            fraction = max(step - rest, 0) / move
            pose = change(_between(key, other, fraction * fraction * (3 - 2 * fraction)))
            made.append(pose)
            surface, at = body.posed(pose, np.random.default_rng(dress))
            feet = 0.5 * (at["l_ankle"] + at["r_ankle"])
            shift = -np.array([feet[0], feet[1], surface[:, 2].min()])
            surfaces.append(surface + shift)
            joints.append([at[name] + shift for name in JOINTS])
    if sits:
        seat = float(joints[0][2][2] - 0.09 * body.stature / 1.7)
    return Motion(surfaces, np.array(joints), "story " + " ".join(kinds), made, seat)


GROUPS = ("child", "heavy", "wheelchair", "seated", "desk", "clothes", "carrying")
"""Groups of `anybody.GROUPS` of whom there are motions."""


def of_group(rng: Rng, group: str, body: Body, dress: int, clips: Clips, still: list[Pose], *, clip: bool) -> Motion:
    """A motion of somebody of a group, whose body is `body`, with the things that belong to it."""
    what = str(rng.choice(anybody.HOLDS)) if group == "carrying" else ""

    def change(pose: Pose) -> Pose:
        if group == "carrying":
            return anybody.holding(np.random.default_rng(dress), pose, what)
        return anybody.apart(pose) if group == "heavy" else pose

    if group in ("wheelchair", "seated"):
        motion = story(rng, body, dress, still, change, "sit")
    elif group == "desk":
        motion = story(rng, body, dress, still, change, "sit" if rng.random() < 0.6 else "stand")
    elif clip:
        motion = walk(rng, body, dress, clips, change)
    else:
        motion = story(rng, body, dress, still, change, "stand" if group in ("clothes", "carrying") else None)
    upright = all((pose.limbs[:, THIGH, 2] < -0.5).all() and pose.pelvis[2, 2] > 0.8 for pose in motion.poses)
    things = [
        _things(
            np.random.default_rng(dress), group, what, (points, dict(zip(JOINTS, at, strict=True)), pose, body), upright
        )
        for points, at, pose in zip(motion.surfaces, motion.joints, motion.poses, strict=True)
    ]
    fixed = things[:1] * len(things) if group in ("wheelchair", "desk") else things
    seat = None if group == "wheelchair" else motion.seat
    motion = replace(motion, seat=seat, things=fixed, words=" ".join([group, what, motion.words]).replace("  ", " "))
    return _rolled(rng, motion) if group == "wheelchair" else motion


def _things(
    rng: Rng, group: str, what: str, person: tuple[Array, anybody.Joints, Pose, Body], upright: bool
) -> list[Mesh]:
    """What somebody of a group wears, holds, sits in or stands behind."""
    points, joints, pose, body = person
    root, size = joints["humanoid_root"], body.stature / 1.7
    if group == "clothes":
        worn, things = anybody.garments(rng, points, joints, pose, body, upright=upright)
        return worn + things
    if group == "carrying":
        return anybody.held(rng, joints, pose, what, body)
    if group == "wheelchair":
        return anybody.wheelchair(rng, root, pose, size)
    if group == "desk":
        sits = bool((pose.limbs[:, THIGH, 2] > -0.75).all())
        return anybody.desk(rng, root, pose, size, sits=sits, near=0.2)
    return []


def _rolled(rng: Rng, motion: Motion) -> Motion:
    """A motion in a wheelchair that rolls to and fro and turns."""
    time = np.arange(len(motion.surfaces)) / RATE
    far, wide = rng.uniform(0.1, 0.5), rng.uniform(0.1, 0.8)
    phase, pace = rng.uniform(0, 2 * np.pi, 2), rng.uniform(0.8, 2.0, 2)
    yaw, along = wide * np.sin(pace[0] * time + phase[0]), far * np.sin(pace[1] * time + phase[1])
    turns = np.stack([about("z", float(angle)) for angle in yaw])
    pelvis = motion.poses[0].pelvis[:, 0] * [1.0, 1.0, 0.0]
    middle = motion.joints[0, 2] * [1.0, 1.0, 0.0]
    ahead = turns @ unit(pelvis)
    return motion.moved(turns, along[:, None] * ahead + middle - turns @ middle)


def _legs_of(pose: Pose, other: Pose) -> Pose:
    """`other` with pelvis and legs of `pose`."""
    limbs = other.limbs.copy()
    limbs[:, 3:] = pose.limbs[:, 3:]
    return Pose(pose.pelvis, other.chest, other.head, limbs, other.clavicle)


def _between(a: Pose, b: Pose, fraction: float) -> Pose:
    """A pose on the way from one to another: limbs turn relative to the trunk."""

    def turned(one: Array, other: Array) -> Array:
        return one @ part(one.T @ other, fraction)

    pelvis, chest, head = turned(a.pelvis, b.pelvis), turned(a.chest, b.chest), turned(a.head, b.head)
    limbs = np.zeros((2, 6, 3))
    for side in range(2):
        for bone in range(6):
            which = ("chest", chest) if bone < 3 else ("pelvis", pelvis)
            one, other = (unit(getattr(p, which[0]).T @ p.limbs[side, bone]) for p in (a, b))
            limbs[side, bone] = which[1] @ part(shortest(one, other), fraction) @ one
    clavicle = np.stack([turned(a.clavicle[k], b.clavicle[k]) for k in range(2)])
    return Pose(pelvis, chest, head, limbs, clavicle)
