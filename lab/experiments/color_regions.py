"""Pose from color regions on recordings of several color cameras with exact truth, and under disturbances.

    python lab/experiments/color_regions.py D/multiview/mv_* [--start 1] [--noise] [--gray] [--dim] [--cameras 0,1] ...
    python lab/experiments/color_regions.py D/multiview/mv_* --pairs
    python lab/experiments/color_regions.py D/multiview/mv_d2* --gray --picture worst.jpg

Prints a line a recording: mean error of the twelve joints, share of it within 10 cm, mean and spread of the errors of joint
angles, joints that are more than 10 cm off in the last third of a second, how many of the ends of limbs that are more than 10 cm
off their status tells, and how many of the others it doubts, and user time of a step. Pictures are decoded before the clock runs.
With `--pairs` it does so for every two of four cameras, and at the end for all of these together.
"""

from __future__ import annotations

import argparse
import csv
import itertools
import json
import re
import time
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

import voodoo
from voodoo.evaluation.metrics import angle_error
from voodoo.measurements import ColorImage
from voodoo.model.projection import CameraView
from voodoo.pipeline.inputs import pictures_alone
from voodoo.recordings import open_recording

LIMBS = {"elbow": "upperarm", "wrist": "forearm", "knee": "thigh", "ankle": "calf"}
JOINTS = [f"{side}_{joint}" for joint in ("shoulder", "elbow", "wrist", "hip", "knee", "ankle") for side in "lr"]
Picture = npt.NDArray[np.uint8]


def start_of(folder: Path, seed: int | None) -> tuple[float, dict[str, npt.NDArray[np.float64]]]:
    """Stature and joints of the first frame, each 3 to 5 cm off with a seed."""
    known = json.loads((folder / "init.json").read_text())
    joints = {name: np.array(place) for name, place in known["joints"].items()}
    if seed is not None:
        rng = np.random.default_rng(seed + 7)
        for name in joints:
            off = rng.normal(size=3)
            joints[name] = joints[name] + off / np.linalg.norm(off) * rng.uniform(0.03, 0.05)
    return known["height_m"], joints


def truth_of(folder: Path) -> npt.NDArray[np.float64]:
    """True places of the twelve joints, (frames, 12, 3)."""
    with (folder / "truth.csv").open() as file:
        rows = list(csv.DictReader(file))
    return np.array([[[float(row[f"{joint}_{axis}"]) for axis in "xyz"] for joint in JOINTS] for row in rows])


def disturbed(picture: Picture, rng: np.random.Generator, options: argparse.Namespace, frame: int) -> Picture:
    """R07's disturbances: uncorrelated noise on 15 % of the pixels, rectangles, and frames that show nothing."""
    picture = picture.copy()
    if options.noise:
        hit = rng.random(picture.shape[:2]) < 0.15
        picture[hit] = rng.integers(0, 256, (int(hit.sum()), 3), dtype=np.uint8)
    for _ in range(12 if options.rectangles else 0):
        height, width = rng.integers(15, 70, 2)
        row, column = rng.integers(0, picture.shape[0] - height), rng.integers(0, picture.shape[1] - width)
        picture[row : row + height, column : column + width] = rng.integers(0, 256, 3, dtype=np.uint8)
    if options.corrupt and frame % 25 == 24:
        picture = rng.integers(0, 256, picture.shape, dtype=np.uint8)
    if options.dim:
        picture = (picture * (1.0 - 0.5 * min(1.0, max(0.0, (frame - 30) / 20)))).astype(np.uint8)
    return picture


def displayed(picture: Picture, gray: bool) -> Picture:
    """The picture as the tracker gets it."""
    return (picture @ np.array([0.114, 0.587, 0.299])).astype(np.uint8) if gray else picture


def number_of(sensor: str) -> int:
    """Number of a camera by its name."""
    return int(re.findall(r"\d+", sensor)[0])


def empty_scene(folder: Path, camera: int, gray: bool) -> list[Picture]:
    """Pictures of the scene without anybody."""
    files = sorted((folder / "background").glob(f"cam_{camera}_*.*"))
    return [displayed(cv2.imread(str(file)), gray) for file in files]


