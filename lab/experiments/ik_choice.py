"""Where the defaults of ik.Options come from: mean errors (mm) of elbows and knees over the rendered recordings that
ik_tables.py does not report, for several margins, thins and cautions, with one and with two views; without and with a rest
posture, the mean of the postures so far; and with other rests.

    python lab/experiments/ik_choice.py DATA/rendered
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from ik_limbs import LIMBS, Truth, errors, follow
from ik_tables import rendered

from voodoo import ik

REPORTED = ("dev_03_punch", "dev_05_walk")
GRID = [
    (margin, thin, caution)
    for margin in (0.9, 1.0, 1.1, 1.2, 1.3)
    for thin in (1.7,)
    for caution in (0.05, 0.1, 0.2, 0.3, 0.4)
]
GRID += [(1.1, thin, caution) for thin in (0.0, 1.35, 2.0) for caution in (0.1, 0.2, 0.3)]
RESTS = {
    "none": None,
    "all angles zero": lambda chain, start: chain.rest(),
    "no turn but about the first axis": lambda chain, start: {
        n: 0.0 for n in chain.angle_names if n[-2:] in ("ry", "rz")
    },
    "the first posture": lambda chain, start: start,
    "the mean of the postures so far": "mean",
}
"""What angles may be drawn to, below targets and images."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recordings", type=Path)
    paths = sorted(path.parent for path in parser.parse_args().recordings.glob("*/bag"))
    found: dict[tuple, list[float]] = {}
    for path in paths:
        if path.name in REPORTED:
            continue
        sequence = rendered(path)
        # Cut out once for all settings, with the true joints in place of the last estimates.
        there = [{joint: sequence.truth[joint][at] for joint in LIMBS} for at in range(len(sequence.depths))]
        images = [[sequence.front(at, last), sequence.side[at]] for at, last in enumerate(there)]

        def error(
            views: int,
            truth: Truth = sequence.truth,
            height: float = sequence.height,
            images: list = images,
            **options: Any,
        ) -> float:
            def silhouettes(frame: int, _: Mapping) -> list[ik.Silhouette]:
                return images[frame][:views]

            joints = follow(truth, height, silhouettes if views else None, **options)
            return 1e3 * float(np.mean(list(errors(joints, truth).values())))

        for (margin, thin, caution), views, rest in product(GRID, (1, 2), (None, "mean")):
            mean = error(views, margin=margin, thin=thin, caution=caution, rest=rest)
            found.setdefault((margin, thin, caution, views, rest), []).append(mean)
        for name, views in product(RESTS, (0, 1, 2)):
            found.setdefault((name, views), []).append(error(views, rest=RESTS[name]))
    print("| margin | thin | caution | 1 view | 2 views | mean | at rest: 1 view | 2 views | mean |")
    print("|---|---|---|---|---|---|---|---|---|")
    for setting in GRID:
        words = [str(value) for value in setting]
        for rest in (None, "mean"):
            one, two = (np.mean(found[(*setting, views, rest)]) for views in (1, 2))
            words += [f"{one:.1f}", f"{two:.1f}", f"{0.5 * (one + two):.1f}"]
        print(f"| {' | '.join(words)} |")
    print("\n| rest | plain | 1 view | 2 views |\n|---|---|---|---|")
    for name in RESTS:
        print(f"| {name} | " + " | ".join(f"{np.mean(found[name, views]):.1f}" for views in (0, 1, 2)) + " |")


if __name__ == "__main__":
    main()
