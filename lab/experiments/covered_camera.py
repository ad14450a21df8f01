"""How a person is found again: recordings with exact truth, tracked by depth alone, whose camera is covered in the middle.

    python lab/experiments/covered_camera.py ../shared/data/rendered/dev_0[1-7]* --seconds 1 2

While it is covered, no pixel has a return. Prints the share of covered frames in which the track said `lost`, the mean error of
the twelve joints half a second after, and the same with `relocalization = false`, where nobody looks for a lost body.
"""

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np

import voodoo
from voodoo.evaluation.evaluate import compare
from voodoo.export.track import Track
from voodoo.pipeline.front_end import FrontEnd
from voodoo.pipeline.pairing import paired
from voodoo.pipeline.start import start_tracker
from voodoo.recordings import DepthImage, Measurement
from voodoo.sensors.settings import FrontEndSettings

BACK_S = 0.5
"""So long after the cover is gone the error is taken, over three frames."""


def run(path: Path, seconds: float, *, relocalization: bool) -> tuple[float, float]:
    """Share of the covered frames that are called lost; mean error [m] half a second later."""
    recording = voodoo.open_recording(path)
    if recording.reference is None or not recording.reference.exact:
        raise SystemExit(f"{recording.name}: expected a recording with exact truth, found none")
    frames = list(paired(recording))
    stamps = np.array([frame.stamp for frame in frames])
    begins = 0.5 * (stamps[0] + stamps[-1] - seconds)
    covered = (stamps >= begins) & (stamps < begins + seconds)
    if begins <= stamps[0] or stamps[-1] < begins + seconds + BACK_S:
        raise SystemExit(f"{recording.name}: expected more than {seconds + 2 * BACK_S:g} s, found {np.ptp(stamps):.1f}")
    tracker = start_tracker(recording, config=voodoo.Config(relocalization=relocalization))
    front_end = FrontEnd(tracker, settings=FrontEndSettings.of(recording, use=("depth",)))
    estimates = []
    for frame, hidden in zip(frames, covered, strict=True):
        items = tuple(blank(item) for item in frame.measurements) if hidden else frame.measurements
        estimates.append(front_end.step(replace(frame, measurements=items)))
    lost = np.array([estimate.status == "lost" for estimate in estimates])
    errors = compare(recording, Track.of(estimates, body=tracker.body)).mean(axis=1)
    back = int(np.searchsorted(stamps, begins + seconds + BACK_S))
    return float(lost[covered].mean()), float(np.nanmean(errors[back : back + 3]))


def blank(item: Measurement) -> Measurement:
    """A depth image without any return; what else there is stays, and is not used."""
    return replace(item, image=np.zeros_like(item.image)) if isinstance(item, DepthImage) else item


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recordings", nargs="+", type=Path)
    parser.add_argument("--seconds", nargs="+", type=float, default=[1.0, 2.0])
    options = parser.parse_args()
    print("| recording | covered, s | called lost | error after, cm | without relocalization |\n|---|---|---|---|---|")
    for path in options.recordings:
        for seconds in options.seconds:
            lost, found = run(path, seconds, relocalization=True)
            _, without = run(path, seconds, relocalization=False)
            print(
                f"| {path.name} | {seconds:g} | {100 * lost:.0f} % | {100 * found:.1f} | {100 * without:.1f} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
