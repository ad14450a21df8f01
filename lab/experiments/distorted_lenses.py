#!/usr/bin/env python3
"""Is a depth camera with a distorting lens as good as a rectified one?

    python lab/experiments/distorted_lenses.py --recordings ../shared/data/rendered --out target/lenses

Two kinds of sequences with exact truth are tracked by depth alone, through a pinhole and through a plumb-bob, a rational and a
fisheye lens that show as much of the scene:

- Rendered recordings, whose depth images are resampled through each lens (changed_depth.py). The pinhole is resampled as well,
  through a camera with a slightly different focal length and center, so that all images have the same sampling noise.
- A person who walks about a room and one who swings every joint (`tests/synthetic`), rendered through each lens, pixel by pixel;
  the cameras are 100 degrees wide.

Prints, and writes to table.md, the mean joint error, the share of limbs called lost, and the share of frames in which the person
is tracked; pictures of the model over the depth image go to the same folder.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from changed_depth import ChangedDepth, resampled

import voodoo
from voodoo.evaluation.metrics import JOINTS
from voodoo.measurements import DepthImage
from voodoo.model.projection import CameraView
from voodoo.pipeline.run import track
from voodoo.pipeline.start import start_tracker
from voodoo.sensors.settings import FrontEndSettings
from voodoo.visualization.body_drawing import draw_body

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests"))

from lenses import LENSES
from room_walk import Walk
from synthetic.gait import path
from synthetic.sequence import VirtualFrame, VirtualSequence

RECORDINGS = ("dev_01_bend_scoop_cmu", "dev_02_arms_cmu", "dev_04_kick_ball_cmu", "dev_05_walk")
MODELS = {
    "pinhole": LENSES["none"],
    "plumb bob": LENSES["plumb_bob"],
    "rational": LENSES["azure"],
    "fisheye": LENSES["fisheye"],
}
WIDE = voodoo.Camera(320, 240, 134.0, 134.0, 159.5, 119.5)
"""100 degrees from left to right."""


def through(name: str, camera: voodoo.Camera) -> voodoo.Camera:
    """A camera that sees as far to the left and right through a lens."""
    model, coefficients = MODELS[name]
    unit = voodoo.Camera(2, 2, 1.0, 1.0, 0.0, 0.0, coefficients, model)  # type: ignore[arg-type]
    half = (camera.width - 1) / 2.0
    fraction = half / camera.fx / float(unit.project([[half / camera.fx, 0.0, 1.0]])[0, 0])
    return replace(camera, fx=camera.fx * fraction, fy=camera.fy * fraction, distortion=coefficients, model=model)  # type: ignore[arg-type]


def sampled(name: str, camera: voodoo.Camera, seed: int) -> voodoo.Camera:
    """The same beside the recorded pixels, another way for each seed: the pinhole, too, has to be sampled."""
    fraction, x, y = np.random.default_rng(seed).uniform((0.94, -0.5, -0.5), (0.99, 0.5, 0.5)).tolist()
    beside = replace(camera, fx=fraction * camera.fx, fy=fraction * camera.fy, cx=camera.cx + x, cy=camera.cy + y)
    return beside if name == "pinhole" else through(name, beside)


@dataclass(frozen=True)
class Step:
    """A frame: its depth image, what was estimated, and the truth (J, 3) of the joints [m]."""

    item: DepthImage
    body: voodoo.Body
    estimate: voodoo.Estimate
    truth: np.ndarray


def recorded(folder: Path, name: str, seed: int) -> Iterator[Step]:
    """A rendered recording by its depth images alone."""
    recording = ChangedDepth(
        voodoo.open_recording(folder), lambda item: resampled(item, sampled(name, item.camera, seed))
    )
    tracker = start_tracker(recording, use=("depth",))
    reference = recording.reference
    for frame in track(recording, tracker, settings=FrontEndSettings.of(recording, use=("depth",))):
        row = int(np.abs(reference.stamps - frame.estimate.stamp).argmin())
        columns = [reference.names.index(joint) for joint in JOINTS]
        item = next(item for item in frame.recorded.measurements if isinstance(item, DepthImage))
        yield Step(item, tracker.body, frame.estimate, reference.positions[row, columns])


def made_up(sequence: VirtualSequence | Walk) -> Iterator[Step]:
    """A made-up sequence, from the true pose on."""
    tracker = None
    for frame in sequence:
        if tracker is None:
            tracker = voodoo.Tracker(sequence.body)
            tracker.reset(joints=frame.joints)
        estimate = tracker.step(sequence.measurement(frame))
        item = DepthImage("depth", frame.stamp, frame.image, 0.001, sequence.camera, sequence.world_from_sensor)
        yield Step(item, tracker.body, estimate, joints_of(frame))


def joints_of(frame: VirtualFrame) -> np.ndarray:
    """True positions (J, 3) [m]."""
    return np.array([frame.joints[name] for name in JOINTS])


def swinging(name: str, seed: int) -> Iterator[Step]:
    """Every joint three times as fast as in slow motion."""
    body = voodoo.Body.human(height=1.78)
    return made_up(VirtualSequence(body=body, frames=150, speed=3.0, seed=seed, camera=through(name, WIDE)))


def walking(name: str, seed: int) -> Iterator[Step]:
    """To and fro, as near as 1.8 m and as far as 40 degrees off the axis."""
    stops = [(0.0, 2.4, 0.0), (2.0, 2.2, 1.4), (4.5, 2.0, -1.5), (6.0, 1.9, 0.0)]
    body = voodoo.Body.human(height=1.78)
    return made_up(Walk(body=body, stops=path(stops), seed=seed, camera=through(name, WIDE)))


def picture(step: Step) -> np.ndarray:
    """The model over the depth image."""
    depth = step.item.image * step.item.meters_per_unit
    gray = np.where(depth > 0.0, np.clip(255.0 * (4.5 - depth) / 3.5, 30, 255), 0).astype(np.uint8)
    scale = 960.0 / step.item.camera.width
    gray = cv2.resize(gray, None, fx=scale, fy=scale, interpolation=cv2.INTER_NEAREST)
    canvas = cv2.cvtColor(gray, cv2.COLOR_GRAY2BGR)
    draw_body(canvas, step.body, step.estimate, CameraView(step.item.camera, step.item.root_from_sensor, scale))
    return canvas


def measure(steps: Iterator[Step], out: Path) -> tuple[float, float, float]:
    """Mean joint error [m], share of limbs called lost, and share of frames tracked; keeps a picture of the middle."""
    kept = list(steps)
    cv2.imwrite(str(out), picture(kept[len(kept) // 2]))
    errors = [
        np.linalg.norm(
            np.array([step.estimate.joints.get(name, np.full(3, np.nan)) for name in JOINTS]) - step.truth, axis=1
        )
        for step in kept
    ]
    lost = [status == "lost" for step in kept for status in step.estimate.limb_status.values()]
    tracked = [step.estimate.status == "tracking" for step in kept]
    return float(np.nanmean(errors)), float(np.mean(lost)), float(np.mean(tracked))


def main() -> None:
    """Track all sequences through all lenses."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--recordings", type=Path, required=True, help="folder of the rendered recordings")
    parser.add_argument("--out", type=Path, required=True, help="folder for table.md and pictures")
    parser.add_argument("--only", nargs="*", help="names of sequences")
    parser.add_argument(
        "--seeds",
        type=int,
        default=3,
        help="samplings of each recording, and made-up sequences of each kind (default 3)",
    )
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    sequences: dict[str, Callable[[str, int], Iterator[Step]]] = {
        name: lambda lens, seed, name=name: recorded(arguments.recordings / name, lens, seed) for name in RECORDINGS
    } | {"swinging": swinging, "walking": walking}
    if arguments.only:
        sequences = {name: steps for name, steps in sequences.items() if name in arguments.only}
    lines = [
        "| sequence | lens | joint error (spread) [mm] | beside the pinhole [mm] | limbs lost [%] | frames tracked [%] |",
        "|---|---|---|---|---|---|",
    ]
    print("\n".join(lines), flush=True)
    for name, steps in sequences.items():
        rectified = math.nan
        for lens in MODELS:
            shot = arguments.out / f"{name}_{lens}.png".replace(" ", "_")
            runs = np.array([measure(steps(lens, seed), shot) for seed in range(1, arguments.seeds + 1)])
            (error, lost, tracked), spread = runs.mean(axis=0), runs[:, 0].std()
            rectified = error if lens == "pinhole" else rectified
            numbers = f"{1e3 * error:.1f} ({1e3 * spread:.1f}) | {1e3 * (error - rectified):+.1f} | {100 * lost:.2f}"
            numbers += f" | {100 * tracked:.0f}"
            lines.append(f"| {name} | {lens} | {numbers} |")
            print(lines[-1], flush=True)
    (arguments.out / "table.md").write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
