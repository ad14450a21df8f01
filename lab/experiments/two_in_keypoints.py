"""Two persons in the keypoints of four cameras, whom nobody names: their ids, and their errors from triangulated keypoints.

Whom the tracker has farther than half a meter from both is counted apart.

python lab/experiments/two_in_keypoints.py D/pose2sim-two
"""

import argparse
from pathlib import Path

import numpy as np

import voodoo
from voodoo.evaluation.metrics import JOINTS
from voodoo.pipeline.run import track
from voodoo.recordings import open_recording
from voodoo.recordings.marker_trajectories import Z_UP_FROM_Y_UP, read_trc
from voodoo.recordings.pose2sim import SITES

NEAR_M = 0.5
"""A tracked person is one of the two within this mean distance of their joints."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    folder = parser.parse_args().folder
    files = [next(folder.glob(f"*_P{number}_0-100.trc")) for number in (1, 2)]
    read = [read_trc(file).of(SITES) for file in files]
    known = [(names, positions @ Z_UP_FROM_Y_UP.T) for names, positions in read]
    errors: list[list[float]] = [[] for _ in known]
    ids: list[set[int]] = [set() for _ in known]
    others = 0
    for step in track(open_recording(folder), voodoo.People()):
        for person in step.estimate:
            away = [
                np.nanmean(
                    [
                        np.linalg.norm(person.estimate.joints[name] - places[step.index, names.index(name)])
                        for name in JOINTS
                        if name in names
                    ]
                )
                for names, places in known
            ]
            if not np.nanmin(away, initial=np.inf) <= NEAR_M:
                others += 1
                continue
            nearest = int(np.nanargmin(away))
            errors[nearest].append(float(away[nearest]))
            ids[nearest].add(person.id)
    for number, (own, distances) in enumerate(zip(ids, errors, strict=True), start=1):
        print(f"person {number}: ids {sorted(own)}, {len(distances)} frames, {100 * np.mean(distances):.1f} cm")
    print(f"nobody near: {others} poses")


if __name__ == "__main__":
    main()