def called_measured(estimate: voodoo.Estimate) -> list[bool]:
    """Of every joint whether it ends a limb that is called measured."""
    carriers = [f"{joint[0]}_{LIMBS.get(joint[2:], '')}" for joint in JOINTS]
    return [estimate.limb_status.get(carrier) == "measured" for carrier in carriers]


BONES = [
    (f"{side}_{one}", f"{side}_{other}")
    for side in "lr"
    for one, other in (("shoulder", "elbow"), ("elbow", "wrist"), ("hip", "knee"), ("knee", "ankle"))
]
TILE = 300
MAGENTA, BLUE, ORANGE = (255, 0, 255), (240, 150, 60), (40, 130, 240)


def failure(
    shots: list[ColorImage], pictures: list[Picture], found: npt.NDArray[np.float64], truth: npt.NDArray[np.float64]
) -> Picture:
    """What the cameras see of one frame about the person: what was found in blue (left) and orange, the truth in magenta."""
    tiles = []
    for item, picture in zip(shots, pictures, strict=True):
        displayed = cv2.cvtColor(picture, cv2.COLOR_GRAY2BGR) if picture.ndim == 2 else picture.copy()
        view = CameraView(item.camera, item.root_from_sensor, 1.0)
        observed = [dict(zip(JOINTS, view.project(places)[0], strict=True)) for places in (truth, found)]
        for places, own in zip(observed, (False, True), strict=True):
            for bone in BONES:
                if not all(np.isfinite(places[name]).all() for name in bone):
                    continue
                ends = [tuple(np.rint(places[name]).astype(int).tolist()) for name in bone]
                color = MAGENTA if not own else BLUE if bone[0][0] == "l" else ORANGE
                cv2.line(displayed, *ends, color, 2, cv2.LINE_AA)
        corners = np.array([place for places in observed for place in places.values() if np.isfinite(place).all()])
        middle, half = np.mean([corners.min(axis=0), corners.max(axis=0)], axis=0), 0.65 * np.ptp(corners, axis=0).max()
        half = min(half, 0.5 * min(displayed.shape[:2]))
        row, column = (int(np.clip(middle[axis] - half, 0, displayed.shape[1 - axis] - 2 * half)) for axis in (1, 0))
        part = displayed[row : row + int(2 * half), column : column + int(2 * half)]
        tiles.append(cv2.resize(part, (TILE, TILE), interpolation=cv2.INTER_AREA))
    return np.asarray(cv2.hconcat(tiles), dtype=np.uint8)


def run(
    folder: Path, options: argparse.Namespace
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.bool_], tuple[float, float], list[float]]:
    """Errors (frames, 12) in meters, which of them are said to be measured, mean and spread of the errors of eight joint angles
    in degrees, and seconds of user time of every step."""
    recording = open_recording(folder, **{"loader": None} | pictures_alone(folder, None, ("color",)))
    frames = [[item for item in frame.measurements if isinstance(item, ColorImage)] for frame in recording]
    truth = truth_of(folder)
    stature, joints = start_of(folder, options.start)
    tracker = voodoo.Tracker(voodoo.Body.human(stature), config=voodoo.Config(**json.loads(options.config)))
    estimate = tracker.reset(joints=joints, fit_sizes=not options.default_lengths)
    if options.default_lengths:
        tracker.reset(joints=dict(estimate.joints))
    chosen = [int(camera) for camera in options.cameras.split(",")]
    for item in frames[0] if options.background else []:
        tracker.set_background(item.sensor, empty_scene(folder, number_of(item.sensor), options.gray))
    rng = np.random.default_rng(7)
    order = list(range(len(frames)))
    if options.rounds:
        order = (order + order[-2:0:-1]) * options.rounds
    found, errors, measured, seconds = [], [], [], []
    worst = 0.0
    for step, index in enumerate(order):
        frame = voodoo.Frame(step / 30.0)
        first = frames[index][-1].stamp
        shots = [item for item in frames[index] if number_of(item.sensor) in chosen]
        pictures = [displayed(disturbed(item.image, rng, options, step), options.gray) for item in shots]
        for item, picture in zip(shots, pictures, strict=True):
            frame.add_color(
                np.ascontiguousarray(picture),
                camera=item.camera,
                world_from_sensor=item.root_from_sensor,
                stamp=step / 30.0 + item.stamp - first,
                source=item.sensor,
            )
        before = time.process_time()
        estimate = tracker.step(frame)
        seconds.append(time.process_time() - before)
        places = np.array([estimate.joints[joint] for joint in JOINTS])
        found.append(places)
        errors.append(np.linalg.norm(places - truth[index], axis=1))
        measured.append(called_measured(estimate))
        if options.picture and errors[-1].sum() > worst and step <= options.until:
            worst = errors[-1].sum()
            options.picture.parent.mkdir(parents=True, exist_ok=True)
            drawn = failure(shots, pictures, places, truth[index])
            cv2.imwrite(str(options.picture), drawn, [cv2.IMWRITE_JPEG_QUALITY, 80])
            print(f"frame {step}: {options.picture}")
    return np.array(errors), np.array(measured), angle_error(np.array(found), truth[order]), seconds


