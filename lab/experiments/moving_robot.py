"""What a moving robot costs: the same made-up walk seen by a camera that moves 1.5 m and turns by 30 degrees, and standing still.

    python lab/experiments/moving_robot.py --seeds 5

The root frame is `odom`. A row for each seed: mean joint error from the first pose on, of one tracker that finds the person by
itself and of `voodoo.People`, standing, moving, and the difference.
"""

import argparse
import sys
from pathlib import Path

import numpy as np

import voodoo
from voodoo.evaluation import metrics
from voodoo.evaluation.people_evaluate import judge
from voodoo.pipeline.run import track
from voodoo.pipeline.start import AUTO, start_tracker

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests"))

from synthetic import stories
from synthetic.people import MadeUpRecording


def alone(recording: MadeUpRecording) -> float:
    """Mean error [m] of one tracker over the frames with most of the person in view."""
    truth = recording.people
    expected = np.stack([truth.of(name)[:, 0] for name in metrics.JOINTS], axis=1)
    errors = []
    for step in track(recording, start_tracker(recording, init=AUTO)):
        if step.estimate.joints and truth.in_view[step.index, 0] >= 0.8:
            found = np.array([step.estimate.joints[name] for name in metrics.JOINTS])
            errors.append(np.linalg.norm(found - expected[step.index], axis=1).mean())
    return float(np.mean(errors)) if errors else float("nan")


def among_others(recording: MadeUpRecording) -> float:
    """The same of `voodoo.People`."""
    return judge(recording, voodoo.People()).joint_error_m


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=5, help="how many walks (default 5)")
    count = parser.parse_args().seeds
    if count < 1:
        parser.error(f"--seeds: expected at least 1, found {count}")
    print("| seed | tracker: standing, cm | moving | more | People: standing, cm | moving | more |")
    print("|---|---|---|---|---|---|---|")
    rows = []
    for seed in range(count):
        standing, moving = (stories.robot(seed, moving=moves) for moves in (False, True))
        row = []
        for measure in (alone, among_others):
            before, after = 100.0 * measure(standing), 100.0 * measure(moving)
            row += [before, after, after - before]
        rows.append(row)
        print(f"| {seed} | " + " | ".join(f"{value:.2f}" for value in row) + " |", flush=True)
    print("| mean | " + " | ".join(f"{value:.2f}" for value in np.mean(rows, axis=0)) + " |")


if __name__ == "__main__":
    main()
