"""Poses as rotations of the trunk and directions of the limbs: from motion capture, from rules, mixed and mirrored.

A pose knows no lengths: any body can take it (`lab.training.bodies`). Frame of a pose: x forward, y left, z up.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lab.training.rotations import about, about_axis, frame, part, shortest, unit, vector

Array = NDArray[np.float64]
UPPER, FORE, HAND, THIGH, SHANK, FOOT = range(6)
NAMES = ("upper", "fore", "hand", "thigh", "shank", "foot")
HELD_OUT_CLIPS = 10  # one clip in ten is kept for validation


@dataclass(frozen=True)
class Pose:
    """pelvis, chest, head: rotations from the upright rest; limbs (2, 6, 3): unit directions, left first; clavicle (2, 3, 3)."""

    pelvis: Array
    chest: Array
    head: Array
    limbs: Array
    clavicle: Array
    seat: bool = False
    lying: bool = False

    def turned(self, r: Array) -> Pose:
        """The whole pose turned by `r`."""
        return replace(self, pelvis=r @ self.pelvis, chest=r @ self.chest, head=r @ self.head, limbs=self.limbs @ r.T)

    def mirrored(self) -> Pose:
        """Left and right exchanged."""
        m = np.diag([1.0, -1.0, 1.0])

        def flip(r: Array) -> Array:
            return m @ r @ m

        return replace(
            self, pelvis=flip(self.pelvis), chest=flip(self.chest), head=flip(self.head),
            limbs=self.limbs[::-1] @ m, clavicle=flip(self.clavicle[::-1]),
        )  # fmt: skip

    def with_arm(self, side: int, other: Pose, other_side: int) -> Pose:
        """One arm taken over from another pose, as it lies relative to the chest."""
        m = np.diag([1.0, -1.0, 1.0]) if side != other_side else np.eye(3)
        limbs, clavicle = self.limbs.copy(), self.clavicle.copy()
        limbs[side, :3] = other.limbs[other_side, :3] @ other.chest @ m @ self.chest.T
        clavicle[side] = m @ other.clavicle[other_side] @ m
        return replace(self, limbs=limbs, clavicle=clavicle)


def _tilt(axis: Array, lateral: Array, reference: Array) -> tuple[Array, float]:
    """Frames with y = lateral and z = axis, less the mean tilt of the frames in `reference`."""
    f = frame(lateral, axis)  # columns y, z, x
    r = np.stack([f[..., 2], f[..., 0], f[..., 1]], -1)
    tilt = float(np.median(np.arctan2(r[reference, 0, 2], r[reference, 2, 2])))
    return r @ about("y", -tilt), tilt


def from_positions(positions: Array, names: list[str]) -> list[Pose]:
    """Poses of motion capture: positions (N, 22, 3) in meters, z up, of the joints `names`."""
    p = {n: positions[:, i].astype(float) for i, n in enumerate(names)}
    trunk, thighs = unit(p["neck"] - p["root"]), [unit(p[s + "_knee"] - p[s + "_hip"]) for s in "lr"]
    calm = (trunk[:, 2] > 0.97) & (thighs[0][:, 2] < -0.96) & (thighs[1][:, 2] < -0.96)
    lateral = p["l_hip"] - p["r_hip"]
    forward = np.cross(lateral, [0, 0, 1.0])
    heading = np.arctan2(forward[:, 1], forward[:, 0])
    c, s = np.cos(heading), np.sin(heading)
    turn = np.zeros((len(c), 3, 3))
    turn[:, 0, 0], turn[:, 0, 1], turn[:, 1, 0], turn[:, 1, 1], turn[:, 2, 2] = c, s, -s, c, 1
    p = {n: np.einsum("nij,nj->ni", turn, v) for n, v in p.items()}
    pelvis, _ = _tilt(p["spine"] - p["root"], p["l_hip"] - p["r_hip"], calm)
    chest, _ = _tilt(p["neck"] - p["spine"], p["l_shoulder"] - p["r_shoulder"], calm)
    head, _ = _tilt(p["head_up"] - p["head"], p["head_left"] - p["head"], calm)
    ends = ("shoulder", "elbow", "wrist", "fingers", "hip", "knee", "ankle", "toe")
    pairs = ((0, 1), (1, 2), (2, 3), (4, 5), (5, 6), (6, 7))
    limbs = np.stack([np.stack([unit(p[s + ends[b]] - p[s + ends[a]]) for a, b in pairs], 1) for s in ("l_", "r_")], 1)
    out = []
    collar = [np.einsum("nji,nj->ni", chest, unit(p[s + "shoulder"] - p["neck"])) for s in ("l_", "r_")]
    rest = [unit(np.median(v[calm], 0)) for v in collar]
    for i in range(len(positions)):
        clavicle = [_limited(shortest(rest[k], collar[k][i]), 0.5) for k in range(2)]
        limbs[i, :, HAND] = [_near(limbs[i, k, HAND], limbs[i, k, FORE], 1.1) for k in range(2)]
        out.append(Pose(pelvis[i], chest[i], head[i], limbs[i], np.stack(clavicle)))
    return out


def _limited(r: Array, angle: float) -> Array:
    n = float(np.linalg.norm(vector(r)))
    return part(r, angle / n) if n > angle else r


def _near(d: Array, other: Array, angle: float) -> Array:
    """`d` moved to at most `angle` from `other`."""
    a = np.arccos(np.clip(d @ other, -1, 1))
    return d if a <= angle else part(shortest(other, d), angle / a) @ other


def load(place: Path, held_out: bool) -> list[Pose]:
    """The poses of the folder `mocap`: those of the clips for training, or those kept for validation.

    A clip that is kept from one of the files is trained on from neither; validation has it from that file alone.
    """
    out = []
    files = [(np.load(place / name), step) for name, step in (("poses.npz", 1), ("sequences.npz", 3))]
    kept = [set(sorted(set(data["clip"].tolist()))[HELD_OUT_CLIPS // 2 :: HELD_OUT_CLIPS]) for data, _ in files]
    for (data, step), own in zip(files, kept, strict=True):
        use = np.array([c in own if held_out else c not in set().union(*kept) for c in data["clip"].tolist()])
        xyz = data["positions_m"][use][::step].astype(float)
        xyz = xyz / 1000 if data["positions_m"].dtype.kind == "i" else xyz
        out += from_positions(xyz, data["joint_names"].tolist())
    return out


# --- poses by rule -------------------------------------------------------------------------------


def leg(side: int, flex: float, abduct: float, twist: float, knee: float, ankle: float = 0.0) -> Array:
    """Directions of thigh, shank and foot from angles in radians, relative to the pelvis."""
    s = 1 if side == 0 else -1
    r = about("x", s * abduct) @ about("y", -flex) @ about("z", s * twist)
    low = r @ about("y", knee)
    down = np.array([0, 0, -1.0])
    return np.stack([r @ down, low @ down, low @ about("y", ankle) @ unit(np.array([0.93, s * 0.12, -0.3]))])


def arm(
    side: int, flex: float, abduct: float, twist: float, elbow: float, wrist: tuple[float, float] = (0, 0)
) -> Array:
    """Directions of upper arm, forearm and hand from angles in radians, relative to the chest."""
    s = 1 if side == 0 else -1
    r = about("y", -flex) @ about("x", s * abduct) @ about("z", -s * twist)
    low = r @ about("y", -elbow)
    down = np.array([0, 0, -1.0])
    return np.stack([r @ down, low @ down, low @ about("x", wrist[0]) @ about("y", wrist[1]) @ down])


def random_arm(rng: np.random.Generator, side: int) -> Array:
    """An arm anywhere a shoulder and an elbow can take it."""
    flex = rng.uniform(-0.6, 3.0)
    abduct = rng.uniform(-0.3, 1.7) if flex < 1.6 else rng.uniform(-0.3, 0.9)
    elbow = rng.uniform(0, 2.5) if rng.random() < 0.7 else rng.uniform(0, 0.5)
    return arm(side, flex, abduct, rng.uniform(-0.8, 1.6), elbow, (rng.normal(0, 0.25), rng.normal(0, 0.35)))


def _arms(rng: np.random.Generator, kind: str) -> Array:
    """Both arms of one kind, about alike: (2, 3, 3)."""
    n = rng.normal
    if kind == "rest":
        f, a, t, e = n(0.05, 0.12), abs(n(0.12, 0.1)), n(0.3, 0.4), abs(n(0.25, 0.18))
    elif kind == "tee":
        f, a, t, e = n(0, 0.1), n(1.5, 0.12), n(0, 0.5), abs(n(0.1, 0.12))
    elif kind == "up":
        f, a, t, e = n(2.8, 0.25), n(0.2, 0.2), n(0, 0.5), abs(n(0.25, 0.25))
    elif kind == "front":
        f, a, t, e = n(1.4, 0.25), n(0.1, 0.15), n(0.2, 0.4), abs(n(0.2, 0.3))
    elif kind == "hips":
        f, a, t, e = n(-0.4, 0.15), n(0.7, 0.12), n(1.1, 0.2), n(1.5, 0.2)
    elif kind == "crossed":
        f, a, t, e = n(0.4, 0.15), n(0.1, 0.1), n(1.2, 0.2), n(1.8, 0.2)
    else:  # hands on the thighs
        f, a, t, e = n(0.5, 0.25), abs(n(0.2, 0.1)), n(0.5, 0.3), n(0.9, 0.35)
    d = lambda s: n(0, s)  # noqa: E731
    wrist = lambda: (d(0.15), d(0.25))  # noqa: E731
    return np.stack([arm(k, f + d(0.08), a + d(0.05), t + d(0.12), max(0, e + d(0.1)), wrist()) for k in range(2)])


def _build(rng: np.random.Generator, lean: tuple[float, float, float], bend: float, legs: Array, arms: Array) -> Pose:
    """A pose from the pelvis' angles (forward, sideways, twist), the back's bend and limbs in the trunk's axes."""
    pelvis = about("z", lean[2]) @ about("x", lean[1]) @ about("y", lean[0])
    chest = pelvis @ about("z", rng.normal(0, 0.12)) @ about("x", rng.normal(0, 0.06)) @ about("y", bend)
    up = part(chest, rng.uniform(0.4, 1.0))
    head = up @ about("z", rng.normal(0, 0.35)) @ about("y", rng.normal(0.05, 0.2)) @ about("x", rng.normal(0, 0.08))
    limbs = np.concatenate([arms @ chest.T, legs @ pelvis.T], 1)
    lift = np.clip((limbs[:, UPPER] @ chest[:, 2] + 0.5) / 1.5, 0, 1) * 0.5  # the shoulder rises with the arm
    clavicle = np.stack([about("x", (1 if k == 0 else -1) * lift[k]) for k in range(2)])
    return Pose(pelvis, chest, head, limbs, clavicle)


