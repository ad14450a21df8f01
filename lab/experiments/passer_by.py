"""A passer-by in front of a tracked person: how often the tracker says that it tracks while it follows the wrong one.

    python lab/experiments/passer_by.py D/rendered/dev_0* [--speed 0.3 0.6 1.2]

A made-up body walks by 0.8 m in front of the person, in depth and color, and the person is tracked from the recording's own
start by one tracker, and found by `voodoo.People`. For the frames in which the passer-by is in the scene: those in which the
root of the estimate is farther than 0.5 m from the person and the status is `tracking`, those in which it is that far at all,
the greatest distance, and those without a pose. The id of the person is the one that is near them most often.
"""

import argparse
import sys
from collections import Counter
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np

import voodoo
from voodoo.pipeline.run import track
from voodoo.pipeline.start import start_tracker

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests"))

from synthetic.passer_by import WithPasserBy

FAR_M = 0.5
ROOT = "humanoid_root"


@dataclass(frozen=True)
class Passed:
    """Frames with the passer-by, those of them in which the estimate was far, and those in which it said `tracking` then; the
    greatest distance [m], and frames without a pose."""

    frames: int
    far: int
    wrong: int
    greatest: float
    without: int


def passed(recording: WithPasserBy, estimates: list[voodoo.Estimate | None]) -> Passed:
    """Judge the estimates of the person, one a frame; None: no row."""
    truth = recording.people
    roots = truth.of(ROOT)[:, 0]
    begin, end = recording.passes
    frames = far = wrong = without = 0
    greatest = 0.0
    for recorded, estimate in zip(recording, estimates, strict=True):
        if not begin <= recorded.stamp <= end:
            continue
        frames += 1
        if estimate is None or not estimate.joints:
            without += 1
            continue
        index = int(np.abs(truth.stamps - recorded.stamp).argmin())
        away = float(np.linalg.norm(estimate.joints[ROOT] - roots[index]))
        greatest = max(greatest, away)
        far += away > FAR_M
        wrong += away > FAR_M and estimate.status == "tracking"
    return Passed(frames, far, wrong, greatest, without)


def alone(recording: WithPasserBy) -> list[voodoo.Estimate | None]:
    """One tracker from the recording's start."""
    return [step.estimate for step in track(recording, start_tracker(recording))]


def among_others(recording: WithPasserBy) -> list[voodoo.Estimate | None]:
    """The person's estimates of `voodoo.People`."""
    steps = [step.estimate for step in track(recording, voodoo.People())]
    truth = recording.people
    near: Counter[int] = Counter()
    for step in steps:
        place = truth.of(ROOT)[np.abs(truth.stamps - step.stamp).argmin(), 0]
        posed = (one for one in step if one.estimate.joints)
        near.update(one.id for one in posed if np.linalg.norm(one.estimate.joints[ROOT] - place) <= FAR_M)
    own = max(near, key=near.__getitem__, default=None)
    return [next((one.estimate for one in step if one.id == own), None) for step in steps]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recordings", nargs="+", type=Path, help="recordings of one person with exact truth")
    parser.add_argument("--speed", type=float, nargs="+", default=[0.6], help="of the passer-by, m/s (default 0.6)")
    options = parser.parse_args()
    print(
        "| recording | m/s | frames | tracker: wrong | far | greatest, m | no pose "
        "| People: wrong | far | greatest, m | no pose |"
    )
    print("|---|---|---|---|---|---|---|---|---|---|---|")
    for path, speed in product(options.recordings, options.speed):
        recording = WithPasserBy(voodoo.open_recording(path), speed=speed)
        one, several = (passed(recording, follow(recording)) for follow in (alone, among_others))
        cells = [f"{each.wrong} | {each.far} | {each.greatest:.2f} | {each.without}" for each in (one, several)]
        print(f"| {recording.name} | {speed:g} | {one.frames} | " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
