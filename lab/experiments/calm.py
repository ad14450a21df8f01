"""How calm estimates are: how far joints move when one frame is left out.

    python lab/experiments/calm.py RECORDINGS... [--starts 8] [--every 24] [--jobs 2]

Every recording is tracked from its start and from starts whose joints have 4 mm of noise; then again with one frame left out, for
every 24th frame. Compared are the joints of both runs from 0.2 s after the missing frame on. Prints the mean over the starts, and
the standard deviation of one start, of

- the median move of measured joints,
- the share of measured joints that move by more than 5 mm and by more than half of their reported standard deviation,
- the share of other joints that move by more than two reported standard deviations,
- the share of joints, and of poses in the mean over their joints, that are within 5 mm.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

import voodoo
from voodoo.measurements import RecordedFrame
from voodoo.pipeline.run import track
from voodoo.recordings import Recording, open_recording
from voodoo.sensors.settings import FrontEndSettings

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "benches"))
from in_memory import InMemory

NOISE_M = 0.004
FIRST = 20
"""Number of the first frame that is left out."""
LAST = 10
"""The last frame that is left out is as far from the end."""
SETTLED_S = 0.2
WITHIN_M = 0.005
SIDED = {
    "shoulder": "clavicle",
    "elbow": "upperarm",
    "wrist": "forearm",
    "hand": "hand",
    "knee": "thigh",
    "ankle": "calf",
}
ENDS = {f"{side}_{joint}": f"{side}_{limb}" for side in "lr" for joint, limb in SIDED.items()}
ENDS |= {"l_hip": "pelvis", "r_hip": "pelvis", "vc7": "thorax", "head_center": "head"}
"""Joints, and the limbs that end there."""
Run = dict[float, tuple[npt.NDArray[np.float64], npt.NDArray[np.float64], npt.NDArray[np.bool_]]]
"""By stamp: joints (J, 3) [m], their standard deviations (J,) [m], and which are measured (J,)."""


def follow(source: Recording, joints: Mapping[str, npt.ArrayLike], frames: Sequence[RecordedFrame]) -> Run:
    """Track frames by depth alone."""
    taken = InMemory(source, frames)
    height = source.start.get("height_m") if source.start else None
    tracker = voodoo.Tracker(voodoo.Body.human() if height is None else voodoo.Body.human(height))
    tracker.reset(joints=joints)
    run: Run = {}
    for step in track(taken, tracker, settings=FrontEndSettings.of(taken, use=("depth",))):  # type: ignore[arg-type]
        estimate = step.estimate
        if estimate.joints:
            run[step.recorded.stamp] = (
                np.array([estimate.joints[name] for name in ENDS]),
                np.array([np.linalg.norm(estimate.joint_sigma[name]) for name in ENDS]),
                np.array([estimate.limb_status[limb] == "measured" for limb in ENDS.values()]),
            )
    return run


def moves(path: Path, number: int, every: int) -> tuple[npt.NDArray[Any], ...]:
    """Moves (N, J) [m] of one start, the standard deviations [m], and which joints are measured."""
    cv2.setNumThreads(1)
    source = open_recording(path, use=("depth",))
    if source.start is None:
        raise SystemExit(f"{path}: expected a recording with a start, found none")
    frames = list(source)
    noise = np.random.default_rng(number).normal(0.0, NOISE_M if number else 0.0, (len(source.start["joints"]), 3))
    joints = {
        name: np.add(place, off) for (name, place), off in zip(source.start["joints"].items(), noise, strict=True)
    }
    whole, apart, sigmas, measured = follow(source, joints, frames), [], [], []
    for at in range(FIRST, len(frames) - LAST, every):
        for stamp, (places, _, _) in follow(source, joints, [*frames[:at], *frames[at + 1 :]]).items():
            if stamp >= frames[at].stamp + SETTLED_S and stamp in whole:
                there, sigma, seen = whole[stamp]
                apart.append(np.linalg.norm(places - there, axis=1))
                sigmas.append(sigma)
                measured.append(seen)
    return np.array(apart), np.array(sigmas), np.array(measured)


def figures(runs: Sequence[tuple[npt.NDArray[Any], ...]]) -> list[float]:
    """The five figures of one start: millimeters, then percent."""
    apart, sigma, measured = (np.concatenate(parts) for parts in zip(*runs, strict=True))
    return [
        1e3 * float(np.median(apart[measured])),
        1e2 * float(np.mean((apart[measured] > WITHIN_M) & (apart[measured] > 0.5 * sigma[measured]))),
        1e2 * float(np.mean(apart[~measured] > 2.0 * sigma[~measured])),
        1e2 * float(np.mean(apart < WITHIN_M)),
        1e2 * float(np.mean(apart.mean(axis=1) < WITHIN_M)),
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recordings", nargs="+", type=Path, metavar="RECORDING")
    parser.add_argument("--starts", type=int, default=8)
    parser.add_argument("--every", type=int, default=24, help="frames from one that is left out to the next")
    parser.add_argument("--jobs", type=int, default=1)
    asked = parser.parse_args()
    cases = [(path, number, asked.every) for number in range(asked.starts) for path in asked.recordings]
    with ProcessPoolExecutor(asked.jobs) as pool:
        runs = list(pool.map(moves, *zip(*cases, strict=True)))
    count = len(asked.recordings)
    table = np.array([figures(runs[number * count : (number + 1) * count]) for number in range(asked.starts)])
    names = (
        "median move of measured joints, mm",
        "measured > 5 mm and > 0.5 sigma, %",
        "others > 2 sigma, %",
        "joints within 5 mm, %",
        "poses within 5 mm, %",
    )
    for name, mean, spread in zip(names, table.mean(axis=0), table.std(axis=0), strict=True):
        print(f"{name}: {mean:.2f} +- {spread:.2f}")


if __name__ == "__main__":
    main()
