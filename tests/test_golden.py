"""The published algorithm on the bundled recording, against a stored result: what changes it must be meant.

After a change that is meant to alter the result, and has been looked at: python tests/test_golden.py
"""

import csv
from pathlib import Path

import numpy as np

import voodoo
from voodoo.pipeline.run import track
from voodoo.pipeline.start import start_tracker
from voodoo.recordings import sample_path
from voodoo.sensors.settings import FrontEndSettings

GOLDEN = Path(__file__).with_name("golden_limbwise.csv")
FRAMES = (0, 10, 30, 60, 89)
# Meters. Another processor rounds otherwise, and the nearest limb of a point between two may change with it.
TOLERANCE = 0.005


def tracked():
    """Joint positions by (frame, name) and mean distance to the truth over the whole recording."""
    recording = voodoo.open_recording(sample_path())
    config = voodoo.Config(solver="limbwise", max_steps=6)
    positions, errors = {}, []
    truth = recording.reference
    # A depth image and a scan whose points all weigh 1, as in the papers.
    settings = FrontEndSettings(use=("depth", "scan"), scan_noise=None, ground_z=0.0)
    tracker = start_tracker(recording, config=config, model="papers")
    for frame in track(recording, tracker, settings=settings):
        joints = frame.estimate.joints
        errors += [
            np.linalg.norm(joints[name] - place)
            for name, place in zip(truth.names, truth.positions[frame.index], strict=True)
            if name in joints
        ]
        if frame.index in FRAMES:
            positions.update({(frame.index, name): joints[name] for name in joints})
    return positions, float(np.nanmean(errors))


def write():
    positions, error = tracked()
    with GOLDEN.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["frame", "joint", "x", "y", "z"])
        for (frame, name), place in positions.items():
            writer.writerow([frame, name, *(f"{value:.4f}" for value in place)])
    print(f"{GOLDEN.name}: {len(positions)} positions; mean distance to the truth {100 * error:.1f} cm")


def test_the_published_algorithm_gives_the_stored_poses():
    positions, error = tracked()
    with GOLDEN.open(newline="") as file:
        rows = {(int(row["frame"]), row["joint"]): [float(row[axis]) for axis in "xyz"] for row in csv.DictReader(file)}
    assert set(rows) == set(positions) and {frame for frame, _ in rows} == set(FRAMES)
    off = {key: float(np.linalg.norm(positions[key] - place)) for key, place in rows.items()}
    worst = max(off, key=off.__getitem__)
    assert off[worst] < TOLERANCE, f"{worst} moved by {1000 * off[worst]:.1f} mm; see the head of this file"
    assert error < 0.25, f"the track is {error:.2f} m from the truth on average"


if __name__ == "__main__":
    write()
