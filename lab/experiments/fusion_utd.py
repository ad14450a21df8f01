"""Kinect depth (UTD-MHAD) alone, and with simulated 2-D rays of head and hands.

    python lab/experiments/fusion_utd.py ../shared/data/utd-mhad/Depth/a{3,4,6,7,13,22,23,24,26,27}_s[1-4]_t1_depth.mat

The rays go to the reference skeleton's joints, projected with 3 px noise; 5 % of them point anywhere in the picture.
The reference is the Kinect SDK's skeleton, which leads the depth by two frames. Writes table.md.
"""

import argparse
from pathlib import Path

import numpy as np

import voodoo
from voodoo.evaluation.metrics import JOINTS, joint_errors
from voodoo.pipeline.front_end import FrontEnd
from voodoo.recordings import open_recording
from voodoo.recordings.utd_mhad import CAMERA
from voodoo.sensors.gating import SiteGate
from voodoo.sensors.model import PixelNoise, SensorModel
from voodoo.sensors.pixels import ray_distance, world_rays
from voodoo.sensors.rays import SiteRay, add_rays
from voodoo.sensors.settings import FrontEndSettings

SITES = ("head_center", "l_hand", "r_hand")
BIAS_M = 0.05
"""A Kinect skeleton's head or hand is that far from the body model's, always to the same side."""
LAG, NOISE_PX, WRONG = 2, 3.0, 0.05
GROUPS = {
    "all twelve": JOINTS,
    "elbows": ("l_elbow", "r_elbow"),
    "wrists": ("l_wrist", "r_wrist"),
    "legs": ("l_knee", "r_knee", "l_ankle", "r_ankle"),
}


def run(path: Path, *, rays: bool, solver: str) -> dict[str, float]:
    """Mean error [m] of each group."""
    recording = open_recording(path)
    reference = recording.reference
    # The papers' solver with the papers' ten limbs, any other with the eighteen of `full`.
    body = voodoo.Body.human(model="papers" if solver == "limbwise" else "full")
    tracker = voodoo.Tracker(body, config=voodoo.Config(solver=solver))
    tracker.reset(joints=recording.start["joints"], fit_sizes=True)
    front_end = FrontEnd(tracker, settings=FrontEndSettings(use=("depth",), depth_filter=None))
    chance = np.random.default_rng(11)
    gate = SiteGate()
    noise, model = PixelNoise(pixels=NOISE_PX), SensorModel()
    found = np.empty((len(recording), len(reference.names), 3))
    for index, recorded in enumerate(recording):
        frame = front_end.frame(recorded)
        predicted = tracker.predict(recorded.stamp)
        places = reference.positions[max(index - LAG, 0), [reference.names.index(site) for site in SITES]]
        pixels = CAMERA.project(places) + chance.normal(0.0, NOISE_PX, (len(SITES), 2))
        wrong = chance.random(len(SITES)) < WRONG
        pixels[wrong] = chance.uniform((0, 0), (CAMERA.width, CAMERA.height), (int(wrong.sum()), 2))
        if rays:
            origin, directions = world_rays(CAMERA, np.eye(4), pixels)
            observed = [
                SiteRay(
                    site,
                    origin,
                    direction,
                    noise.sigma(float(predicted[site][2]), CAMERA.fx),
                    "rays",
                    bias=BIAS_M,
                )
                for site, direction in zip(SITES, directions, strict=True)
                if np.isfinite(direction).all()
                and gate.accepts(site, float(ray_distance(origin, direction, predicted[site])), recorded.stamp, "rays")
            ]
            add_rays(frame, observed, model=model)
        estimate = tracker.step(frame)
        found[index] = [estimate.joints.get(name, np.full(3, np.nan)) for name in reference.names]
    errors = joint_errors(found, reference.positions, lag=LAG)
    return {
        group: float(np.nanmean(errors[:, [reference.names.index(name) for name in names]]))
        for group, names in GROUPS.items()
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recordings", type=Path, nargs="+")
    parser.add_argument("--out", type=Path, default=Path("out/fusion_utd"))
    parser.add_argument("--solvers", nargs="+", default=["limbwise", voodoo.Config().solver])
    options = parser.parse_args()
    lines = [
        f"{len(options.recordings)} sequences; mean distance to the Kinect skeleton (cm), depth alone / with rays.",
        "",
        "| solver | " + " | ".join(GROUPS) + " | wrists: better in |",
        "|---" * (len(GROUPS) + 2) + "|",
    ]
    for solver in dict.fromkeys(options.solvers):
        alone = [run(path, rays=False, solver=solver) for path in options.recordings]
        fused = [run(path, rays=True, solver=solver) for path in options.recordings]
        cells = [
            f"{100 * np.mean([r[group] for r in alone]):.1f} / {100 * np.mean([r[group] for r in fused]):.1f}"
            for group in GROUPS
        ]
        better = sum(b["wrists"] < a["wrists"] for a, b in zip(alone, fused, strict=True))
        lines.append(f"| {solver} | " + " | ".join(cells) + f" | {better} of {len(alone)} |")
    table = "\n".join(lines) + "\n"
    options.out.mkdir(parents=True, exist_ok=True)
    (options.out / "table.md").write_text(table, encoding="utf-8")
    print(table)


if __name__ == "__main__":
    main()
