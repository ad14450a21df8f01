"""Pictures of what the default tracker loses: the worst frame of each recording, with the reference drawn over the model.

    python lab/experiments/failures.py ../shared/data/rendered/dev_0[23]* --out out/failures.png

Depth alone. A joint is lost while it is farther than 10 cm from exact truth (15 cm from a reference skeleton) for over 0.3 s;
the frame shown is the one in which the lost joints are farthest away. Recordings that lose nothing are left out.
"""

import argparse
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

import voodoo
from voodoo.drawing.surfaces import Picture
from voodoo.evaluation import metrics
from voodoo.model.projection import CameraView
from voodoo.pipeline.run import track
from voodoo.pipeline.start import start_tracker
from voodoo.recordings import DepthImage, RecordedFrame, Recording, RecordingInfo, Reference
from voodoo.recordings.loaders import guess_loader, options_of
from voodoo.visualization.overlay import Overlay, in_rows

BONES = tuple((f"{s}_{a}", f"{s}_{b}") for s in "lr" for a, b in (("shoulder", "elbow"), ("elbow", "wrist")))
BONES += tuple((f"{s}_{a}", f"{s}_{b}") for s in "lr" for a, b in (("hip", "knee"), ("knee", "ankle")))
MAGENTA = (255, 0, 255)
WIDTH, HEIGHT = 420, 520


class DepthAlone(Recording):
    """The depth images of a recording whose loader cannot leave the rest out itself."""

    def __init__(self, recording: Recording) -> None:
        self._recording = recording
        for name in ("path", "name", "root_frame", "start", "reference"):
            setattr(self, name, getattr(recording, name))

    def __len__(self) -> int:
        return len(self._recording)

    def __iter__(self) -> Iterator[RecordedFrame]:
        for frame in self._recording:
            yield RecordedFrame(frame.stamp, tuple(m for m in frame.measurements if isinstance(m, DepthImage)))

    def info(self) -> RecordingInfo:
        about = self._recording.info()
        return replace(about, sensors=tuple(sensor for sensor in about.sensors if sensor.kind == "depth"))


def depth_of(path: Path) -> Recording:
    """A recording without anything but depth."""
    if "use" in options_of(guess_loader(path)):
        return voodoo.open_recording(path, use=("depth",))
    return DepthAlone(voodoo.open_recording(path))


def reference_at(reference: Reference, stamps: np.ndarray) -> np.ndarray:
    """The twelve joints (F, 12, 3), NaN where missing."""
    columns = [reference.names.index(name) for name in metrics.JOINTS]
    places = metrics.match_reference(stamps, reference.stamps, reference.positions, tolerance=0.02)
    return np.asarray(places[:, columns])


def worst(recording: Recording) -> Picture | None:
    """The picture of the worst frame, or None when no joint is lost."""
    if recording.reference is None:
        raise SystemExit(f"{recording.name}: expected a recording with a reference, found none")
    tracker = start_tracker(recording)
    overlay, frames, pictures = Overlay(recording), [], []
    for frame in track(recording, tracker):
        frames.append(frame)
        pictures.append(overlay.draw(frame.recorded, tracker.body, frame.estimate, index=frame.index).copy())
    stamps = np.array([frame.recorded.stamp for frame in frames])
    found = np.array([[frame.estimate.joints[name] for name in metrics.JOINTS] for frame in frames])
    truth = reference_at(recording.reference, stamps)
    exact = recording.reference.exact
    lag = 0 if exact else metrics.best_lag(found, truth)
    errors = metrics.joint_errors(found, truth, lag=lag)
    lost = metrics.tracking_class(errors, stamps, limit=0.10 if exact else 0.15)[1]
    if not lost.any():
        return None
    index = int(np.nanargmax(np.nansum(np.where(lost, errors, 0.0), axis=1)))
    names = ", ".join(name for name, gone in zip(metrics.JOINTS, lost[index], strict=True) if gone)
    depth = next(item for item in frames[index].recorded.measurements if isinstance(item, DepthImage))
    picture = pictures[index]
    scale = picture.shape[0] / depth.image.shape[0]
    places = dict(zip(metrics.JOINTS, truth[max(index - lag, 0)], strict=True))
    view = CameraView(depth.camera, depth.root_from_sensor, scale)
    for bone in BONES:
        ends, _ = view.project(np.array([places[name] for name in bone]))
        if np.isfinite(ends).all():
            cv2.line(picture, *(tuple(np.rint(end).astype(int).tolist()) for end in ends), MAGENTA, 3, cv2.LINE_AA)
    middle, _ = view.project(np.nanmean(truth[max(index - lag, 0)], axis=0)[None])
    wide = round(picture.shape[0] * WIDTH / HEIGHT)
    left = int(np.clip(middle[0, 0] - wide / 2, 0, max(picture.shape[1] - wide, 0)))
    tile = cv2.resize(picture[:, left : left + wide], (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA)
    text = f"{recording.name} {index + 1}/{len(frames)}: {names}"
    cv2.putText(tile, text, (8, HEIGHT - 10), cv2.FONT_HERSHEY_SIMPLEX, 0.4, (255, 255, 255), 1, cv2.LINE_AA)
    return np.asarray(tile, dtype=np.uint8)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recordings", nargs="+", type=Path)
    parser.add_argument("--out", type=Path, required=True, help="the picture, a .png")
    arguments = parser.parse_args()
    tiles = []
    for path in arguments.recordings:
        recording = depth_of(path)
        tile = worst(recording)
        print(recording.name, "loses nothing" if tile is None else "loses joints")
        tiles += [] if tile is None else [tile]
    if tiles:
        arguments.out.parent.mkdir(parents=True, exist_ok=True)
        cv2.imwrite(str(arguments.out), in_rows(tiles, columns=min(len(tiles), 4)))


if __name__ == "__main__":
    main()
