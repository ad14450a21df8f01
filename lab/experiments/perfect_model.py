"""How good is the tracker when model, start and calibration are perfect and only noise and speed remain?

    python lab/experiments/perfect_model.py --out out/perfect

Ten limbs, 25 moving freedoms, 640x480, noise 4 mm at 2.4 m, a wall behind; at 1, 3, 6 and 10 times the base speed. Then the
same with a model that is 10 % too thick and 5 % too long. Writes table.md, errors.png (over time) and worst.png (the frame in
which each speed is farthest off: truth, estimate over the image). Errors are of twelve joints, millimeters, at lag 0.
"""

import argparse
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import cv2
import matplotlib
import numpy as np

import voodoo
from voodoo.evaluation import metrics
from voodoo.model.projection import CameraView
from voodoo.visualization.body_drawing import draw_body
from voodoo.visualization.image_writer import save_picture

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests"))

from synthetic.grown import grown
from synthetic.sequence import VirtualFrame, VirtualSequence

matplotlib.use("Agg")
import matplotlib.pyplot as plt

SPEEDS = (1.0, 3.0, 6.0, 10.0)
HEIGHT = 1.78
Start = Callable[[voodoo.Tracker, VirtualFrame], voodoo.Estimate]


@dataclass(frozen=True)
class Run:
    """Errors (F, 12) [m], seconds a frame, and the frame and estimate with the largest error."""

    errors: np.ndarray
    seconds: np.ndarray
    motion: float
    worst: tuple[VirtualFrame, voodoo.Estimate, voodoo.Body]


def exact_pose(tracker: voodoo.Tracker, frame: VirtualFrame) -> voodoo.Estimate:
    return tracker.reset_pose(frame.world_from_limb)


def sizes_kept(tracker: voodoo.Tracker, frame: VirtualFrame) -> voodoo.Estimate:
    return tracker.reset(joints=frame.joints, fit_sizes=False)


def sizes_fitted(tracker: voodoo.Tracker, frame: VirtualFrame) -> voodoo.Estimate:
    return tracker.reset(joints=frame.joints)


def joints_of(places: dict[str, np.ndarray]) -> np.ndarray:
    return np.array([places[name] for name in metrics.JOINTS])


def follow(sequence: VirtualSequence, body: voodoo.Body, start: Start, config: voodoo.Config) -> Run:
    tracker = voodoo.Tracker(body, config=config)
    errors, seconds, places = [], [], []
    worst, most = None, -1.0
    for frame in sequence:
        if not errors:
            start(tracker, frame)
        measurement = sequence.measurement(frame)
        began = time.perf_counter()
        estimate = tracker.step(measurement)
        seconds.append(time.perf_counter() - began)
        truth = joints_of(frame.joints)
        errors.append(np.linalg.norm(joints_of(estimate.joints) - truth, axis=1))
        places.append(truth)
        if errors[-1].max() > most:
            worst, most = (frame, estimate, tracker.body), errors[-1].max()
    motion = float(np.linalg.norm(np.diff(np.array(places), axis=0), axis=2).max()) if len(places) > 1 else 0.0
    return Run(np.array(errors), np.array(seconds), motion, worst)


def pose_floor(sequence: VirtualSequence, body: voodoo.Body) -> float:
    """Mean error [m] of a body with other lengths that has all the true joint angles and the best position."""
    chain, errors = voodoo.ik.Chain(body), []
    for index in range(0, len(sequence), 5):
        truth = joints_of(sequence.truth(index / 30.0)[1])
        away = joints_of(chain.forward(sequence.angles(index / 30.0))[1])
        base = sequence.truth(index / 30.0)[0][body.limb_names[0]]
        own = chain.forward(sequence.angles(index / 30.0))[0][body.limb_names[0]]
        turn = base[:3, :3] @ own[:3, :3].T
        off = truth - away @ turn.T
        errors.append(np.linalg.norm(off - off.mean(axis=0), axis=1).mean())
    return float(np.mean(errors))


def picture(run: Run, sequence: VirtualSequence, title: str) -> np.ndarray:
    frame, estimate, body = run.worst
    observed = voodoo.render_depth(
        sequence.body, frame.world_from_limb, camera=sequence.camera, world_from_sensor=sequence.world_from_sensor
    )
    near, far = 1.6, 3.7
    gray = np.clip(255.0 * (far - frame.image * 0.001) / (far - near), 0, 255).astype(np.uint8)
    truth = cv2.applyColorMap(((observed.limb + 1) * 23).astype(np.uint8), cv2.COLORMAP_TURBO)
    truth = (truth * (0.3 + 0.7 * gray[..., None] / 255.0) * (observed.limb >= 0)[..., None]).astype(np.uint8)
    canvas = cv2.cvtColor(gray, cv2.COLOR_GRAY2BGR)
    draw_body(canvas, body, estimate, CameraView(sequence.camera, sequence.world_from_sensor, 1))
    both = np.hstack([truth, canvas])
    worst = 1e3 * np.linalg.norm(joints_of(estimate.joints) - joints_of(frame.joints), axis=1)
    text = f"{title}: {worst.max():.0f} mm at {metrics.JOINTS[int(worst.argmax())]}, {frame.stamp:.2f} s"
    cv2.putText(both, text, (12, 28), cv2.FONT_HERSHEY_SIMPLEX, 0.7, (255, 255, 255), 2, cv2.LINE_AA)
    return np.asarray(both[:, :], dtype=np.uint8)


