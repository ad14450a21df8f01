"""Four real color cameras and a keypoint network: rays alone carry the body (the balancing trial of Pose2Sim).

    python lab/experiments/fusion_pose2sim.py ../shared/data/pose2sim --out out/pose2sim

Writes table.md, errors.png (error over time) and skeletons.png (the pose drawn into the cameras' pictures). The body
is the ten-limb one, because the keypoints say nothing about waist and neck (`--model full`: that of eighteen limbs); the
tracker's parameters are the defaults. The column "triangulated" is the mean distance of the same rays' common points,
each joint alone, where rays farther than 25 cm from the reference are left out: what this data can give without a body.
"""

import argparse
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import matplotlib
import numpy as np

import voodoo
from voodoo.evaluation.metrics import JOINTS
from voodoo.pipeline.front_end import FrontEnd
from voodoo.recordings import KeypointImage, RecordedFrame, Recording, open_recording
from voodoo.sensors.keypoints.sites import nearest_person, site_pixels
from voodoo.sensors.pixels import in_sensor, world_rays
from voodoo.sensors.settings import FrontEndSettings

matplotlib.use("Agg")
import matplotlib.pyplot as plt

CONFIG = voodoo.Config()
BONES = (
    ("shoulder", "elbow"), ("elbow", "wrist"), ("hip", "knee"), ("knee", "ankle"), ("shoulder", "hip"),
)  # fmt: skip


@dataclass(frozen=True)
class Run:
    """One way to track the recording: error (F, 12) [m], estimates, mean time of a step [s], rays a frame, error [m] of the
    rays' common points."""

    name: str
    errors: np.ndarray
    estimates: list[voodoo.Estimate]
    seconds: float
    kept: float
    triangulated: float


def corrupted(recording: Recording, fraction: float, seed: int) -> Iterator[RecordedFrame]:
    """The recording with a share of all keypoints at random pixels, as sure of themselves as they were."""
    chance = np.random.default_rng(seed)
    for recorded in recording:
        items = []
        for item in recorded.measurements:
            people = []
            for person in item.people:
                wrong = chance.random(len(person)) < fraction
                person = person.copy()
                size = (item.camera.width, item.camera.height)
                person[wrong, :2] = chance.uniform((0, 0), size, (int(wrong.sum()), 2))
                people.append(person)
            items.append(replace(item, people=tuple(people)))
        yield RecordedFrame(recorded.stamp, tuple(items))


def triangulated(recording: Recording, seed: int, outliers: float) -> float:
    """Mean distance [m] of the points nearest to the rays of each joint (least squares, confidences as weights)."""
    reference = recording.reference
    errors = []
    for index, recorded in enumerate(corrupted(recording, outliers, seed)):
        places = dict(zip(reference.names, reference.positions[index], strict=True))
        normal = {name: (np.zeros((3, 3)), np.zeros(3)) for name in JOINTS}
        for item in recorded.measurements:
            person = nearest_person(item, predicted=places)
            if person is None:
                continue
            observed = [part for part in site_pixels(person, layout=item.layout)[0] if part.site in normal]
            if not observed:
                continue
            origin, directions = world_rays(item.camera, item.root_from_sensor, [part.pixel for part in observed])
            for part, direction in zip(observed, directions, strict=True):
                across = part.confidence**2 * (np.eye(3) - np.outer(direction, direction))
                if np.linalg.norm(np.cross(direction, places[part.site] - origin)) < 0.25:
                    normal[part.site][0][...] += across
                    normal[part.site][1][...] += across @ origin
        for name, (matrix, vector) in normal.items():
            if np.linalg.cond(matrix) < 1e4:
                errors.append(np.linalg.norm(np.linalg.solve(matrix, vector) - places[name]))
    return float(np.mean(errors))


def track(path: Path, name: str, config: voodoo.Config, *, model="papers", cameras=None, outliers=0.0, seed=1) -> Run:
    recording = open_recording(path, loader="pose2sim", **({} if cameras is None else {"cameras": cameras}))
    tracker = voodoo.Tracker(voodoo.Body.human(model=model), config=config)
    tracker.reset(joints=recording.start["joints"], fit_sizes=True)
    front_end = FrontEnd(tracker, settings=FrontEndSettings(use=("keypoints",)))
    reference = recording.reference
    columns = [reference.names.index(name) for name in JOINTS]
    errors, estimates, seconds = [], [], 0.0
    observed = 0
    for index, recorded in enumerate(corrupted(recording, outliers, seed)):
        began = time.process_time()
        estimate = front_end.step(recorded)
        seconds += time.process_time() - began
        observed += sum(len(report.rays) for report in front_end.reports.values())
        estimates.append(estimate)
        found = np.array([estimate.joints[name] for name in JOINTS])
        errors.append(np.linalg.norm(found - reference.positions[index, columns], axis=1))
    alone = triangulated(recording, seed, outliers)
    return Run(name, np.array(errors), estimates, seconds / len(errors), observed / len(errors), alone)


