"""J10's tables 1 and 2 on data we have: elbows and knees from known ends and silhouettes, mean errors in mm.

    python lab/experiments/ik_tables.py DATA [--out DIR]

DATA is the folder that holds rendered/ and pose2sim/; what is missing is left out. Writes a picture for each recording: the
silhouettes with the true limbs (green), plain inverse kinematics (red) and with the images (blue).
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from ik_limbs import LIMBS, Truth, errors, follow, nearest, row
from ik_pose2sim import Trial, four_cameras

import voodoo
from voodoo import ik
from voodoo.model.projection import CameraView, body_mask
from voodoo.recordings import DepthImage
from voodoo.sensors.silhouettes.still import StillScene, from_depth

KNOWN = [f"{s}_{j}" for s in "lr" for j in ("shoulder", "wrist", "hand", "hip", "ankle")] + ["head_center", "vc7"]
SIDE_CAMERA = voodoo.Camera(320, 240, 290.0, 290.0, 159.5, 119.5)
CAUTIONS = (0.2, 0.25, 0.3, 0.35, 0.4, 0.45, 0.5)
BONES = {
    "upperarm": ("shoulder", "elbow"),
    "forearm": ("elbow", "wrist"),
    "hand": ("wrist", "hand"),
    "thigh": ("hip", "knee"),
    "calf": ("knee", "ankle"),
}
"""Limb -> the joints its axis runs through."""


@dataclass
class Rendered:
    """A rendered recording: its depth camera, and a camera 3 m to the person's side that sees the body model, its arms and legs
    along the true joints."""

    name: str
    height: float
    truth: Truth
    depths: list[DepthImage]
    side: list[ik.Silhouette]

    def __post_init__(self) -> None:
        self.scene = StillScene(self.depths)

    def side_pose(self, frame: int) -> np.ndarray:
        """Pose (4, 4) of the second camera: 3 m to the side of the root."""
        return side_pose(self.truth["humanoid_root"][frame])

    def front(self, frame: int, last: Mapping[str, np.ndarray], *, deep: bool = False) -> ik.Silhouette:
        """The person cut out by depth: what hangs together with the known joints and the last estimates; `deep`: with depths."""
        depth = self.depths[frame]
        known = {name: self.truth[name][frame] for name in KNOWN}
        mask = from_depth(depth, {**known, **last}, scene=self.scene)
        observed = depth.meters() if deep else None
        return ik.Silhouette(mask, camera=depth.camera, world_from_camera=depth.root_from_sensor, depth=observed)

    def solve(self, views: int, *, deep: bool = False, **options: Any) -> dict[str, np.ndarray]:
        """Positions (F, 3) of elbows and knees with so many views; `deep`: the first one with its depths; options of
        ik.Follower."""

        def silhouettes(frame: int, last: Mapping[str, np.ndarray]) -> list[ik.Silhouette]:
            return [self.front(frame, last, deep=deep), self.side[frame]][:views]

        return follow(self.truth, self.height, silhouettes if views else None, **options)


def rendered(path: Path) -> Rendered:
    recording = voodoo.open_recording(path)
    truth = {name: recording.reference.positions[:, i] for i, name in enumerate(recording.reference.names)}
    height = recording.start["height_m"]
    tracker = voodoo.Tracker(voodoo.Body.human(height=height, model="full"))
    depths, side = [], []
    for index, recorded in enumerate(recording):
        depths.append(next(item for item in recorded.measurements if isinstance(item, DepthImage)))
        joints = {name: places[index] for name, places in truth.items()}
        estimate = tracker.reset(joints=joints, fit_sizes=index == 0)
        estimate = tracker.reset_pose(limbs_along(joints, estimate))
        pose = side_pose(joints["humanoid_root"])
        view = CameraView(SIDE_CAMERA, pose)
        mask = body_mask(tracker.body, estimate, view, width=SIDE_CAMERA.width, height=SIDE_CAMERA.height).astype(
            np.uint8
        )
        # The model's limbs leave cracks at neck and shoulders that no person has.
        for end in ("l_shoulder", "r_shoulder", "skullbase"):
            line, _ = view.project(np.stack([truth["vc7"][index], truth[end][index]]))
            cv2.line(mask, *np.rint(line).astype(int).tolist(), 1, 10)
        side.append(ik.Silhouette(mask, camera=SIDE_CAMERA, world_from_camera=pose))
    return Rendered(recording.name, height, truth, depths, side)


def side_pose(root: np.ndarray) -> np.ndarray:
    """A camera's pose (4, 4) beside the root (3,): optical axis towards -y of the root frame, y down."""
    pose = np.eye(4)
    pose[:3, :3] = np.array([[-1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, -1.0, 0.0]])
    pose[:3, 3] = root + np.array((0.0, 3.0, 0.2))
    return pose


