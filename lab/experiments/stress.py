"""R07's stress test: noise, rectangles, and frames that are corrupted, blank, repeated or out of order; with and without the
jitter penalty, and the lag that the penalty costs.

    python lab/experiments/stress.py --out out/stress [--recordings DATA/rendered]

Without the penalty (`motion_scale` = 100: the prediction weighs nothing) against the default and other strengths. Sequences of
our own body, of which the truth is known exactly, and rendered recordings where they are given. Writes table.md and angles.png
(R07's figure 2: joint angles with and without).

Columns: joints lost (farther than 10 cm for over 0.3 s) while disturbed; mean error; variance of the joint angles' error,
degrees squared, and of their jitter (second difference); lag in frames: how late the estimate is on the undisturbed sequence, by
the shift that fits best, to a hundredth of a frame.
"""

import argparse
import sys
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import matplotlib
import numpy as np

import voodoo
from voodoo.evaluation import metrics
from voodoo.ik import Chain
from voodoo.ik.angles import angles_of
from voodoo.pipeline.front_end import FrontEnd
from voodoo.pipeline.start import start_tracker
from voodoo.recordings import DepthImage, RecordedFrame
from voodoo.sensors.settings import FrontEndSettings

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests"))

from disturbance import Disturbance, disturbed, disturbed_image
from synthetic.sequence import VirtualSequence

matplotlib.use("Agg")
import matplotlib.pyplot as plt

STRENGTHS = (100.0, 1.0, 0.5, 0.25, 0.125)
LOST_M = 0.10


@dataclass(frozen=True)
class Followed:
    """Stamps (F,), joints (F, 12, 3) and angles (F, A) of estimate and truth, and how many frames were refused."""

    stamps: np.ndarray
    joints: np.ndarray
    true_joints: np.ndarray
    angles: np.ndarray
    true_angles: np.ndarray
    refused: int

    @property
    def errors(self) -> np.ndarray:
        return metrics.joint_errors(self.joints, self.true_joints)

    @property
    def lost(self) -> int:
        return int(metrics.tracking_class(self.errors, self.stamps, limit=LOST_M)[1].any(axis=0).sum())

    @property
    def angle_variance(self) -> float:
        """Mean over the angles of the variance of their error [degrees squared]."""
        off = np.degrees(np.angle(np.exp(1j * (self.angles - self.true_angles))))
        return float(np.nanmean(np.nanvar(off, axis=0)))

    @property
    def angle_jitter(self) -> float:
        """Mean variance of the angles' second difference [degrees squared]."""
        return float(np.mean(np.var(np.degrees(np.diff(np.unwrap(self.angles, axis=0), n=2, axis=0)), axis=0)))


def joints_of(places: dict[str, np.ndarray]) -> np.ndarray:
    return np.array([places.get(name, np.full(3, np.nan)) for name in metrics.JOINTS])


def follow(sequence: VirtualSequence, config: voodoo.Config, how: Disturbance | None) -> Followed:
    """Track a sequence of our own body; a frame that the tracker refuses is left out, as a user would."""
    frames: Iterable = sequence if how is None else disturbed(sequence, how)
    tracker = voodoo.Tracker(sequence.body, config=config)
    chain = Chain(sequence.body)
    rows: list[tuple] = []
    refused = 0
    for frame in frames:
        if not rows:
            tracker.reset_pose(sequence.truth(0.0)[0])
        try:
            estimate = tracker.step(sequence.measurement(frame))
        except voodoo.MeasurementError:
            refused += 1
            continue
        truth = joints_of(frame.joints)
        rows.append((frame.stamp, joints_of(estimate.joints), truth, angles_of(chain, estimate), frame.angles[6:]))
    return Followed(*(np.array(column) for column in zip(*rows, strict=True)), refused)


def lag(found: Followed, sequence: VirtualSequence) -> float:
    """How late the joints are [frames]: the shift d that makes |estimate(t) - truth(t - d)| least.

    Linear in d: with the truth's velocity v and the error e = estimate - truth, e = -d v, so d = -sum e.v / sum v.v.
    """
    step = 1e-3
    velocity = []
    for stamp in found.stamps:
        after, before = (joints_of(sequence.truth(stamp + sign * step)[1]) for sign in (1.0, -1.0))
        velocity.append((after - before) / (2.0 * step) / 30.0)
    rate = np.array(velocity)
    return float(-np.sum((found.joints - found.true_joints) * rate) / np.sum(rate * rate))


def stressed_recording(path: Path, config: voodoo.Config, how: Disturbance | None) -> Followed:
    """Track a recording whose depth images are disturbed in the same way."""
    recording = voodoo.open_recording(path)
    tracker = start_tracker(recording, config=config, model="papers")
    front_end = FrontEnd(tracker, settings=FrontEndSettings.of(recording, use=("depth",)))
    chain = Chain(tracker.body)
    truth = recording.reference
    rows: list[tuple] = []
    refused = 0
    for frame in recorded(recording, how):
        try:
            estimate = front_end.step(frame)
        except voodoo.MeasurementError:
            refused += 1
            continue
        index = int(np.argmin(np.abs(truth.stamps - frame.stamp)))
        places = joints_of(dict(zip(truth.names, truth.positions[index], strict=True)))
        angles = angles_of(chain, estimate)
        rows.append((frame.stamp, joints_of(estimate.joints), places, angles, np.full(len(angles), np.nan)))
    return Followed(*(np.array(column) for column in zip(*rows, strict=True)), refused)


