"""Starts by the detector at many frames: recordings with exact truth, tracked by depth alone.

    python lab/experiments/many_starts.py D/rendered/dev_*
    python -m lab.training.unseen OUT && python lab/experiments/many_starts.py OUT/report/*

Every recording is tracked for 1.5 s from every 0.4 s of it. Prints how many starts there are, the mean error of the first pose,
mean and median of the mean errors after each start, the share of starts with a mean error beyond 10 cm, and how many starts had
too few tracked frames, which are in none of these.
"""

import argparse
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np

import voodoo
from voodoo.evaluation import metrics
from voodoo.names import SEARCHING
from voodoo.pipeline.run import track
from voodoo.pipeline.start import start_tracker
from voodoo.sensors.settings import FrontEndSettings

EVERY_S, TRACKED_S, LEFT_S = 0.4, 1.5, 1.0
"""Time between starts, time tracked after each, and least time left in the recording at the last one."""
ENOUGH = 10
"""Starts with no more tracked frames than this are left out."""
FAR_M = 0.1


def errors_of(path: Path) -> list[tuple[float, float]]:
    """Mean error of the first pose and of all poses after each start, meters; NaN with too few."""
    recording = voodoo.open_recording(path)
    reference = recording.reference
    if reference is None or not reference.exact:
        raise SystemExit(f"{path}: expected a recording with exact truth, found none")
    column = [reference.names.index(name) for name in metrics.JOINTS]
    found = []
    for begin in np.arange(reference.stamps[0], reference.stamps[-1] - LEFT_S, EVERY_S):
        tracker = start_tracker(recording, init="auto", use=("depth",))
        settings = FrontEndSettings.of(recording, use=("depth",))
        errors = []
        for frame in track(recording, tracker, settings=settings, after=float(begin)):
            estimate = frame.estimate
            if estimate.stamp > begin + TRACKED_S:
                break
            if estimate.status != SEARCHING:
                truth = reference.positions[np.argmin(np.abs(reference.stamps - estimate.stamp))][column]
                places = np.array([estimate.joints[name] for name in metrics.JOINTS])
                errors.append(float(np.linalg.norm(places - truth, axis=1).mean()))
        found.append((errors[0], float(np.mean(errors))) if len(errors) > ENOUGH else (np.nan, np.nan))
    return found


def main() -> None:
    """Measure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recordings", nargs="+", type=Path)
    parser.add_argument("--jobs", type=int, default=2)
    options = parser.parse_args()
    with ProcessPoolExecutor(options.jobs) as pool:
        found = np.array([each for part in pool.map(errors_of, options.recordings) for each in part]).reshape(-1, 2)
    first, mean = found[np.isfinite(found[:, 1])].T
    few = f"{len(found) - len(mean)} starts with at most {ENOUGH} tracked frames"
    if not len(mean):
        raise SystemExit(f"expected starts with a pose, found {few}")
    print(
        f"{len(mean)} starts: first pose {100 * first.mean():.2f} cm, mean {100 * mean.mean():.2f} cm, "
        f"median {100 * np.median(mean):.2f} cm, {100 * (mean > FAR_M).mean():.1f} % beyond 10 cm; left out: {few}"
    )


if __name__ == "__main__":
    main()
