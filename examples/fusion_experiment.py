"""The fusion experiment of K06 section V on recordings with exact truth: depth only, 2-D only, both, and all sensors.

    python examples/fusion_experiment.py ../shared/data/rendered/dev_* --out out/fusion

The 2-D cue is skin colour: head and hands in one colour picture. Writes table.md, groups.png (error of each joint
group) and frames.png (what each of the ways makes of the frame in which depth alone is farthest off).
"""

import argparse
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import cv2
import matplotlib
import numpy as np

import voodoo
from voodoo.recordings import ColorImage, open_recording
from voodoo.sensors.front_end import FrontEnd, FrontEndSettings, paired
from voodoo.sensors.pixels import in_sensor

matplotlib.use("Agg")
import matplotlib.pyplot as plt

MODES = {
    "depth": ("depth",),
    "2-D": ("skin",),
    "fused": ("depth", "skin"),
    "all": ("depth", "skin", "scan"),
}
GROUPS = {
    "trunk": ("humanoid_root", "vc7", "l_shoulder", "r_shoulder", "l_hip", "r_hip"),
    "head": ("head_center", "skull_tip"),
    "elbows": ("l_elbow", "r_elbow"),
    "wrists and hands": ("l_wrist", "r_wrist", "l_hand", "r_hand"),
    "knees": ("l_knee", "r_knee"),
    "ankles": ("l_ankle", "r_ankle"),
}
PAIRS = (("shoulder", "elbow"), ("elbow", "hand"), ("hip", "knee"), ("knee", "ankle"), ("shoulder", "hip"))
LIMBS = (
    *((f"{side}_{a}", f"{side}_{b}") for side in "lr" for a, b in PAIRS),
    ("l_shoulder", "r_shoulder"),
    ("l_hip", "r_hip"),
    ("vc7", "skull_tip"),
)


@dataclass(frozen=True)
class Result:
    """One recording, tracked in one way: errors (F, J) [m] of the truth's joints, and estimated joints by frame."""

    recording: str
    solver: str
    mode: str
    names: tuple[str, ...]
    errors: np.ndarray
    joints: list[dict[str, np.ndarray]]

    def group(self, name: str) -> float:
        columns = [self.names.index(joint) for joint in GROUPS[name]]
        return float(self.errors[:, columns].mean())


def run(job: tuple[Path, str, str]) -> Result:
    path, solver, mode = job
    recording = open_recording(path)
    # The papers' solver with the papers' ten limbs, any other with the default human.
    model = "papers" if solver == "limbwise" else "full"
    body = voodoo.Body.human(height=recording.start["height_m"], model=model)
    tracker = voodoo.Tracker(body, config=voodoo.Config(solver=solver))
    tracker.reset(joints=recording.start["joints"], fit_sizes=True)
    settings = FrontEndSettings(use=MODES[mode], ground_z=0.0)
    front_end = FrontEnd(tracker, settings=settings)
    reference = recording.reference
    errors, joints = [], []
    for index, recorded in enumerate(paired(recording)):
        estimate = front_end.step(recorded)
        found = {name: np.array(estimate.joints[name]) for name in reference.names}
        joints.append(found)
        errors.append([np.linalg.norm(found[name] - reference.positions[index, i]) for i, name in enumerate(found)])
    return Result(recording.name, solver, mode, reference.names, np.array(errors), joints)


def table(results: list[Result], solver: str) -> str:
    """Mean errors in cm, recording by recording, and the change that fusion makes."""
    chosen = {(r.recording, r.mode): r for r in results if r.solver == solver}
    recordings = list(dict.fromkeys(name for name, _ in chosen))
    lines = [f"Solver `{solver}`: mean error (cm) of a joint group, {' / '.join(MODES)}.", ""]
    lines += ["| recording | " + " | ".join(GROUPS) + " |", "|---" * (len(GROUPS) + 1) + "|"]
    for name in recordings:
        cells = [" / ".join(f"{100 * chosen[name, mode].group(group):.1f}" for mode in MODES) for group in GROUPS]
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    for mode in ("fused", "all"):
        change = {
            group: [chosen[n, mode].group(group) / chosen[n, "depth"].group(group) - 1 for n in recordings]
            for group in GROUPS
        }
        medians = " | ".join(f"{100 * np.median(values):+.0f} %" for values in change.values())
        worst = " | ".join(f"{100 * max(values):+.0f} %" for values in change.values())
        lines += [f"| **{mode} against depth, median** | {medians} |", f"| **{mode} against depth, worst** | {worst} |"]
    return "\n".join(lines) + "\n"


def plot(results: list[Result], solvers: list[str], file: Path) -> None:
    figure, axes = plt.subplots(1, len(solvers), figsize=(6.5 * len(solvers), 4), sharey=True, squeeze=False)
    for axis, solver in zip(axes[0], solvers, strict=True):
        for offset, mode in enumerate(MODES):
            chosen = [r for r in results if r.solver == solver and r.mode == mode]
            values = [100 * np.median([r.group(group) for r in chosen]) for group in GROUPS]
            axis.bar(np.arange(len(GROUPS)) + 0.2 * offset, values, width=0.19, label=mode)
        axis.set_xticks(np.arange(len(GROUPS)) + 0.3, list(GROUPS), rotation=20)
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
        gain = (chosen["depth"].errors - chosen["fused"].errors)[:, hands].mean(axis=1)
        frame, picture = -1, None
        for index, recorded in enumerate(paired(recording)):
            shown = next((item for item in recorded.measurements if isinstance(item, ColorImage)), None)
            if shown is not None and (frame < 0 or gain[index] > gain[frame]):
                frame, picture = index, shown
        if picture is None:
            raise SystemExit(f"{recording.name}: expected colour pictures, found none")
        truth = dict(zip(recording.reference.names, recording.reference.positions[frame], strict=True))
        tiles = []
        for mode in ("depth", "2-D", "fused"):
            image = cv2.resize(picture.image, None, fx=1.5, fy=1.5, interpolation=cv2.INTER_CUBIC)
            for joints, colour in ((truth, (255, 255, 255)), (chosen[mode].joints[frame], (0, 90, 255))):
                points = in_sensor(picture.root_from_sensor, list(joints.values()))
                pixels = dict(zip(joints, 1.5 * picture.camera.project(points) + 0.25, strict=True))
                for a, b in LIMBS:
                    if np.isfinite([pixels[a], pixels[b]]).all():
                        start, end = np.round(pixels[a]).astype(int), np.round(pixels[b]).astype(int)
                        cv2.line(image, tuple(start), tuple(end), colour, 2, cv2.LINE_AA)
            text = f"{mode} {100 * chosen[mode].errors[frame, hands].mean():.0f} cm"
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
    parser.add_argument("--jobs", type=int, default=1)
    options = parser.parse_args()
    solvers = list(dict.fromkeys(options.solvers))
    jobs = [(path, solver, mode) for path in options.recordings for solver in solvers for mode in MODES]
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