def recorded(recording: Iterable[RecordedFrame], how: Disturbance | None) -> Iterator[RecordedFrame]:
    rng = np.random.default_rng(0 if how is None else how.seed)
    last: RecordedFrame | None = None
    for frame in recording:
        if how is None:
            yield frame
            continue
        items = [item for item in frame.measurements if isinstance(item, DepthImage)]
        items = [replace(item, image=disturbed_image(np.asarray(item.image), how, rng)) for item in items]
        draw = rng.random()
        if last is not None and draw < how.late:
            yield last
        elif last is not None and draw < how.late + how.repeated:
            items = [item for item in last.measurements if isinstance(item, DepthImage)]
        elif last is not None and draw < how.late + how.repeated + how.blank:
            items = [replace(item, image=np.zeros_like(item.image)) for item in items]
        elif last is not None and draw < how.late + how.repeated + how.blank + how.corrupted:
            items = [replace(item, image=garbage(item.image, rng)) for item in items]
        last = replace(frame, measurements=tuple(items))
        yield last


def garbage(image: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    return rng.integers(500, 4500, image.shape).astype(image.dtype)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True, help="folder for table.md and angles.png")
    parser.add_argument("--frames", type=int, default=200, help="of each sequence (default 200)")
    parser.add_argument("--seeds", type=int, default=3, help="sequences (default 3)")
    parser.add_argument("--speed", type=float, default=3.0, help="of the sequences (default 3)")
    parser.add_argument("--recordings", type=Path, help="folder with rendered recordings")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    body = voodoo.Body.human(height=1.78, model="papers")
    how = Disturbance()
    lines = [
        "| `motion_scale` | lost joints | mean / max error, mm | angle error, variance, deg² | "
        "second difference, variance, deg² | lag, frames |",
        "|---|---|---|---|---|---|",
    ]
    drawn: dict[float, Followed] = {}
    for strength in STRENGTHS:
        config = voodoo.Config(motion_scale=strength)
        runs, lags = [], []
        for seed in range(1, arguments.seeds + 1):
            sequence = VirtualSequence(body=body, speed=arguments.speed, frames=arguments.frames, seed=seed)
            runs.append(follow(sequence, config, how))
            lags.append(lag(follow(sequence, config, None), sequence))
        drawn[strength] = runs[0]
        errors = np.concatenate([run.errors for run in runs])
        name = "100 (no penalty)" if strength == STRENGTHS[0] else f"{strength:g}"
        lines.append(
            f"| {name} | {sum(run.lost for run in runs)} of {12 * len(runs)} | "
            f"{1e3 * errors.mean():.1f} / {1e3 * errors.max():.0f} | {np.mean([run.angle_variance for run in runs]):.2f} | "
            f"{np.mean([run.angle_jitter for run in runs]):.2f} | {np.mean(lags):.2f} |"
        )
        print(lines[-1])
    if arguments.recordings is not None:
        lines += [
            "",
            "| recording, disturbed | penalty | lost joints | mean error, cm | second difference, variance, deg² |",
        ]
        lines += ["|---|---|---|---|---|"]
        for path in sorted(arguments.recordings.iterdir()):
            if not path.is_dir():
                continue
            for name, strength in (("none", STRENGTHS[0]), ("default", voodoo.Config().motion_scale)):
                run = stressed_recording(path, voodoo.Config(motion_scale=strength), how)
                error = 100.0 * float(np.nanmean(run.errors))
                lines.append(f"| {path.name} | {name} | {run.lost} of 12 | {error:.1f} | {run.angle_jitter:.1f} |")
                print(lines[-1])
    (arguments.out / "table.md").write_text("\n".join(lines) + "\n", encoding="utf-8")

    names = Chain(body).angle_names[6:]
    displayed = [name for name in ("l_elbow_flexion", "r_shoulder_rx", "l_knee_flexion") if name in names]
    figure, axes = plt.subplots(len(displayed), 1, figsize=(9.0, 7.0), sharex=True, layout="constrained")
    for row, name in zip(axes, displayed, strict=True):
        column = names.index(name)
        for strength, color, word in ((STRENGTHS[0], "#c8553d", "without"), (0.25, "#222222", "with penalty")):
            run = drawn[strength]
            row.plot(run.stamps, np.degrees(run.angles[:, column]), color=color, linewidth=1.0, label=word)
        row.plot(run.stamps, np.degrees(run.true_angles[:, column]), color="#4c8c6b", linewidth=0.8, label="truth")
        row.set_ylabel(f"{name}, degrees")
        row.spines[["top", "right"]].set_visible(False)
    axes[0].legend(frameon=False, ncols=3)
    axes[-1].set_xlabel("s")
    figure.savefig(arguments.out / "angles.png", dpi=110)


if __name__ == "__main__":
    main()
