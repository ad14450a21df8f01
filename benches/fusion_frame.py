"""Where the time of a fused frame goes: depth, skin, 2-D keypoints and a laser scan, from images to the estimate.

    python benches/fusion_frame.py [RECORDING]

The recording (default: the bundled one, time of flight 176x144, color 320x240, laser) gets simulated keypoints of its own
reference in the color picture. Pictures are decoded beforehand. Prints CPU milliseconds of one thread, mean over all
frames, with the body of eighteen limbs (`full`).
"""

import argparse
import time
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

import voodoo
from voodoo.pipeline.front_end import FrontEnd
from voodoo.pipeline.pairing import paired
from voodoo.recordings import ColorImage, KeypointImage, RecordedFrame, Recording, open_recording, sample_path
from voodoo.recordings.keypoint_layouts import LAYOUTS
from voodoo.sensors.adapters.keypoints import KeypointsAdapter
from voodoo.sensors.pixels import in_sensor
from voodoo.sensors.settings import FrontEndSettings
from voodoo.sensors.skin.tracker import SkinTracker


def keypoints(item: ColorImage, positions: dict[str, np.ndarray], chance: np.random.Generator) -> KeypointImage:
    """A person of COCO's seventeen keypoints, 3 px noise."""
    names = {"l_shoulder": 5, "r_shoulder": 6, "l_elbow": 7, "r_elbow": 8, "l_wrist": 9, "r_wrist": 10}
    names |= {"l_hip": 11, "r_hip": 12, "l_knee": 13, "r_knee": 14, "l_ankle": 15, "r_ankle": 16}
    person = np.zeros((17, 3))
    for name, row in names.items():
        pixel = item.camera.project(in_sensor(item.root_from_sensor, positions[name][None]))[0]
        person[row] = [*(pixel + chance.normal(0.0, 3.0, 2)), 0.9]
    return KeypointImage(
        sensor="keypoints",
        stamp=item.stamp,
        layout="coco17",
        people=(person,),
        camera=item.camera,
        root_from_sensor=item.root_from_sensor,
    )


def with_keypoints(recording: Recording, recorded: Iterable[RecordedFrame]) -> list[RecordedFrame]:
    """Frames whose pictures are decoded, with keypoints of the reference in each."""
    chance = np.random.default_rng(3)
    frames: list[RecordedFrame] = []
    for index, frame in enumerate(recorded):
        items = list(frame.measurements)
        for item in frame.measurements:
            if isinstance(item, ColorImage):
                _ = item.image
                names, places = recording.reference.names, recording.reference.positions[index]
                items.append(keypoints(item, dict(zip(names, places, strict=True)), chance))
        frames.append(replace(frame, measurements=tuple(items)))
    return frames


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recording", type=Path, nargs="?", default=sample_path())
    options = parser.parse_args()
    cv2.setNumThreads(1)
    if "coco17" not in LAYOUTS:
        raise SystemExit("expected the layout coco17")
    recording = open_recording(options.recording)
    frames = with_keypoints(recording, paired(recording))
    # The clock of CPU time is slow on some machines: the whole is timed without looking at its parts.
    began = time.process_time()
    run(recording, frames)
    whole = (time.process_time() - began) / len(frames)
    print(f"{'whole frame':32s} {1e3 * whole:6.2f} ms, {1.0 / whole:.0f} Hz of one thread, {len(frames)} frames")
    for label, seconds in parts(recording, frames).items():
        print(f"{label:32s} {1e3 * seconds / len(frames):6.2f} ms")


def run(recording: Recording, frames: list[RecordedFrame]) -> None:
    body = voodoo.Body.human(height=recording.start["height_m"], model="full")
    tracker = voodoo.Tracker(body)
    tracker.reset(joints=recording.start["joints"], fit_sizes=True)
    front_end = FrontEnd(tracker, settings=FrontEndSettings(use=("depth", "scan", "keypoints", "skin"), ground_z=0.0))
    for recorded in frames:
        front_end.step(recorded)


def parts(recording: Recording, frames: list[RecordedFrame]) -> dict[str, float]:
    """Seconds of the parts and of all that is none of them, less what the clock itself takes."""
    spent: dict[str, float] = {}
    calls = 0
    began = time.process_time()
    for _ in range(200):
        time.process_time()
    clock = (time.process_time() - began) / 200

    def timed(label, function):
        spent[label] = 0.0

        def call(*arguments, **named):
            nonlocal calls
            calls += 1
            began = time.process_time()
            try:
                return function(*arguments, **named)
            finally:
                spent[label] += time.process_time() - began - clock

        return call

    owners = {
        "of it the tracker's step": (voodoo.Tracker, "step"),
        "skin: regions": (SkinTracker, "observe"),
        "skin: learning": (SkinTracker, "learn"),
        "keypoints": (KeypointsAdapter, "add"),
    }
    before = {label: getattr(owner, name) for label, (owner, name) in owners.items()}
    for label, (owner, name) in owners.items():
        setattr(owner, name, timed(label, before[label]))
    try:
        began = time.process_time()
        run(recording, frames)
        # Two looks at the clock a call.
        whole = time.process_time() - began - 2 * calls * clock
    finally:
        for label, (owner, name) in owners.items():
            setattr(owner, name, before[label])
    return spent | {"the rest, most of it Python": whole - sum(spent.values())}


if __name__ == "__main__":
    main()
