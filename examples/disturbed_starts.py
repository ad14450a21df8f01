"""How much of a result is chance: recordings tracked by depth alone from their own start and from disturbed ones.

    python examples/disturbed_starts.py ../shared/data/rendered/dev_* --starts 5

The first run starts from init.json, the others with 4 mm of noise on its joints. Prints mean error, class (K06 Table I made
automatic) and the joints that are still lost at the end, run by run.
"""

import argparse
from pathlib import Path

import numpy as np

import voodoo
from voodoo import metrics
from voodoo.evaluate import compare
from voodoo.recordings import Recording
from voodoo.results import Track
from voodoo.running import track

NOISE_M = 0.004


def run(recording: Recording, chance: np.random.Generator, noise: float) -> tuple[float, int, list[str]]:
    """Mean error [m], class and the joints lost at the end."""
    if recording.start is None or recording.reference is None:
        raise SystemExit(f"{recording.name}: expected a recording with a start and exact truth, found none")
    tracker = voodoo.Tracker(voodoo.Body.human(recording.start["height_m"]))
    joints = recording.start["joints"].items()
    tracker.reset(joints={name: np.add(place, chance.normal(0.0, noise, 3)) for name, place in joints})
    result = Track.of([step.estimate for step in track(recording, tracker)], body=tracker.body)
    errors = compare(recording, result)
    kind, lost = metrics.tracking_class(errors, result.stamps, limit=0.10)
    return float(errors.mean()), kind, [name for name, gone in zip(metrics.JOINTS, lost[-1], strict=True) if gone]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recordings", nargs="+", type=Path)
    parser.add_argument("--starts", type=int, default=5)
    options = parser.parse_args()
    ended, means = 0, []
    print("| recording | error, cm | mean | class | lost at the end |\n|---|---|---|---|---|")
    for path in options.recordings:
        recording = voodoo.open_recording(path, use=("depth",))
        chance = np.random.default_rng(0)
        runs = [run(recording, chance, NOISE_M if start else 0.0) for start in range(options.starts)]
        errors = [100.0 * error for error, _, _ in runs]
        gone = [", ".join(names) for _, _, names in runs if names]
        ended += len(gone)
        means.append(np.mean(errors))
        cells = [
            " ".join(f"{error:.1f}" for error in errors),
            f"{means[-1]:.1f}",
            " ".join(str(kind) for _, kind, _ in runs),
        ]
        print(f"| {recording.name} | " + " | ".join(cells) + f" | {'; '.join(gone) or 'none'} |", flush=True)
    total = len(options.recordings) * options.starts
    print(f"\nmean {np.mean(means):.2f} cm; {ended} of {total} runs end with a joint lost")


if __name__ == "__main__":
    main()
