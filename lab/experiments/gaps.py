"""How a track goes on after seconds without a frame.

    python lab/experiments/gaps.py D/rendered/dev_* [--gaps 1 2 3]

Every recording is tracked by depth alone from its own start, with all frames of an interval left out. Of the ten frames after the
interval, prints how many have no joint farther than 15 cm from the truth, how many of the others are called `tracking`, and the
same a second later.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt
from disturbed_starts import Played, known

import voodoo
from voodoo.evaluation.evaluate import compare
from voodoo.export.track import Track
from voodoo.pipeline.run import track
from voodoo.sensors.settings import FrontEndSettings

FRAMES = 10
RIGHT_M = 0.15
LATER_S = 1.0


def after(path: Path, begin: float, length: float) -> npt.NDArray[np.int64]:
    """Right frames, wrong frames that are called `tracking`, and all frames: in the first ten and later, (2, 3)."""
    recording = Played(voodoo.open_recording(path), backwards=False, every=1)
    first = recording.frames[0].stamp
    recording.frames = [frame for frame in recording.frames if not 0 < frame.stamp - first - begin < length]
    start, _ = known(recording)
    tracker = voodoo.Tracker(voodoo.Body.human(start["height_m"]))
    tracker.reset(joints=start["joints"])
    settings = FrontEndSettings.of(recording, use=("depth",))
    estimates = [step.estimate for step in track(recording, tracker, settings=settings)]
    errors = compare(recording, Track.of(estimates, body=tracker.body), at_best_lag=False)
    stamps = np.array([estimate.stamp for estimate in estimates])
    right = (errors < RIGHT_M).all(axis=1)
    wrong = ~right & np.array([estimate.status == "tracking" for estimate in estimates])
    since = stamps - first - begin - length
    groups = (np.flatnonzero(since >= 0)[:FRAMES], np.flatnonzero(since >= LATER_S)[:FRAMES])
    return np.array([[right[group].sum(), wrong[group].sum(), len(group)] for group in groups])


def main(paths: Sequence[Path], gaps: Sequence[float]) -> None:
    """Print a row a gap."""
    print("| gap, s | frames right: at once | a second later | wrong and tracking: at once | a second later |")
    print("|---|---|---|---|---|")
    for gap in gaps:
        counts = np.zeros((2, 3), dtype=np.int64)
        for path in paths:
            frames = list(voodoo.open_recording(path))
            spare = frames[-1].stamp - frames[0].stamp - gap - 0.5
            for begin in np.arange(0.5, spare, 0.5):
                counts += after(path, float(begin), gap)
        shares = [f"{100 * row[k] / max(row[2], 1):.0f} % of {row[2]}" for k in (0, 1) for row in counts]
        print(f"| {gap:g} | " + " | ".join(shares) + " |", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("paths", type=Path, nargs="+")
    parser.add_argument("--gaps", type=float, nargs="+", default=[1.0, 2.0, 3.0])
    known_arguments = parser.parse_args()
    main(known_arguments.paths, known_arguments.gaps)