def recall_and_false_alarms(
    errors: npt.NDArray[np.float64], measured: npt.NDArray[np.bool_]
) -> tuple[float, float, int]:
    """Share of what is more than 10 cm off that is not called measured, and of the rest, in percent; how many are off."""
    far = errors > 0.1
    recall, false_alarms = (100 * float((~measured[which]).mean()) if which.any() else np.nan for which in (far, ~far))
    return recall, false_alarms, int(far.sum())


def main() -> None:
    """Measure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recordings", nargs="+", type=Path)
    parser.add_argument("--start", type=int, help="joints of the start 3 to 5 cm off, by this seed")
    parser.add_argument("--cameras", default="0,1,2,3")
    parser.add_argument("--rounds", type=int, default=0, help="forwards and backwards so many times")
    parser.add_argument("--picture", type=Path, help="a .jpg of the worst frame, until the given one")
    parser.add_argument("--until", type=int, default=10**9, help="last frame that --picture shows")
    parser.add_argument("--config", default="{}", help="JSON of configuration keys")
    for switch in ("noise", "rectangles", "corrupt", "dim", "gray", "background", "default-lengths"):
        parser.add_argument(f"--{switch}", action="store_true")
    parser.add_argument("--pairs", action="store_true", help="every two of four cameras")
    options = parser.parse_args()
    ends = np.array([joint[2:] in LIMBS for joint in JOINTS])
    pairs = [f"{one},{other}" for one, other in itertools.combinations(range(4), 2)]
    together = []
    chosen = pairs if options.pairs else [options.cameras]
    for folder, cameras in itertools.product(options.recordings, chosen):
        options.cameras = cameras
        errors, measured, angles, seconds = run(folder, options)
        together.append((errors[:, ends].ravel(), measured[:, ends].ravel()))
        recall, false_alarms, count = recall_and_false_alarms(*together[-1])
        lost = [joint for joint, error in zip(JOINTS, errors[-10:].mean(axis=0), strict=True) if error > 0.1]
        tenth = len(errors) // 10
        print(
            f"{folder.name} {cameras}: {100 * errors.mean():.2f} cm, {100 * (errors < 0.1).mean():.1f} % within 10 cm,"
            f" angles {angles[0]:.1f} deg, spread {angles[1]:.1f}, lost {lost},"
            f" reported {recall:.0f} % of {count}, false alarms {false_alarms:.1f} %, first and last tenth"
            f" {100 * errors[:tenth].mean():.2f} {100 * errors[-tenth:].mean():.2f} cm,"
            f" {1e3 * float(np.median(seconds)):.1f} ms",
            flush=True,
        )
    if options.pairs:
        recall, false_alarms, count = recall_and_false_alarms(
            *(np.concatenate(part) for part in zip(*together, strict=True))
        )
        print(f"all: reported {recall:.1f} % of {count}, false alarms {false_alarms:.1f} %")


if __name__ == "__main__":
    main()
