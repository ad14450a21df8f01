"""How reliable `Estimate.limb_probability` is, and the two numbers that were fitted for it.

    python lab/experiments/limb_probability.py D/rendered/dev_* D/anybody/ab_*
    python lab/experiments/limb_probability.py D/utd-mhad --every 3

Tracks recordings by depth, each from its own start or, with `--init auto`, from nothing. For elbows, wrists, knees and ankles it
prints, by the probability that was reported for the limb that ends there, how many were within 10 cm of the truth: without
constant offsets of joints, and without contradictions, where the reference is another tracker's. Then the constants
`WITHIN_10_CM` of the core that would fit these recordings, each recording with the same weight.
"""

from __future__ import annotations

import argparse
import itertools
from pathlib import Path

import numpy as np
import numpy.typing as npt

from voodoo.evaluation import metrics
from voodoo.evaluation.evaluate import CARRIER, reference_positions
from voodoo.evaluation.score import LIMIT_EXACT_M
from voodoo.evaluation.search import find_recordings
from voodoo.pipeline.run import track
from voodoo.pipeline.start import start_tracker
from voodoo.recordings import open_recording
from voodoo.sensors.settings import FrontEndSettings

WITHIN_10_CM = (2.0 * np.log(2.0), 0.43)
"""As in the core, from which they are taken back."""
EDGES = (0.0, 0.5, 0.8, 0.95, 1.0)
Array = npt.NDArray[np.float64]


def of(path: Path, init: str | None) -> tuple[Array, npt.NDArray[np.bool_]]:
    """Probabilities of limb ends, and whether they are within 10 cm."""
    recording = open_recording(path)
    tracker = start_tracker(recording, init=init, use=("depth",))  # type: ignore[arg-type]
    steps = [one.estimate for one in track(recording, tracker, settings=FrontEndSettings.of(recording, use=("depth",)))]
    stamps = np.array([one.stamp for one in steps])
    unknown = np.full(3, np.nan)
    places = np.array([[one.joints.get(name, unknown) for name in metrics.JOINTS] for one in steps])
    limbs = [CARRIER.get(name, "") for name in metrics.JOINTS]
    said = np.array([[one.limb_probability.get(limb, np.nan) for limb in limbs] for one in steps])
    truth = reference_positions(recording, stamps)
    if recording.reference is not None and recording.reference.exact:
        errors = metrics.joint_errors(places, truth)
    else:
        truth = metrics.without_contradictions(truth)
        errors = metrics.without_offsets(places, metrics.shifted(truth, metrics.best_lag(places, truth)))
    known = np.isfinite(errors) & np.isfinite(said)
    return said[known], errors[known] <= LIMIT_EXACT_M


def fitted(log_odds: Array, right: npt.NDArray[np.bool_], weight: Array) -> Array:
    """Intercept and slope of a logistic regression, by Newton's method."""
    rows, found = np.column_stack([np.ones_like(log_odds), log_odds]), np.zeros(2)
    for _ in range(30):
        p = 1.0 / (1.0 + np.exp(-rows @ found))
        bend = (rows * (weight * p * (1.0 - p))[:, None]).T @ rows
        found += np.linalg.solve(bend, rows.T @ (weight * (right - p)))
    return found


def main() -> None:
    """Measure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recordings", nargs="+", type=Path)
    parser.add_argument("--every", type=int, default=1, help="of the recordings")
    parser.add_argument("--init", choices=["auto"])
    options = parser.parse_args()
    found = [of(path, options.init) for path in find_recordings(options.recordings)[:: options.every]]
    said, right = (np.concatenate(parts) for parts in zip(*found, strict=True))
    weight = np.concatenate([np.full(len(one), 1.0 / max(len(one), 1)) for one, _ in found])
    print("| probability | limb ends | said, % | within 10 cm, % |\n|---|---|---|---|")
    for low, high in itertools.pairwise(EDGES):
        here = (said >= low) & (said < high)
        if here.any():
            print(
                f"| {low} to {high} | {here.sum()} | {100 * said[here].mean():.0f} | {100 * right[here].mean():.0f} |"
            )
    measured = said >= 0.8
    shares = f"{100 * right[measured].mean():.1f} % of those from 0.8 on"
    print(f"\n{len(found)} recordings: within 10 cm are {shares}, {100 * right[~measured].mean():.1f} % of the others")
    possible = said > 0.0
    odds = (np.log(said[possible] / (1.0 - said[possible])) - WITHIN_10_CM[0]) / WITHIN_10_CM[1]
    intercept, slope = fitted(odds, right[possible], weight[possible])
    print(f"fitted: {intercept:.2f} {slope:.2f}")


if __name__ == "__main__":
    main()
