"""Error of wrists with and without the keypoints that a network finds in the color images of rendered people.

python lab/experiments/fusion_network.py ../shared/data/rendered --network mediapipe
"""

import argparse
import time
from pathlib import Path

import numpy as np

from voodoo.evaluation.evaluate import compare
from voodoo.evaluation.metrics import JOINTS
from voodoo.export.track import Track
from voodoo.pipeline.detected import Detected
from voodoo.pipeline.run import track
from voodoo.pipeline.start import start_tracker
from voodoo.recordings.loaders import open_recording
from voodoo.sensors.keypoints.networks import KeypointNetwork, network_of
from voodoo.sensors.settings import FrontEndSettings

CASES = (("depth",), ("depth", "keypoints"), None, "all")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--network", default="mediapipe")
    parser.add_argument("--init", choices=["auto"])
    arguments = parser.parse_args()
    spent = []
    network = network_of(arguments.network)
    network = KeypointNetwork(network.name, timed(network.detect, spent), network.layout)
    print("recording, then mm of wrists and of all joints: depth | depth + keypoints | all | all + keypoints")
    rows = []
    for path in sorted(arguments.folder.glob("dev_*")):
        row = []
        for use in CASES:
            recording = open_recording(path)
            if use in (("depth", "keypoints"), "all"):
                recording = Detected(recording, network)
            kinds = None if use == "all" else use
            tracker = start_tracker(recording, use=kinds, init=arguments.init)
            steps = track(recording, tracker, settings=FrontEndSettings.of(recording, use=kinds))
            errors = compare(recording, Track.of([step.estimate for step in steps]))
            wrists = [JOINTS.index(name) for name in ("l_wrist", "r_wrist")]
            row += [1e3 * np.nanmean(errors[:, wrists]), 1e3 * np.nanmean(errors)]
        rows.append(row)
        print(path.name, words(row), flush=True)
    print("mean", words(np.mean(rows, axis=0)))
    print(f"{len(spent)} images, {1e3 * np.median(spent):.1f} ms in the median")


def timed(detect, spent):
    def call(image):
        began = time.perf_counter()
        people = list(detect(image))
        spent.append(time.perf_counter() - began)
        return people

    return call


def words(row) -> str:
    pairs = np.reshape(row, (-1, 2))
    return " | ".join(f"{wrist:.1f} {every:.1f}" for wrist, every in pairs)


if __name__ == "__main__":
    main()
