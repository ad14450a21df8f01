"""The fusion experiment of K06 section V on recordings with exact truth: depth only, 2-D only, both, and all sensors.

    python lab/experiments/fusion_experiment.py ../shared/data/rendered/dev_* --out out/fusion

The 2-D cue is skin color: head and hands in one color picture. Which way a fast arm goes is partly chance: each recording is
tracked eight times (`--starts N`), the first time from its own start and then with 4 mm of noise on the start's
joints, and the table has the means. How much of a change is chance is shown by `--modes depth again`: depth alone once
more, from joints moved by another 0.1 mm. Writes table.md, groups.png (error of each joint group) and frames_SOLVER.png (what
each of the ways makes of the frame in which fusion gains most).
"""

import argparse
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import cv2
import matplotlib
import numpy as np

import voodoo
from voodoo.pipeline.front_end import FrontEnd
from voodoo.pipeline.pairing import paired
from voodoo.recordings import ColorImage, RecordedFrame, Recording, open_recording
from voodoo.sensors.pixels import in_sensor
from voodoo.sensors.settings import FrontEndSettings

matplotlib.use("Agg")
import matplotlib.pyplot as plt

MODES = {
    "depth": ("depth",),
    "2-D": ("skin",),
    "fused": ("depth", "skin"),
    "all": ("depth", "skin", "scan"),
    "laser": ("depth", "scan"),
    "again": ("depth",),
}
PAPERS = ("depth", "2-D", "fused", "all")
GROUPS = {
    "trunk": ("humanoid_root", "vc7", "l_shoulder", "r_shoulder", "l_hip", "r_hip"),
    "head": ("head_center", "skull_tip"),
    "elbows": ("l_elbow", "r_elbow"),
    "wrists and hands": ("l_wrist", "r_wrist", "l_hand", "r_hand"),
    "knees": ("l_knee", "r_knee"),
    "ankles": ("l_ankle", "r_ankle"),
}
NOISE_M = 0.004
AGAIN_M = 0.0001
PAIRS = (("shoulder", "elbow"), ("elbow", "hand"), ("hip", "knee"), ("knee", "ankle"), ("shoulder", "hip"))
LIMBS = (
    *((f"{side}_{a}", f"{side}_{b}") for side in "lr" for a, b in PAIRS),
    ("l_shoulder", "r_shoulder"),
    ("l_hip", "r_hip"),
    ("vc7", "skull_tip"),
)


@dataclass(frozen=True)
class Result:
    """One recording, tracked in one way: errors (S, F, J) [m] of the truth's joints in each start's run, and the joints
    estimated in the first one, by frame."""

    recording: str
    solver: str
    mode: str
    names: tuple[str, ...]
    errors: np.ndarray
    joints: list[dict[str, np.ndarray]]

    def group(self, name: str) -> np.ndarray:
        """Mean error of each run (S,) [m]."""
        columns = [self.names.index(joint) for joint in GROUPS[name]]
        return self.errors[:, :, columns].mean(axis=(1, 2))


def run(job: tuple[Path, str, str, int]) -> Result:
    path, solver, mode, starts = job
    recording = open_recording(path)
    frames = list(paired(recording))
    runs = [track(recording, frames, solver, mode, start) for start in range(starts)]
    errors = np.array([errors for errors, _ in runs])
    return Result(recording.name, solver, mode, recording.reference.names, errors, runs[0][1])