def standing(rng: np.random.Generator) -> Pose:
    """A person who stands at rest, as at the start of most recordings."""
    kind = "rest" if rng.random() < 0.7 else rng.choice(["tee", "up", "front", "hips", "crossed"])
    legs = []
    wide, turn = abs(rng.normal(0.06, 0.06)), rng.normal(0.12, 0.12)
    for k in range(2):
        knee = abs(rng.normal(0.04, 0.06))
        legs.append(leg(k, knee / 2 + rng.normal(0, 0.03), wide, turn, knee))
    if rng.random() < 0.15:  # weight on one leg
        legs[0] = leg(0, rng.uniform(0, 0.3), wide, turn, rng.uniform(0.1, 0.5))
    lean = (rng.normal(0, 0.04), rng.normal(0, 0.03), rng.normal(0, 0.1))
    return _build(rng, lean, rng.normal(0, 0.05), np.stack(legs), _arms(rng, str(kind)))


def crouch(rng: np.random.Generator, kind: str) -> Pose:
    """A pose by rule: sit, squat, bend, kneel, lunge, kick."""
    n, u = rng.normal, rng.uniform
    arms = _arms(rng, str(rng.choice(["rest", "front", "thighs", "up", "hips"])))
    if rng.random() < 0.4:
        arms = np.stack([random_arm(rng, k) for k in range(2)])
    wide, turn = abs(n(0.12, 0.12)), abs(n(0.15, 0.15))
    if kind == "sit":
        knee = u(1.1, 1.8)
        legs = np.stack([leg(k, u(1.3, 1.65), wide, turn, knee + n(0, 0.15), n(0, 0.15)) for k in range(2)])
        if rng.random() < 0.15:
            legs[1] = leg(1, u(1.6, 1.8), -0.15, 0.2, u(1.2, 1.8))
        arms = _arms(rng, "thighs") if rng.random() < 0.5 else arms
        return replace(_build(rng, (n(-0.1, 0.2), n(0, 0.05), 0), n(0.1, 0.2), legs, arms), seat=True)
    if kind == "squat":
        f = u(0.5, 2.1)
        legs = np.stack([leg(k, f, wide, turn, f * u(0.95, 1.15), -f * 0.2) for k in range(2)])
        return _build(rng, (u(0, 0.5), 0, 0), u(0, 0.4), legs, arms)
    if kind == "bend":
        f = u(0.4, 1.7)
        legs = np.stack([leg(k, f + n(0, 0.08), wide, turn, abs(n(0.15, 0.2))) for k in range(2)])
        arms = np.stack([arm(k, f * u(0.6, 1.1) + u(-0.2, 0.6), 0.1, 0.2, u(0, 0.5)) for k in range(2)])
        return _build(rng, (f, n(0, 0.1), n(0, 0.2)), u(0, 0.7), legs, arms)
    if kind == "kneel":
        both = rng.random() < 0.5
        f = u(-0.1, 0.9)
        legs = [leg(0, f, wide, turn, f + u(1.4, 1.6), 0.9), leg(1, f, wide, turn, f + u(1.4, 1.6), 0.9)]
        if not both:
            legs[1] = leg(1, u(1.3, 1.7), 0.15, 0.1, u(1.4, 1.8))
        return _build(rng, (n(0.1, 0.15), 0, 0), u(-0.1, 0.4), np.stack(legs), arms)
    if kind == "lunge":
        f = u(0.5, 1.5)
        legs = np.stack([leg(0, f, wide, 0.1, f * u(0.8, 1.2)), leg(1, -u(0.1, 0.7), wide, 0.1, u(0.1, 1.2), 0.5)])
        return _build(rng, (u(-0.05, 0.4), 0, n(0, 0.15)), n(0.05, 0.15), legs, arms)
    f, side = u(0.3, 1.9), u(0, 0.9) if rng.random() < 0.5 else 0.0  # a kick
    legs = np.stack([leg(0, f, side, u(-0.2, 0.6), u(0, 1.6), 0.4), leg(1, u(-0.2, 0.2), 0.05, 0.1, u(0, 0.3))])
    return _build(rng, (u(-0.5, 0.1), u(-0.3, 0.1), n(0, 0.3)), n(0.05, 0.2), legs, arms)


