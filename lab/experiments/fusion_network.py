"""Error of wrists with and without the keypoints that a network finds in the color images of rendered people.

python lab/experiments/fusion_network.py ../shared/data/rendered --network mediapipe
"""

import argparse
from pathlib import Path

import numpy as np

from voodoo.evaluation.evaluate import compare
from voodoo.evaluation.metrics import JOINTS
from voodoo.export.track import Track
from voodoo.pipeline.inputs import Detected
from voodoo.pipeline.run import track
from voodoo.pipeline.start import start_tracker
from voodoo.recordings.loaders import open_recording
from voodoo.sensors.keypoints.networks import network_of
from voodoo.sensors.settings import FrontEndSettings

CASES = ((False, ("depth",)), (True, ("depth", "keypoints")), (False, None), (True, None))
WRISTS = [JOINTS.index(name) for name in ("l_wrist", "r_wrist")]


def errors_of(path, network, use):
    recording = open_recording(path) if network is None else Detected(open_recording(path), network)
    steps = track(recording, start_tracker(recording, use=use), settings=FrontEndSettings.of(recording, use=use))
    errors = 1e3 * compare(recording, Track.of([step.estimate for step in steps]))
    return np.nanmean(errors[:, WRISTS]), np.nanmean(errors)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--network", default="mediapipe")
    arguments = parser.parse_args()
    network, rows = network_of(arguments.network), []
    print("mm of wrists and of all joints: depth | depth + keypoints | all | all + keypoints")
    for path in sorted(arguments.folder.glob("dev_*")):
        rows.append([errors_of(path, network if on else None, use) for on, use in CASES])
        print(path.name, words(rows[-1]), flush=True)
    print("mean", words(np.mean(rows, axis=0)))


def words(row) -> str:
    return " | ".join(f"{wrist:.1f} {every:.1f}" for wrist, every in row)


if __name__ == "__main__":
    main()
