"""J10's experiment, limb by limb: trunk and wrists (ankles) known, elbows (knees) estimated from the first frame on."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

import voodoo
from voodoo import ik

LIMBS = {
    f"{side}_{joint}": (tuple(f"{side}_{limb}" for limb in limbs), f"{side}_{first}", f"{side}_{last}")
    for side in "lr"
    for joint, limbs, first, last in (
        ("elbow", ("upperarm", "forearm"), "shoulder", "wrist"),
        ("knee", ("thigh", "calf"), "hip", "ankle"),
    )
}
"""Estimated joint -> limbs of its chain, and the known joints at its ends."""
OTHER = {joint: ("r" if joint[0] == "l" else "l") + joint[1:] for joint in LIMBS}
"""Estimated joint -> that of the other side, whose limbs are where they were last."""
TRUNK = ("l_shoulder", "r_shoulder", "vc7", "l_hip", "r_hip")

Truth = Mapping[str, np.ndarray]
Silhouettes = Callable[[int, Mapping[str, np.ndarray]], Sequence[ik.Silhouette]]
"""Of a frame, given where the estimated joints (3,) were last."""


def rotation(local: np.ndarray, world: np.ndarray) -> np.ndarray:
    """The rotation (3, 3) that turns points (N, 3) best (Kabsch)."""
    u, _, vt = np.linalg.svd((local - local.mean(0)).T @ (world - world.mean(0)))
    return vt.T @ np.diag([1.0, 1.0, np.linalg.det(vt.T @ u.T)]) @ u.T


class Bodies:
    """The ten-limb body sized by the first frame of `steady`, its arms and legs as chains on the trunk, and where the trunk is.

    Args:
        truth: site -> positions (F, 3) [m].
        height: stature [m].
    """

    def __init__(self, truth: Truth, height: float) -> None:
        tracker = voodoo.Tracker(voodoo.Body.human(height=height, model="papers"))
        for sites, fit_sizes in ((steady(truth), True), (truth, False)):
            estimate = tracker.reset(joints={name: places[0] for name, places in sites.items()}, fit_sizes=fit_sizes)
        torso = estimate.world_from_limb["torso"]
        self._truth = truth
        self._local = {name: (np.linalg.inv(torso) @ [*places[0], 1.0])[:3] for name, places in truth.items()}
        self._trunk = [name for name in TRUNK if name in truth]
        self.chains = {joint: ik.Chain(tracker.body, limbs=limbs) for joint, (limbs, _, _) in LIMBS.items()}
        self.starts = {
            joint: chain.project(estimate.world_from_limb, world_from_base=torso, closest=False)
            for joint, chain in self.chains.items()
        }

    def base(self, frame: int, joint: str) -> np.ndarray:
        """Pose (4, 4) of the trunk by its known sites, with the first joint of this arm or leg where it is known to be."""
        first = LIMBS[joint][1]
        base = np.eye(4)
        base[:3, :3] = rotation(
            np.stack([self._local[name] for name in self._trunk]),
            np.stack([self._truth[name][frame] for name in self._trunk]),
        )
        base[:3, 3] = self._truth[first][frame] - base[:3, :3] @ self._local[first]
        return base


def follow(truth: Truth, height: float, silhouettes: Silhouettes | None, **options: Any) -> dict[str, np.ndarray]:
    """Positions (F, 3) of elbows and knees, each a chain of two limbs on the trunk that ends at its known joint.

    Args:
        truth: site -> positions (F, 3) [m].
        height: stature [m].
        silhouettes: None: plain inverse kinematics.
        **options: of ik.Follower; `rest` may be a function of the chain and its first angles.
    """
    bodies = Bodies(truth, height)
    followers = {}
    for joint, chain in bodies.chains.items():
        start, rest = bodies.starts[joint], options.get("rest")
        chosen = {**options, "rest": rest(chain, start) if callable(rest) else rest}
        followers[joint] = ik.Follower(chain, start=start, **chosen)
    last = {joint: truth[joint][0] for joint in LIMBS}
    found: dict[str, list[np.ndarray]] = {joint: [] for joint in LIMBS}
    postures: dict[str, ik.Posture] = {}
    for frame in range(len(truth["l_hip"])):
        images = [] if silhouettes is None else silhouettes(frame, last)
        for joint, (_, _, end) in LIMBS.items():
            other = postures.get(OTHER[joint])
            posture = followers[joint].step(
                {end: truth[end][frame]},
                images=images,
                world_from_base=bodies.base(frame, joint),
                others=None if other is None else other.world_from_limb,
            )
            postures[joint] = posture
            last[joint] = posture.joints[joint]
            found[joint].append(last[joint])
    return {joint: np.array(places) for joint, places in found.items()}


def limb_lengths(truth: Truth) -> dict[str, np.ndarray]:
    """Lengths (F, 2) [m] of the two limbs of every chain."""
    return {
        joint: np.stack([np.linalg.norm(truth[joint] - truth[end], axis=1) for end in (first, last)], axis=1)
        for joint, (_, first, last) in LIMBS.items()
    }


def steady(truth: Truth) -> dict[str, np.ndarray]:
    """The truth with every arm and leg replaced by the nearest one (least squares over its three joints) of the median lengths.

    Exact truth stays as it is; triangulated limbs change their lengths from frame to frame, which no chain can follow.
    """
    found = dict(truth)
    for joint, (_, first, last) in LIMBS.items():
        names = (first, joint, last)
        lengths = np.median(limb_lengths(truth)[joint], axis=0)
        measured = np.stack([truth[name] for name in names], axis=1)
        places = measured.copy()
        # Least squares under two constraints, each linearized where the last step led.
        for _ in range(50):
            bones = np.diff(places, axis=1)
            now = np.linalg.norm(bones, axis=2)
            ways = bones / now[..., None]
            rows = np.zeros((len(places), 2, 3, 3))
            for bone in (0, 1):
                rows[:, bone, bone], rows[:, bone, bone + 1] = -ways[:, bone], ways[:, bone]
            rows = rows.reshape(-1, 2, 9)
            expected = (lengths - now)[..., None] + rows @ (places - measured).reshape(-1, 9, 1)
            step = rows.transpose(0, 2, 1) @ np.linalg.solve(rows @ rows.transpose(0, 2, 1), expected)
            places = measured + step.reshape(-1, 3, 3)
        found.update({name: places[:, index] for index, name in enumerate(names)})
    return found


def nearest(truth: Truth) -> dict[str, np.ndarray]:
    """Positions (F, 3) of elbows and knees as near to the truth as limbs of the median lengths between the known ends can
    have them: what remains is beyond any inverse kinematics, since all it has to choose is the turn about the line between them.
    """
    found = {}
    for joint, (_, first, last) in LIMBS.items():
        upper, lower = np.median(limb_lengths(truth)[joint], axis=0)
        start, way = truth[first], truth[last] - truth[first]
        apart = np.linalg.norm(way, axis=1, keepdims=True)
        way = way / apart
        # What the limbs cannot span, or cannot fold to, they meet stretched or folded.
        apart = np.clip(apart, abs(upper - lower), upper + lower)
        along = (apart**2 + upper**2 - lower**2) / (2.0 * apart)
        side = truth[joint] - start
        side -= (side * way).sum(axis=1, keepdims=True) * way
        side /= np.maximum(np.linalg.norm(side, axis=1, keepdims=True), 1e-12)
        found[joint] = start + along * way + np.sqrt(np.maximum(upper**2 - along**2, 0.0)) * side
    return found


def errors(found: Mapping[str, np.ndarray], truth: Truth) -> dict[str, np.ndarray]:
    """Distance (F,) [m] of every estimated joint from its truth."""
    return {joint: np.linalg.norm(places - truth[joint], axis=1) for joint, places in found.items()}


def row(name: str, joint: str, variants: Sequence[Mapping[str, np.ndarray]]) -> str:
    """A row of the table: mean error [mm] over both sides (of "elbow", "knee", or "both"), for each way to solve."""
    joints = [name for name in LIMBS if joint in ("both", name[2:])]
    means = [1e3 * np.mean([error[name] for name in joints]) for error in variants]
    return f"| {name} | {joint} | " + " | ".join(f"{mean:.1f}" for mean in means) + " |"