def track(
    recording: Recording, frames: list[RecordedFrame], solver: str, mode: str, start: int
) -> tuple[np.ndarray, list[dict[str, np.ndarray]]]:
    """Errors (F, J) [m] and joints; every start but number 0 is disturbed."""
    chance = np.random.default_rng(start)
    noise = NOISE_M if start else 0.0
    joints = {name: np.add(place, chance.normal(0.0, noise, 3)) for name, place in recording.start["joints"].items()}
    if mode == "again":
        joints = {name: np.add(place, chance.normal(0.0, AGAIN_M, 3)) for name, place in joints.items()}
    # The papers' solver with the papers' ten limbs, any other with the eighteen of `full`.
    model = "papers" if solver == "limbwise" else "full"
    body = voodoo.Body.human(height=recording.start["height_m"], model=model)
    tracker = voodoo.Tracker(body, config=voodoo.Config(solver=solver))
    tracker.reset(joints=joints, fit_sizes=True)
    settings = FrontEndSettings(use=MODES[mode], ground_z=0.0)
    front_end = FrontEnd(tracker, settings=settings)
    reference = recording.reference
    errors, estimated = [], []
    for index, recorded in enumerate(frames):
        estimate = front_end.step(recorded)
        found = {name: np.array(estimate.joints[name]) for name in reference.names}
        estimated.append(found)
        errors.append([np.linalg.norm(found[name] - reference.positions[index, i]) for i, name in enumerate(found)])
    return np.array(errors), estimated


def table(results: list[Result], solver: str) -> str:
    """Mean errors in cm, recording by recording, and the change that fusion makes; its standard error where there are
    several starts."""
    chosen = {(r.recording, r.mode): r for r in results if r.solver == solver}
    modes = [mode for mode in MODES if any(mode == done for _, done in chosen)]
    recordings = list(dict.fromkeys(name for name, _ in chosen))
    starts = len(results[0].errors)
    title = f"Solver `{solver}`: mean error (cm) of a joint group, {' / '.join(modes)}"
    lines = [f"{title}; mean of {starts} starts." if starts > 1 else f"{title}.", ""]
    lines += ["| recording | " + " | ".join(GROUPS) + " |", "|---" * (len(GROUPS) + 1) + "|"]
    for name in recordings:
        cells = [
            " / ".join(f"{100 * chosen[name, mode].group(group).mean():.1f}" for mode in modes) for group in GROUPS
        ]
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    for mode in [mode for mode in modes if mode not in ("depth", "2-D")]:
        medians, worst = [], []
        for group in GROUPS:
            changes = []
            for name in recordings:
                alone, fused = (chosen[name, kind].group(group) for kind in ("depth", mode))
                # Each start is run in both ways: what they share cancels.
                change = (fused - alone) / alone.mean()
                changes.append((change.mean(), change.std(ddof=1) / np.sqrt(starts) if starts > 1 else None, name))
            medians.append(f"{100 * np.median([change for change, _, _ in changes]):+.0f} %")
            most, error, name = max(changes, key=lambda item: item[0])
            worst.append(f"{100 * most:+.1f} %" + ("" if error is None else f" ± {100 * error:.1f}") + f" ({name})")
        lines.append(f"| **{mode} against depth, median** | " + " | ".join(medians) + " |")
        lines.append(f"| **{mode} against depth, worst** | " + " | ".join(worst) + " |")
    return "\n".join(lines) + "\n"


def plot(results: list[Result], solvers: list[str], file: Path) -> None:
    figure, axes = plt.subplots(1, len(solvers), figsize=(6.5 * len(solvers), 4), sharey=True, squeeze=False)
    modes = [mode for mode in MODES if any(r.mode == mode for r in results)]
    width = 0.8 / len(modes)
    for axis, solver in zip(axes[0], solvers, strict=True):
        for offset, mode in enumerate(modes):
            chosen = [r for r in results if r.solver == solver and r.mode == mode]
            values = [100 * np.median([r.group(group).mean() for r in chosen]) for group in GROUPS]
            axis.bar(np.arange(len(GROUPS)) + width * offset, values, width=0.95 * width, label=mode)
        axis.set_xticks(np.arange(len(GROUPS)) + 0.5 * width * (len(modes) - 1), list(GROUPS), rotation=20)
        axis.set(title=solver, ylabel="median of mean errors / cm", ylim=(0, 40))
        axis.legend()
        axis.grid(axis="y", alpha=0.3)
    figure.tight_layout()
    figure.savefig(file, dpi=110)


