"""Skinned bodies: a pose to the surface in clothes and the exact places of the joints."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lab.training import raster
from lab.training.poses import FOOT, FORE, HAND, SHANK, THIGH, UPPER, Pose
from lab.training.rotations import about_axis, frame, part, shortest, unit

Array = NDArray[np.float64]
PAIRS = ("shoulder", "elbow", "wrist", "hand", "hip", "knee", "ankle")
JOINTS = ("head_center", "vc7", "humanoid_root", *(s + p for p in PAIRS for s in ("l_", "r_")))
BONES = ("upper_arm", "forearm", "thigh", "shank", "shoulder_width", "hip_width", "trunk", "neck")
HELD_OUT_BODIES = 10  # the last ones are kept for validation
REGIONS = {
    "head": ("Neck1", "Head"),
    "trunk": (
        "Hips",
        "LowerBack",
        "Spine",
        "Spine1",
        "Neck",
        "LHipJoint",
        "RHipJoint",
        "LeftShoulder",
        "RightShoulder",
    ),
    "upper": ("LeftArm", "RightArm"),
    "fore": ("LeftForeArm", "RightForeArm"),
    "thigh": ("LeftUpLeg", "RightUpLeg"),
    "shank": ("LeftLeg", "RightLeg"),
    "foot": ("LeftFoot", "RightFoot", "LeftToeBase", "RightToeBase"),
}
CHAINS = (("LeftShoulder", "LeftArm", "LeftForeArm", "LeftHand", "LThumb", "LeftFingerBase", "LeftHandFinger1",
           "LHipJoint", "LeftUpLeg", "LeftLeg", "LeftFoot", "LeftToeBase"),
          ("RightShoulder", "RightArm", "RightForeArm", "RightHand", "RThumb", "RightFingerBase", "RightHandFinger1",
           "RHipJoint", "RightUpLeg", "RightLeg", "RightFoot", "RightToeBase"))  # fmt: skip


@dataclass(frozen=True)
class Body:
    """One body of the set: vertices (V, 3), bone starts (31, 3) and sites (17, 3) at rest, in meters."""

    set: Bodies
    vertices: Array
    heads: Array
    sites: dict[str, Array]

    @cached_property
    def stature(self) -> float:
        """Height at rest, m."""
        return float(np.ptp(self.vertices[:, 2]))

    @cached_property
    def lengths(self) -> Array:
        """Lengths of `BONES` and the stature, m: (9,)."""
        s = self.sites

        def d(a: str, b: str) -> float:
            return float(np.linalg.norm(s[a] - s[b]))

        limbs = [d("l_shoulder", "l_elbow"), d("l_elbow", "l_wrist"), d("l_hip", "l_knee"), d("l_knee", "l_ankle")]
        widths = [d("l_shoulder", "r_shoulder"), d("l_hip", "r_hip")]
        return np.array([*limbs, *widths, d("humanoid_root", "vc7"), d("vc7", "head_center"), self.stature])

    def rotations(self, pose: Pose, twist: Array) -> Array:
        """Rotation of each bone, (31, 3, 3); `twist` (2,) turns the hands about the forearms (radians)."""
        b, s = self.set.bone, self.sites
        r = np.tile(np.eye(3), (len(b), 1, 1))
        between = pose.pelvis.T @ pose.chest
        r[b["Hips"]], r[b["Spine1"]] = pose.pelvis, pose.chest
        r[b["LowerBack"]] = pose.pelvis @ part(between, 0.35)
        r[b["Spine"]] = pose.pelvis @ part(between, 0.7)
        nod = pose.chest.T @ pose.head
        r[b["Neck"]], r[b["Neck1"]], r[b["Head"]] = pose.chest @ part(nod, 0.3), pose.chest @ part(nod, 0.65), pose.head
        for k, side in enumerate("lr"):
            names, p = CHAINS[k], pose.limbs[k]
            at = [s[f"{side}_{n}"] for n in PAIRS]
            r[b[names[0]]] = collar = pose.chest @ pose.clavicle[k]
            arm = _limb(collar, at[1] - at[0], at[2] - at[1], p[UPPER], p[FORE], None)
            r[b[names[1]]], fore = arm
            r[b[names[2]]] = part_twist(p[FORE], twist[k] / 2) @ fore
            turned = part_twist(p[FORE], twist[k]) @ fore
            for name in names[3:7]:
                r[b[name]] = shortest(unit(turned @ unit(at[3] - at[2])), p[HAND]) @ turned
            r[b[names[7]]] = pose.pelvis
            r[b[names[8]]], r[b[names[9]]] = _limb(
                pose.pelvis, at[5] - at[4], at[6] - at[5], p[THIGH], p[SHANK], np.array([0, 1.0, 0])
            )
            toe = unit(self.heads[b[names[11]]] - at[6])
            foot = shortest(unit(r[b[names[9]]] @ toe), p[FOOT]) @ r[b[names[9]]]
            r[b[names[10]]] = r[b[names[11]]] = foot
        return r

    def posed(self, pose: Pose, rng: np.random.Generator, dressed: bool = True) -> tuple[Array, dict[str, Array]]:
        """The surface (V, 3) and the joints, in meters, the pelvis at the origin."""
        r = self.rotations(pose, rng.normal(0.0, 0.5, 2))
        p = np.zeros((len(r), 3))
        for i, parent in enumerate(self.set.parent):
            if parent >= 0:
                p[i] = p[parent] + r[parent] @ (self.heads[i] - self.heads[parent])
        shift = p - np.einsum("bij,bj->bi", r, self.heads)
        points = raster.skin(self.vertices, self.set.skin_bone, self.set.skin_weight, r, shift)
        at = self.set.site_bone
        joints = {n: r[at[n]] @ (v - self.heads[at[n]]) + p[at[n]] for n, v in self.sites.items()}
        if dressed:
            points += raster.normals(points, self.set.faces) * self.cloth(rng)[:, None]
        return points, joints

    def cloth(self, rng: np.random.Generator) -> Array:
        """How far clothes, hair and shoes stand off the skin at each vertex, m: (V,)."""
        w, v = self.set.region, self.vertices
        base = rng.uniform(0.003, 0.024)
        top, bottom = rng.uniform(0.5, 1.1), rng.uniform(0.4, 1.1)
        sleeve, trouser = rng.random() < 0.6, rng.random() < 0.75
        off = base * (top * (w["trunk"] + w["upper"] + (0.9 * w["fore"] if sleeve else 0)))
        off += base * bottom * (w["thigh"] + (rng.uniform(0.7, 1.6) * w["shank"] if trouser else 0))
        wave = np.zeros(len(v))
        for _ in range(3):
            k = rng.normal(0, 1, 3) * rng.uniform(8, 40)
            wave += np.sin(v @ k + rng.uniform(0, 6.3))
        off = off * (1 + 0.25 * wave) + rng.uniform(0, 0.015) * w["foot"]
        skull = self.sites["head_center"]
        scalp = np.clip((v[:, 2] - skull[2] + 0.02) / 0.05, 0, 1) + np.clip((skull[0] - 0.02 - v[:, 0]) / 0.04, 0, 1)
        off += rng.choice([0.0, 0.01, 0.02, 0.035]) * w["head"] * np.clip(scalp, 0, 1)
        return np.clip(off, 0, 0.05)


def part_twist(axis: Array, angle: float) -> Array:
    """A turn about a limb's direction."""
    return about_axis(unit(axis), angle)