def draw(path: Path, run: Run, file: Path, frame: int) -> None:
    """The pose of one frame in the picture of each camera."""
    recording = open_recording(path, loader="pose2sim")
    items: tuple[KeypointImage, ...] = next(item for i, item in enumerate(recording) if i == frame).measurements
    tiles = []
    for number, item in enumerate(items, start=1):
        video = cv2.VideoCapture(str(path / "videos" / f"cam{number:02d}.mp4"))
        video.set(cv2.CAP_PROP_POS_FRAMES, frame)
        ok, picture = video.read()
        if not ok:
            picture = np.zeros((item.camera.height, item.camera.width, 3), np.uint8)
        joints = run.estimates[frame].joints
        pixels = {
            name: tuple(np.round(item.camera.project(in_sensor(item.root_from_sensor, [position]))[0]).astype(int))
            for name, position in joints.items()
        }
        for u, v, confidence in item.people[0] if item.people else ():
            if confidence > 0.1:
                cv2.circle(picture, (round(u), round(v)), 9, (0, 255, 255), 3)
        lines = [(f"{side}_{a}", f"{side}_{b}") for side in "lr" for a, b in BONES]
        lines += [("l_shoulder", "r_shoulder"), ("l_hip", "r_hip"), ("vc7", "skull_tip")]
        for a, b in lines:
            color = {"l": (255, 80, 80), "r": (80, 80, 255)}.get(a[0] if a[1] == "_" else "", (80, 220, 80))
            cv2.line(picture, pixels[a], pixels[b], color, 6, cv2.LINE_AA)
        tiles.append(cv2.resize(picture, (408, 720)))
    cv2.imwrite(str(file), np.hstack(tiles))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recording", type=Path)
    parser.add_argument("--out", type=Path, default=Path("out/pose2sim"))
    parser.add_argument("--model", choices=("papers", "full"), default="papers")
    parser.add_argument("--config", type=Path, help="TOML of the tracker; default: CONFIG in this file")
    options = parser.parse_args()
    config = CONFIG if options.config is None else voodoo.Config.load(options.config)
    names = [camera.name for camera in open_recording(options.recording, loader="pose2sim").cameras]
    model = options.model
    runs = [track(options.recording, "all cameras", config, model=model)]
    for missing in names:
        kept = tuple(name for name in names if name != missing)
        runs.append(track(options.recording, f"without {missing}", config, model=model, cameras=kept))
    runs.append(track(options.recording, "20 % random pixels", config, model=model, outliers=0.2))
    options.out.mkdir(parents=True, exist_ok=True)
    lines = [
        "Distance to the published triangulation (cm); rays alone, no depth.",
        "",
        "| cameras | mean | 95 % | last 20 frames | worst joint | triangulated | rays a frame | CPU ms a frame |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for run in runs:
        e = 100.0 * run.errors
        worst = int(e.mean(axis=0).argmax())
        lines.append(
            f"| {run.name} | {e.mean():.2f} | {np.quantile(e, 0.95):.1f} | {e[-20:].mean():.2f} | "
            f"{JOINTS[worst]} {e.mean(axis=0)[worst]:.1f} | {100 * run.triangulated:.2f} | {run.kept:.0f} | "
            f"{1e3 * run.seconds:.1f} |"
        )
    table = "\n".join(lines) + "\n"
    (options.out / "table.md").write_text(table, encoding="utf-8")
    print(table)
    figure, axis = plt.subplots(figsize=(9, 4))
    for run in runs:
        axis.plot(100.0 * run.errors.mean(axis=1), label=f"{run.name} ({100 * run.errors.mean():.1f} cm)")
    axis.set(xlabel="frame", ylabel="mean error of twelve joints / cm", ylim=(0, None))
    axis.legend(fontsize=8)
    axis.grid(alpha=0.3)
    figure.tight_layout()
    figure.savefig(options.out / "errors.png", dpi=110)
    draw(options.recording, runs[0], options.out / "skeletons.png", 60)


if __name__ == "__main__":
    main()