def limbs_along(joints: Mapping[str, np.ndarray], estimate: voodoo.Estimate) -> dict[str, np.ndarray]:
    """The poses (4, 4) of all limbs, those of arms and legs moved so that their axes run from joint to joint exactly: no body of
    constant sizes and exact joints can, since real shoulders shift and knees are no hinges."""
    poses = {name: pose.copy() for name, pose in estimate.world_from_limb.items()}
    for side in "lr":
        for limb, (first, last) in BONES.items():
            pose, start, end = poses[f"{side}_{limb}"], joints[f"{side}_{first}"], joints[f"{side}_{last}"]
            way = (end - start) / np.linalg.norm(end - start)
            axis = np.cross(pose[:3, 2], way)
            sine = float(np.linalg.norm(axis))
            if sine > 1e-9:
                turn, _ = cv2.Rodrigues(axis / sine * np.arctan2(sine, pose[:3, 2] @ way))
                pose[:3, :3] = turn @ pose[:3, :3]
            pose[:3, 3] = start
        poses[f"{side}_foot"][:3, 3] += joints[f"{side}_ankle"] - estimate.joints[f"{side}_ankle"]
    return poses


def picture(
    image: ik.Silhouette, pose: np.ndarray, known: Mapping[str, np.ndarray], joints: Sequence[Mapping]
) -> np.ndarray:
    """A silhouette with the limbs of the truth and of two solutions: joint -> (3,), at twice its size."""
    mask = np.where(image.distance[..., None] < 0.0, 255, 90).astype(np.uint8).repeat(3, axis=2)
    canvas = cv2.resize(mask, None, fx=2, fy=2, interpolation=cv2.INTER_NEAREST)
    view = CameraView(image.camera, pose)
    for color, width, middle in zip(((0, 160, 0), (0, 0, 230), (230, 60, 0)), (4, 2, 2), joints, strict=True):
        for joint, (_, first, last) in LIMBS.items():
            line, _ = view.project(np.stack([known[first], middle[joint], known[last]]))
            if np.isfinite(line).all():
                points = np.rint(2.0 * line + 0.5).astype(np.int32)
                cv2.polylines(canvas, [points], False, color, width, cv2.LINE_AA)
    return canvas


def mean(found: Mapping[str, np.ndarray], truth: Truth, joint: str) -> float:
    """Mean error [mm] over both sides of "elbow", "knee", or "both"."""
    some = [error for name, error in errors(found, truth).items() if joint in ("both", name[2:])]
    return float(1e3 * np.nanmean(some))


def spread(trial: Trial, cameras: Sequence[str], **options: Any) -> list[str]:
    """Mean errors [mm] of elbows, knees and both from the nearest chains, over some cautions around the default (least to most):
    small changes move the solution of a sequence from one valley to another, so one figure alone says little."""
    found = [trial.solve(cameras, trial.steady, caution=caution, **options) for caution in CAUTIONS]
    words = []
    for joint in ("elbow", "knee", "both"):
        means = [mean(one, trial.steady, joint) for one in found]
        words.append(f"{np.mean(means):.1f} ({min(means):.1f} to {max(means):.1f})")
    return words


