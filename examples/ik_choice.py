"""Where the defaults of ik.Options come from: mean errors (mm) of elbows and knees over the rendered recordings that
ik_tables.py does not report, for several margins, thins and cautions, with one and with two views.

    python examples/ik_choice.py DATA/rendered
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from ik_limbs import LIMBS, errors, follow
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


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recordings", type=Path)
    paths = sorted(path.parent for path in parser.parse_args().recordings.glob("*/bag"))
    found: dict[tuple[float, float, float, int], list[float]] = {}
    for path in paths:
        if path.name in REPORTED:
            continue
        sequence = rendered(path)
        # Cut out once for all settings, with the true joints in place of the last estimates.
        there = [{joint: sequence.truth[joint][frame] for joint in LIMBS} for frame in range(len(sequence.depths))]
        images = [[sequence.front(frame, last), sequence.side[frame]] for frame, last in enumerate(there)]
        for margin, thin, caution in GRID:
            for views in (1, 2):

                def silhouettes(
                    frame: int, _: Mapping, views: int = views, images: list = images
                ) -> list[ik.Silhouette]:
                    return images[frame][:views]

                joints = follow(sequence.truth, sequence.height, silhouettes, margin=margin, thin=thin, caution=caution)
                mean = 1e3 * np.mean(list(errors(joints, sequence.truth).values()))
                found.setdefault((margin, thin, caution, views), []).append(mean)
    print("| margin | thin | caution | 1 view | 2 views | mean |\n|---|---|---|---|---|---|")
    for margin, thin, caution in GRID:
        one, two = (np.mean(found[margin, thin, caution, views]) for views in (1, 2))
        print(f"| {margin} | {thin} | {caution} | {one:.1f} | {two:.1f} | {0.5 * (one + two):.1f} |")


if __name__ == "__main__":
    main()