def draw(results: list[Result], paths: list[Path], solver: str, file: Path) -> None:
    """For each recording the frame in which fusion gains most at wrists and hands, with the truth in white."""
    rows = []
    for path in paths:
        recording = open_recording(path)
        chosen = {r.mode: r for r in results if r.solver == solver and r.recording == recording.name}
        hands = [chosen["depth"].names.index(name) for name in GROUPS["wrists and hands"]]
        gain = (chosen["depth"].errors - chosen["fused"].errors)[0][:, hands].mean(axis=1)
        frame, picture = -1, None
        for index, recorded in enumerate(paired(recording)):
            displayed = next((item for item in recorded.measurements if isinstance(item, ColorImage)), None)
            if displayed is not None and (frame < 0 or gain[index] > gain[frame]):
                frame, picture = index, displayed
        if picture is None:
            raise SystemExit(f"{recording.name}: expected color pictures, found none")
        truth = dict(zip(recording.reference.names, recording.reference.positions[frame], strict=True))
        tiles = []
        for mode in [mode for mode in ("depth", "2-D", "fused") if mode in chosen]:
            image = cv2.resize(picture.image, None, fx=1.5, fy=1.5, interpolation=cv2.INTER_CUBIC)
            for joints, color in ((truth, (255, 255, 255)), (chosen[mode].joints[frame], (0, 90, 255))):
                points = in_sensor(picture.root_from_sensor, list(joints.values()))
                pixels = dict(zip(joints, 1.5 * picture.camera.project(points) + 0.25, strict=True))
                for a, b in LIMBS:
                    if np.isfinite([pixels[a], pixels[b]]).all():
                        start, end = np.round(pixels[a]).astype(int), np.round(pixels[b]).astype(int)
                        cv2.line(image, tuple(start), tuple(end), color, 2, cv2.LINE_AA)
            text = f"{mode} {100 * chosen[mode].errors[0, frame, hands].mean():.0f} cm"
            cv2.putText(image, text, (8, 22), cv2.FONT_HERSHEY_SIMPLEX, 0.6, (0, 0, 0), 2, cv2.LINE_AA)
            tiles.append(image)
        rows.append(np.hstack(tiles))
    if rows:
        cv2.imwrite(str(file), np.vstack(rows))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recordings", type=Path, nargs="+")
    parser.add_argument("--out", type=Path, default=Path("out/fusion"))
    parser.add_argument("--solvers", nargs="+", default=["limbwise", voodoo.Config().solver])
    parser.add_argument(
        "--modes", nargs="+", choices=MODES, default=list(PAPERS), help="depth and fused are always run"
    )
    parser.add_argument("--starts", type=int, default=8, help="runs of each recording; all but the first disturbed")
    parser.add_argument("--jobs", type=int, default=1)
    options = parser.parse_args()
    if options.starts < 1:
        parser.error(f"--starts: expected a number >= 1, found {options.starts}")
    solvers = list(dict.fromkeys(options.solvers))
    modes = [mode for mode in MODES if mode in {"depth", "fused", *options.modes}]
    jobs = [(path, solver, mode, options.starts) for path in options.recordings for solver in solvers for mode in modes]
    if options.jobs > 1:
        with ProcessPoolExecutor(options.jobs) as pool:
            results = list(pool.map(run, jobs))
    else:
        results = [run(job) for job in jobs]
    options.out.mkdir(parents=True, exist_ok=True)
    text = "\n".join(table(results, solver) for solver in solvers)
    (options.out / "table.md").write_text(text, encoding="utf-8")
    print(text)
    plot(results, solvers, options.out / "groups.png")
    for solver in solvers:
        draw(results, options.recordings, solver, options.out / f"frames_{solver}.png")


if __name__ == "__main__":
    main()