def sample(rng: np.random.Generator, poses: list[Pose]) -> Pose:
    """One pose: at rest, from motion capture (arms kept, exchanged or random) or by rule; one in ten tumbled about."""
    x = rng.random()
    if x < 0.22:
        pose = standing(rng)
    elif x < 0.42:
        pose = crouch(rng, str(rng.choice(["sit", "sit", "squat", "bend", "bend", "kneel", "lunge", "kick"])))
    else:
        pose = poses[rng.integers(len(poses))]
        for k in range(2):
            y = rng.random()
            if y < 0.2:
                pose = pose.with_arm(k, poses[rng.integers(len(poses))], int(rng.integers(2)))
            elif y < 0.4:
                pose = _with(pose, k, random_arm(rng, k) @ pose.chest.T)
    if x >= 0.22 and rng.random() < 0.5:
        head = about("z", rng.normal(0, 0.4)) @ about("y", rng.normal(0, 0.2))
        pose = replace(pose, head=pose.head @ _limited(head, 1.2))
    if rng.random() < 0.5:
        pose = pose.mirrored()
    if rng.random() < 0.1 and not pose.seat:
        pose = _tumbled(rng, pose)
    elif rng.random() < 0.03:
        flat = about("y", rng.choice([-1.0, 1.0]) * np.pi / 2) @ about("z", rng.uniform(-np.pi, np.pi))
        pose = replace(pose.turned(flat), lying=True, seat=False)
    return pose