def _limb(parent: Array, d0: Array, e0: Array, d: Array, e: Array, hinge: Array | None) -> tuple[Array, Array]:
    """Rotations of the two parts of a limb from their directions at rest (d0, e0) and now (d, e).

    The hinge between them turns the first about its length; where the limb is straight it follows the parent.
    """
    d0, e0 = unit(d0), unit(e0)
    h0 = unit(np.cross(d0, e0)) if hinge is None else hinge
    easy = shortest(parent @ d0, d) @ parent @ h0
    bend = np.cross(d, e)
    s = float(np.linalg.norm(bend))
    w = np.clip((s - 0.15) / 0.35, 0, 1)
    h = (1 - w) * easy + w * bend / (s + 1e-9)
    h = h - (h @ d) * d
    if np.linalg.norm(h) < 0.1:
        h = easy
    return frame(d, h) @ frame(d0, h0).T, frame(e, h) @ frame(e0, h0).T


class Bodies:
    """The set of bodies in `bodies.npz`; `held_out` picks those kept for validation."""

    def __init__(self, place: Path, *, held_out: bool) -> None:
        """Read the set from a folder."""
        data = np.load(place / "bodies.npz")
        count = len(data["vertices_tenth_mm"])
        self.use = list(range(count - HELD_OUT_BODIES, count) if held_out else range(count - HELD_OUT_BODIES))
        self.faces = data["faces"].astype(np.int32)
        self.bone = {str(n): i for i, n in enumerate(data["bone_names"])}
        self.parent = [int(p) for p in data["bone_parent"]]
        self.skin_bone = data["skin_bone"].astype(np.int32)
        self.skin_weight = data["skin_weight"].astype(np.float64)
        self.skin_weight /= self.skin_weight.sum(1, keepdims=True)
        self.site_bone = {str(n): self.bone[str(b)] for n, b in zip(data["site_names"], data["site_bone"], strict=True)}
        self.region = {}
        for name, bones in REGIONS.items():
            ids = [self.bone[n] for n in bones]
            self.region[name] = (np.isin(self.skin_bone, ids) * self.skin_weight).sum(1)
        self._vertices = data["vertices_tenth_mm"]
        self._heads, self._sites = data["bone_head_m"].astype(float), data["site_rest_m"].astype(float)
        self._names = [str(n) for n in data["site_names"]]
        self._made: dict[int, Body] = {}

    def __len__(self) -> int:
        """Number of bodies."""
        return len(self.use)

    def __getitem__(self, i: int) -> Body:
        """A body; they are kept once made."""
        k = self.use[i]
        if k not in self._made:
            sites = dict(zip(self._names, self._sites[k], strict=True))
            self._made[k] = Body(self, self._vertices[k].astype(float) / 1e4, self._heads[k], sites)
        return self._made[k]
