"""People cut by the border of the picture: below the hips, below the knees, at one side. Nobody says where they are.

    python lab/experiments/cut_pictures.py D/rendered/dev_*

The pictures end at a row or column, which the true hips, knees or root of the first frame give.
Of each recording and cut: the frame in which the person is found, the share of later frames with a third of the joints in view
that are called lost or have no pose, and the mean error of the joints in view, beside that in the whole picture.
"""

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np
from changed_depth import ChangedDepth

import voodoo
from voodoo.measurements import DepthImage
from voodoo.pipeline.run import track
from voodoo.pipeline.start import AUTO, start_tracker
from voodoo.recordings import open_recording
from voodoo.recordings.recording import Recording
from voodoo.sensors.pixels import in_sensor
from voodoo.sensors.settings import FrontEndSettings

CUTS = {"hips": ("_hip", 1, 20.0), "knees": ("_knee", 1, 0.0), "side": ("humanoid_root", 0, 0.0)}
"""Joints whose mean pixel gives the line, axis of the pixel, and pixels beyond it that stay."""

IN_VIEW = 1.0 / 3.0
"""Least fraction of the joints in view for somebody who is there."""


def cut(recording: Recording, axis: int, line: float) -> ChangedDepth:
    """The recording with depth images that end before a row (axis 1) or column (axis 0)."""

    def ended(item: DepthImage) -> DepthImage:
        size = [item.camera.width, item.camera.height]
        size[axis] = round(min(line, size[axis]))
        image = np.ascontiguousarray(item.image[: size[1], : size[0]])
        return replace(item, image=image, camera=replace(item.camera, width=size[0], height=size[1]))

    return ChangedDepth(recording, ended)


def line_of(recording: Recording, kind: str) -> tuple[int, float]:
    """Axis of the pixel and its value beyond which nothing is seen."""
    part, axis, stays = CUTS[kind]
    reference = recording.reference
    rows = [place for name, place in zip(reference.names, reference.positions[0], strict=True) if part in name]
    item = next(item for frame in recording for item in frame.measurements if isinstance(item, DepthImage))
    pixels = item.camera.project(in_sensor(item.root_from_sensor, np.array(rows)))
    return axis, float(pixels[:, axis].mean()) + stays * item.camera.height / 480.0


def tracked(recording: Recording) -> list[voodoo.Estimate]:
    """The estimates of all frames."""
    tracker = start_tracker(recording, init=AUTO, use=("depth",))
    settings = FrontEndSettings.of(recording, use=("depth",))
    return [step.estimate for step in track(recording, tracker, settings=settings)]


def errors(recording: Recording, estimates: list[voodoo.Estimate], seen: np.ndarray) -> float:
    """Mean error [m] of the joints that are in view (F, J)."""
    reference, found = recording.reference, []
    for estimate, places, visible in zip(estimates, reference.positions, seen, strict=False):
        for name, place, here in zip(reference.names, places, visible, strict=True):
            if here and name in estimate.joints:
                found.append(np.linalg.norm(estimate.joints[name] - place))
    return float(np.mean(found))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recordings", nargs="+", type=Path)
    options = parser.parse_args()
    print(
        "| recording | cut | found in frame | lost, % | error, cm | of the whole picture, cm |\n|---|---|---|---|---|---|"
    )
    sums: dict[str, list[tuple[float, float, float, float]]] = {kind: [] for kind in CUTS}
    for path in options.recordings:
        recording = open_recording(path / "bag" if (path / "bag").is_dir() else path)
        whole = tracked(cut(recording, 1, np.inf))
        for kind in CUTS:
            axis, line = line_of(recording, kind)
            estimates = tracked(cut(recording, axis, line))
            seen = np.zeros(recording.reference.positions.shape[:2], dtype=bool)
            for index, (frame, places) in enumerate(zip(recording, recording.reference.positions, strict=False)):
                item = next(item for item in frame.measurements if isinstance(item, DepthImage))
                seen[index] = item.camera.project(in_sensor(item.root_from_sensor, places))[:, axis] < line
            first = next((index for index, one in enumerate(estimates) if one.joints), len(estimates))
            there = seen.mean(axis=1) > IN_VIEW
            pairs = zip(estimates[first:], there[first:], strict=False)
            gone = [str(one.status) in ("lost", "searching") for one, here in pairs if here]
            lost = float(np.mean(gone)) if gone else 1.0
            row = (first, 100 * lost, 100 * errors(recording, estimates, seen), 100 * errors(recording, whole, seen))
            sums[kind].append(row)
            print(f"| {recording.name} | {kind} | {row[0]} | {row[1]:.1f} | {row[2]:.1f} | {row[3]:.1f} |", flush=True)
    for kind, rows in sums.items():
        late, lost, joints, uncut = np.array(rows).T
        by = f"{np.sum(late <= 3)} of {len(rows)} by frame 3"
        print(f"| all | {kind} | {by} | {lost.mean():.1f} | {np.nanmean(joints):.1f} | {np.nanmean(uncut):.1f} |")


if __name__ == "__main__":
    main()