def _with(pose: Pose, side: int, directions: Array) -> Pose:
    limbs, clavicle = pose.limbs.copy(), pose.clavicle.copy()
    limbs[side, :3] = directions
    lift = np.clip((directions[0] @ pose.chest[:, 2] + 0.5) / 1.5, 0, 1) * 0.5
    clavicle[side] = about("x", (1 if side == 0 else -1) * lift)
    return replace(pose, limbs=limbs, clavicle=clavicle)


def with_arms(pose: Pose, arms: Array, sides: tuple[int, ...] = (0, 1)) -> Pose:
    """The pose with arms (2, 3, 3) relative to the chest, on these sides."""
    for k in sides:
        pose = _with(pose, k, arms[k] @ pose.chest.T)
    return pose


def _tumbled(rng: np.random.Generator, pose: Pose) -> Pose:
    """A handstand, a cartwheel or a fall: turned far about a level axis, arms mostly overhead."""
    if rng.random() < 0.7:
        pose = with_arms(pose, _arms(rng, "up"))
    a = rng.uniform(0, np.pi)
    axis = np.array([np.cos(a), np.sin(a), 0])
    angle = np.pi + rng.normal(0, 0.4) if rng.random() < 0.5 else rng.uniform(0.6, 2.6) * rng.choice([-1, 1])
    return pose.turned(about_axis(axis, angle))