def cell(runs: list[Run]) -> str:
    errors = np.concatenate([run.errors for run in runs])
    return f"{1e3 * errors.mean():.1f} / {1e3 * errors.max():.0f}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True, help="folder for table.md, errors.png and worst.png")
    parser.add_argument("--frames", type=int, default=200, help="of each sequence, at 30 Hz (default 200)")
    parser.add_argument("--seeds", type=int, default=3, help="sequences at each speed (default 3)")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    true = voodoo.Body.human(height=HEIGHT, model="papers")
    chain, limbwise = voodoo.Config(), voodoo.Config(solver="limbwise", max_steps=6)
    long = grown(true, thicker=1.10, longer=1.05)
    ways: dict[str, tuple[voodoo.Body, Start, voodoo.Config]] = {
        "perfect model, default": (true, exact_pose, chain),
        "perfect model, `limbwise`": (true, exact_pose, limbwise),
        "10 % thicker, 5 % longer; sizes fitted to the first pose (default start)": (long, sizes_fitted, chain),
        "10 % thicker, 5 % longer; sizes kept": (long, sizes_kept, chain),
        "only the surfaces 10 % thicker, 5 % longer; sizes kept": (
            grown(true, thicker=1.10, longer=1.05, joints=False), sizes_kept, chain,
        ),
    }  # fmt: skip
    runs: dict[str, list[list[Run]]] = {}
    for name, (body, start, config) in ways.items():
        runs[name] = [
            [
                follow(VirtualSequence(body=true, speed=speed, frames=arguments.frames, seed=seed), body, start, config)
                for seed in range(1, arguments.seeds + 1)
            ]
            for speed in SPEEDS
        ]
        print(
            name, *(f"x{speed:g}: {cell(found)} mm" for speed, found in zip(SPEEDS, runs[name], strict=True)), sep="  "
        )
    first = next(iter(runs.values()))
    motion = [max(run.motion for run in found) for found in first]
    lines = [
        "| mean / max error of twelve joints, mm | "
        + " | ".join(f"x{speed:g}" for speed in SPEEDS)
        + " | ms a frame |",
        "|---|" + "---|" * (len(SPEEDS) + 1),
    ]
    for name, found in runs.items():
        speed = 1e3 * float(np.median(np.concatenate([run.seconds for runs in found for run in runs])))
        lines.append(f"| {name} | " + " | ".join(cell(item) for item in found) + f" | {speed:.1f} |")
    lines += ["", "Fastest joint: " + ", ".join(f"{1e3 * value:.0f} mm a frame" for value in motion) + "."]
    floor = pose_floor(VirtualSequence(body=true, speed=1.0, frames=arguments.frames), long)
    lines.append(f"With all true angles at the best position, the longer body is {1e3 * floor:.1f} mm off on average.")
    (arguments.out / "table.md").write_text("\n".join(lines) + "\n", encoding="utf-8")
    print("\n".join(lines))

    figure, axes = plt.subplots(len(SPEEDS), 1, figsize=(9.0, 8.0), sharex=True, layout="constrained")
    for row, speed in zip(axes, SPEEDS, strict=True):
        for name, color in (("perfect model, default", "#4c8c6b"), ("perfect model, `limbwise`", "#c8553d")):
            errors = 1e3 * runs[name][SPEEDS.index(speed)][0].errors
            row.plot(np.arange(len(errors)) / 30.0, errors.mean(axis=1), color=color, label=name.replace("`", ""))
            row.plot(np.arange(len(errors)) / 30.0, errors.max(axis=1), color=color, linewidth=0.6, alpha=0.6)
        row.set_yscale("log")
        row.set_ylabel(f"x{speed:g}, mm")
        row.spines[["top", "right"]].set_visible(False)
    axes[0].legend(frameon=False, ncols=2, title="mean (thick) and worst joint (thin)")
    axes[-1].set_xlabel("s")
    figure.savefig(arguments.out / "errors.png", dpi=110)

    pictures = []
    for name in ("perfect model, default", "10 % thicker, 5 % longer; sizes kept"):
        for speed, found in zip(SPEEDS, runs[name], strict=True):
            if speed in (SPEEDS[0], SPEEDS[-1]):
                run = max(found, key=lambda run: run.errors.max())
                title = "perfect" if name.startswith("perfect") else "thicker, longer"
                pictures.append(picture(run, VirtualSequence(body=true, speed=speed), f"x{speed:g} {title}"))
    save_picture(arguments.out / "worst.png", np.asarray(np.vstack(pictures), dtype=np.uint8))


if __name__ == "__main__":
    main()
