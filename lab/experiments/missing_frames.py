"""How much one missing frame changes the poses of all others, and how much one frame with a little more noise does.

    python lab/experiments/missing_frames.py RECORDINGS... [--every 12]

Of every recording one frame at a time is missing, or has depths that are up to a millimeter off, or one pixel that is a
millimeter off: the one nearest to the middle that has a depth. Compared are the joints of every frame from 0.2 s after it on
with those of the recording as it is. Prints a line a kind: mean, 99 % and greatest distance, share of joints within 5 mm and of
poses whose joints are in the mean, and how far both are from the recording's exact truth.
"""

from __future__ import annotations

import argparse
import sys
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from voodoo.measurements import DepthImage, RecordedFrame
from voodoo.pipeline.run import start_tracker, track
from voodoo.recordings import Recording, open_recording
from voodoo.sensors.settings import FrontEndSettings

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "benches"))
from in_memory import InMemory

USED = ("depth", "scan")
SETTLED_S = 0.2
WITHIN_M = 0.005
KINDS = ("missing", "noise", "pixel")
Joints = npt.NDArray[np.float64]


@dataclass
class Found:
    """Distances [m] of joints from those of the recording as it is, and of both from the truth."""

    apart: list[Joints] = field(default_factory=list)
    errors: list[Joints] = field(default_factory=list)
    errors_before: list[Joints] = field(default_factory=list)

    def line(self) -> str:
        apart, now, before = (np.concatenate(part) for part in (self.apart, self.errors, self.errors_before))
        poses = np.mean([pose.mean() < WITHIN_M for pose in self.apart])
        return (
            f"mean {1e3 * apart.mean():.1f} mm, 99 % {1e3 * np.percentile(apart, 99):.0f} mm, greatest "
            f"{1e3 * apart.max():.0f} mm, within 5 mm {(apart < WITHIN_M).mean():.1%}, poses in the mean "
            f"{poses:.1%}; from the truth {1e3 * np.nanmean(now):.1f} mm, {1e3 * np.nanmean(before):.1f} mm as it is"
        )


def followed(source: Recording, frames: Sequence[RecordedFrame]) -> tuple[dict[float, Joints], tuple[str, ...]]:
    """Joints (J, 3) by stamp, and their names; frames without a body have none."""
    taken, poses, names = InMemory(source, frames), {}, ()
    for step in track(taken, start_tracker(taken), settings=FrontEndSettings.of(taken, use=USED)):  # type: ignore[arg-type]
        if step.estimate.joints:
            names = tuple(step.estimate.joint_names)
            poses[step.recorded.stamp] = step.estimate.joint_positions.copy()
    return poses, names


def changed(frame: RecordedFrame, kind: str) -> list[RecordedFrame]:
    """The frame with other depths, or none."""
    if kind == "missing":
        return []
    rng, items = np.random.default_rng(5), []
    for item in frame.measurements:
        if isinstance(item, DepthImage):
            image = item.image.astype(np.int64)
            millimeter = max(round(0.001 / item.meters_per_unit), 1)
            if kind == "noise":
                image = np.where(image > 0, image + millimeter * rng.integers(-1, 2, image.shape), 0)
            elif len(known := np.argwhere(image)):
                middle = np.abs(known - np.array(image.shape) // 2).sum(axis=1).argmin()
                image[tuple(known[middle])] += millimeter
            item = replace(item, image=image.astype(item.image.dtype))
        items.append(item)
    return [RecordedFrame(frame.stamp, tuple(items))]


def compare(path: Path, every: int, found: dict[str, Found]) -> None:
    """Add what a recording shows."""
    source = open_recording(path, use=USED)
    frames = list(source)
    whole, names = followed(source, frames)
    reference = source.reference
    assert reference is not None, f"{path}: expected an exact truth"
    order = [reference.names.index(name) if name in reference.names else -1 for name in names]
    places = np.concatenate([reference.positions, np.full((len(reference.stamps), 1, 3), np.nan)], axis=1)[:, order]

    def error(stamp: float, joints: Joints) -> Joints:
        return np.linalg.norm(joints - places[np.abs(reference.stamps - stamp).argmin()], axis=1)

    for at in range(20, len(frames) - 10, every):
        for kind in KINDS:
            poses, _ = followed(source, [*frames[:at], *changed(frames[at], kind), *frames[at + 1 :]])
            for stamp, joints in poses.items():
                if stamp >= frames[at].stamp + SETTLED_S and stamp in whole:
                    found[kind].apart.append(np.linalg.norm(joints - whole[stamp], axis=1))
                    found[kind].errors.append(error(stamp, joints))
                    found[kind].errors_before.append(error(stamp, whole[stamp]))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recordings", nargs="+", type=Path, metavar="RECORDING")
    parser.add_argument("--every", type=int, default=12, help="frames from one that is changed to the next")
    asked = parser.parse_args()
    found: dict[str, Found] = defaultdict(Found)
    for path in asked.recordings:
        compare(path, asked.every, found)
    for kind in KINDS:
        print(f"{kind}: {found[kind].line()}")


if __name__ == "__main__":
    main()