def all_sets(trial: Trial) -> None:
    """The table of every set of cameras, and what the keypoints that the truth was triangulated from say in their place."""
    plain = trial.solve((), trial.steady)
    halves = [0.5 * mean(plain, trial.steady, joint) for joint in ("elbow", "knee", "both")]
    resting = 0.5 * mean(trial.solve((), trial.steady, rest="mean"), trial.steady, "both")
    print(
        "\n| cameras | elbow | knee | both | both, at rest | keypoints: elbow | knee | both |\n|---|---|---|---|---|---|---|---|"
    )
    print("| half of plain | " + " | ".join(f"{half:.1f}" for half in [*halves, resting]) + " | | | |")
    for count in range(1, len(trial.views) + 1):
        for cameras in combinations(trial.views, count):
            turned = trial.keypoints.turned(cameras, trial.steady)
            own = [f"{mean(turned, trial.steady, joint):.1f}" for joint in ("elbow", "knee", "both")]
            name = " ".join(camera[-2:] for camera in cameras) + (" (best)" if cameras == trial.best(count) else "")
            found = [*spread(trial, cameras), spread(trial, cameras, rest="mean")[-1]]
            print(f"| {name} | " + " | ".join(found + own) + " |", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", type=Path)
    parser.add_argument("--out", type=Path, default=Path("out/ik_tables"))
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    print(
        "| sequence | joint | plain | 1 view | 2 views | 1 with depth | 2, the first with depth "
        "| at rest: plain | 1 view | 2 views |\n"
        "|---|---|---|---|---|---|---|---|---|---|"
    )
    for name in sorted(path.parent.name for path in (arguments.data / "rendered").glob("*/bag")):
        if not (arguments.data / "rendered" / name).is_dir():
            continue
        sequence = rendered(arguments.data / "rendered" / name)
        found = [sequence.solve(views) for views in (0, 1, 2)] + [sequence.solve(views, deep=True) for views in (1, 2)]
        found += [sequence.solve(views, rest="mean") for views in (0, 1, 2)]
        for joint in ("elbow", "knee", "both"):
            print(row(name, joint, [errors(one, sequence.truth) for one in found]))
        tiles = []
        for frame in np.linspace(10, len(sequence.depths) - 1, 4).astype(int):
            then = [{joint: places[joint][frame] for joint in LIMBS} for places in (sequence.truth, found[0], found[1])]
            known = {site: places[frame] for site, places in sequence.truth.items()}
            view = sequence.front(frame, then[2])
            tiles.append(picture(view, sequence.depths[frame].root_from_sensor, known, then))
        cv2.imwrite(str(arguments.out / f"{name}.png"), np.hstack(tiles))
    if (arguments.data / "pose2sim").is_dir():
        trial = four_cameras(arguments.data / "pose2sim")
        sets = ((), trial.best(1), trial.best(2), trial.agreeing, tuple(trial.views))
        print("\n2-D keypoints off by: " + ", ".join(f"{name} {pixels:.1f} px" for name, pixels in trial.apart.items()))
        print("borders (smaller pictures): " + ", ".join(f"{name} {trial.border(name):.1f} px" for name in trial.views))
        print(
            "\n| real cameras, known and error from | joint | plain | best 1 | best 2 | those that agree | all 4 | best turn |\n"
            "|---|---|---|---|---|---|---|---|"
        )
        solved = {}
        for name, truth, options in (
            ("the triangulation", trial.truth, {}),
            ("its nearest chains", trial.steady, {}),
            ("the same, at rest", trial.steady, {"rest": "mean"}),
        ):
            found = [*(trial.solve(cameras, truth, **options) for cameras in sets), nearest(truth)]
            solved[name] = found
            for joint in LIMBS:
                means = [1e3 * errors(one, truth)[joint].mean() for one in found]
                print(f"| {name} | {joint} | " + " | ".join(f"{mean:.1f}" for mean in means) + " |")
            for joint in ("elbow", "knee", "both"):
                print(row(name, joint, [errors(one, truth) for one in found]))
        all_sets(trial)
        moved = {name: np.linalg.norm(trial.steady[name] - trial.truth[name], axis=1) for name in trial.truth}
        print("\nmoved, mean mm: " + ", ".join(f"{n} {1e3 * d.mean():.1f}" for n, d in moved.items() if d.any()))
        frame, found = 50, solved["its nearest chains"]
        then = [{joint: places[joint][frame] for joint in LIMBS} for places in (trial.steady, found[0], found[3])]
        known = {site: places[frame] for site, places in trial.steady.items()}
        views = [picture(view[frame], pose, known, then) for view, pose in trial.views.values()]
        cv2.imwrite(str(arguments.out / "pose2sim.png"), np.hstack(views))


if __name__ == "__main__":
    main()
