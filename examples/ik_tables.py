"""J10's tables 1 and 2 on data we have: elbows and knees from known ends and silhouettes.

    python examples/ik_tables.py DATA [--out DIR]

DATA is the folder that holds rendered/ and pose2sim/. A limb is J10's: two segments, two joints of three freedoms
each. Known
are the shoulder and the wrist (the hip and the ankle); the elbow (knee) is estimated, from the true one in the first
frame on.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

import voodoo
from voodoo import ik
from voodoo.recordings import DepthImage
from voodoo.silhouettes import from_depth
from voodoo.views import CameraView, silhouette

LIMBS = {"elbow": ("shoulder", "elbow", "wrist"), "knee": ("hip", "knee", "ankle")}
MARGIN = 0.8


TRUNK = ("l_shoulder", "r_shoulder", "vc7", "l_hip", "r_hip")


def rotation(local: np.ndarray, world: np.ndarray) -> np.ndarray:
    """The rotation (3, 3) that turns points (N, 3) best (Kabsch)."""
    u, _, vt = np.linalg.svd((local - local.mean(0)).T @ (world - world.mean(0)))
    return vt.T @ np.diag([1.0, 1.0, np.linalg.det(vt.T @ u.T)]) @ u.T


def follow(
    truth: dict[str, np.ndarray], height: float, side: str, joint: str, images: list[list[ik.Silhouette]], margin: float
) -> np.ndarray:
    """Positions (F, 3) of an elbow or knee. Known: all joints in the first frame; then the trunk, hence the shoulder
    or hip,
    and the wrist or ankle."""
    first, middle, last = (f"{side}_{name}" for name in LIMBS[joint])
    tracker = voodoo.Tracker(voodoo.Body.human(height=height, model="papers"))
    estimate = tracker.reset(joints={name: places[0] for name, places in truth.items()})
    limbs = [f"{side}_{name}" for name in (("upperarm", "forearm") if joint == "elbow" else ("thigh", "calf"))]
    chain = ik.Chain(tracker.body, limbs=limbs)
    torso = estimate.world_from_limb["torso"]
    local = np.stack([np.linalg.inv(torso) @ [*truth[name][0], 1.0] for name in TRUNK])[:, :3]
    pivot = (np.linalg.inv(torso) @ [*truth[first][0], 1.0])[:3]
    follower = ik.Follower(
        chain,
        start=chain.project(estimate.world_from_limb, world_from_base=torso, closest=False),
        steps=15,
        margin=margin,
    )
    found = []
    for frame, pictures in enumerate(images):
        base = np.eye(4)
        base[:3, :3] = rotation(local, np.stack([truth[name][frame] for name in TRUNK]))
        base[:3, 3] = truth[first][frame] - base[:3, :3] @ pivot
        posture = follower.step({last: truth[last][frame]}, images=pictures, world_from_base=base)
        found.append(posture.joints[middle])
    return np.array(found)


@dataclass
class Sequence:
    name: str
    height: float
    truth: dict[str, np.ndarray]
    views: list[list[ik.Silhouette]]
    """One list of silhouettes (a frame each) a view."""


def rendered(path: Path) -> Sequence:
    """First view: the depth camera, person cut out by connected depth from head, hands, feet, shoulders and hips.
    Second
    view: the body model at the true joints, seen by a camera 3 m to the person's side."""
    recording = voodoo.open_recording(path)
    reference = recording.reference
    truth = {name: reference.positions[:, i] for i, name in enumerate(reference.names)}
    names = [f"{s}_{j}" for s in "lr" for j in ("shoulder", "wrist", "hand", "hip", "ankle")] + ["head_center", "vc7"]
    tracker = voodoo.Tracker(voodoo.Body.human(height=recording.start["height_m"], model="full"))
    camera = voodoo.Camera(320, 240, 290.0, 290.0, 159.5, 119.5)
    views: list[list[ik.Silhouette]] = [[], []]
    for index, recorded in enumerate(recording):
        depth = next(item for item in recorded.measurements if isinstance(item, DepthImage))
        mask = from_depth(depth, {name: truth[name][index] for name in names})
        views[0].append(ik.Silhouette(mask, camera=depth.camera, world_from_camera=depth.root_from_sensor))
        estimate = tracker.reset(joints={name: places[index] for name, places in truth.items()})
        root = truth["humanoid_root"][index]
        # Optical axis towards -y of the root frame, x to the front's left, y down.
        pose = np.eye(4)
        pose[:3, :3] = np.array([[-1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, -1.0, 0.0]])
        pose[:3, 3] = root + np.array((0.0, 3.0, 0.2))
        side = silhouette(tracker.body, estimate, CameraView(camera, pose), width=320, height=240).astype(np.uint8)
        # The model's limbs leave cracks at neck and shoulders that no person has.
        for end in ("l_shoulder", "r_shoulder", "skullbase"):
            line, _ = CameraView(camera, pose).project(np.stack([truth["vc7"][index], truth[end][index]]))
            cv2.line(side, *np.rint(line).astype(int).tolist(), 1, 10)
        views[1].append(ik.Silhouette(side, camera=camera, world_from_camera=pose))
    return Sequence(recording.name, recording.start["height_m"], truth, views)


def table(sequence: Sequence, joint: str, views: list[int], margin: float) -> dict[str, np.ndarray]:
    """Errors (F,) [m] of the joint on both sides."""
    errors = {}
    for side in "lr":
        name = f"{side}_{joint}"
        images = [[sequence.views[view][frame] for view in views] for frame in range(len(sequence.truth[name]))]
        found = follow(sequence.truth, sequence.height, side, joint, images, margin)
        errors[name] = np.linalg.norm(found - sequence.truth[name], axis=1)
    return errors


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", type=Path)
    parser.add_argument("--margin", type=float, default=MARGIN)
    arguments = parser.parse_args()
    print("| sequence | joint | IK (mm) | 1 view (mm) | 2 views (mm) |")
    print("|---|---|---|---|---|")
    for name, joint in (
        ("dev_03_punch", "elbow"),
        ("dev_05_walk", "knee"),
        ("dev_05_walk", "elbow"),
        ("dev_03_punch", "knee"),
    ):
        sequence = rendered(arguments.data / "rendered" / name)
        rows = [table(sequence, joint, views, arguments.margin) for views in ([], [0], [0, 1])]
        for key in rows[0]:
            print(f"| {name} | {key} | " + " | ".join(f"{1e3 * row[key].mean():.1f}" for row in rows) + " |")
        means = [1e3 * np.mean(list(row.values())) for row in rows]
        print(f"| {name} | both | " + " | ".join(f"{mean:.1f}" for mean in means) + " |")


if __name__ == "__main__":
    main()
