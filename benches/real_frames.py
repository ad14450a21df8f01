"""What a frame of a recording costs, from measurements in memory to the estimate, front end and Python included.

    python benches/real_frames.py RECORDINGS... [--use depth] [--init auto] [--runs 3] [--save POSES.npz]

Prints CPU milliseconds a frame of one thread: for every recording the least of the runs, and the mean over the recordings.
With --save the joints of every frame are written, to be compared bit by bit with those of another build.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Literal

import cv2
import numpy as np
import numpy.typing as npt
from in_memory import InMemory

from voodoo.measurements import ColorImage
from voodoo.pipeline.run import start_tracker, track
from voodoo.recordings import open_recording
from voodoo.sensors.settings import FrontEndSettings

PICTURES = {"color", "skin"}
"""Kinds of inputs that look at color pictures."""


def in_memory(path: Path, use: set[str]) -> InMemory:
    """A recording with its color pictures decoded, if they are in use."""
    source = open_recording(path)
    frames = list(source)
    for frame in frames:
        for item in frame.measurements:
            if isinstance(item, ColorImage) and not use.isdisjoint(PICTURES):
                _ = item.image
    return InMemory(source, frames)


def run(
    recording: InMemory, use: tuple[str, ...], init: Literal["auto"] | None
) -> tuple[float, list[npt.NDArray[np.float64]]]:
    """CPU seconds of one run, and the joints (J, 3) [m] of every frame."""
    tracker = start_tracker(recording, init=init)  # type: ignore[arg-type]
    settings = FrontEndSettings.of(recording, use=use)  # type: ignore[arg-type]
    joints = []
    began = time.process_time()
    for step in track(recording, tracker, settings=settings):  # type: ignore[arg-type]
        joints.append(step.estimate.joint_positions)
    return time.process_time() - began, joints


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recordings", nargs="+", type=Path, metavar="RECORDING")
    parser.add_argument("--use", nargs="+", default=["depth", "scan"], help="kinds of measurements")
    parser.add_argument("--init", choices=["auto"], help="nobody says where the person is; else their start is given")
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--save", type=Path, help="write joints and milliseconds")
    asked = parser.parse_args()
    cv2.setNumThreads(1)
    use, least, poses = tuple(asked.use), [], {}
    for path in asked.recordings:
        recording = in_memory(path, set(use))
        runs = [run(recording, use, asked.init) for _ in range(asked.runs)]
        least.append(min(seconds for seconds, _ in runs) / len(recording) * 1e3)
        if asked.save:
            for index, joints in enumerate(runs[0][1]):
                poses[f"{path.name}/{index:05d}"] = joints.copy()
        print(f"{least[-1]:6.2f} ms a frame, {len(recording)} frames: {recording.name}", flush=True)
    print(f"{np.mean(least):6.2f} ms a frame: mean of {len(least)} recordings")
    if asked.save:
        np.savez(asked.save, **poses)


if __name__ == "__main__":
    main()
