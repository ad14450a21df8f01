"""How many color cameras it takes: a recording of pictures, tracked by all of its cameras, by all but one, by two and by one.

    python lab/experiments/color_cameras.py ../shared/data/pose2sim
    python lab/experiments/color_cameras.py ../shared/data/multiview/mv_d1_walk_turn_cmu --pairs

Prints a row for each choice: mean error of twelve joints against the recording's truth (at the best lag against a triangulation),
share within 10 cm, share of frames called lost, and user time of a frame. Without a truth the errors are nan.
"""

import argparse
import os
from itertools import combinations
from pathlib import Path

import numpy as np

from voodoo.evaluation.evaluate import compare
from voodoo.export.track import Track
from voodoo.pipeline.inputs import pictures_alone
from voodoo.pipeline.run import start_tracker, track
from voodoo.recordings import open_recording
from voodoo.sensors.settings import FrontEndSettings

USE = ("color",)


def tracked(path: Path, cameras: list[str] | None = None) -> tuple[np.ndarray, Track, float]:
    """Errors (F, 12) [m], the result, and user time of a frame [s]."""
    options = {"loader": None} | pictures_alone(path, None, USE)
    recording = open_recording(path, **options, **({} if cameras is None else {"color_topic": cameras}))
    tracker = start_tracker(recording, use=USE)
    began = os.times().user
    steps = track(recording, tracker, settings=FrontEndSettings.of(recording, use=USE))
    estimates = [step.estimate for step in steps]
    seconds = (os.times().user - began) / len(estimates)
    result = Track.of(estimates, body=tracker.body)
    if recording.reference is None:
        return np.full((len(result), 12), np.nan), result, seconds
    return compare(recording, result, at_best_lag=not recording.reference.exact), result, seconds


def main(path: Path, *, pairs: bool = False) -> dict[str, float]:
    """Print the table; mean error [m] by the choice of cameras."""
    options = {"loader": None} | pictures_alone(path, None, USE)
    names = [sensor.name for sensor in open_recording(path, **options).info().sensors if sensor.kind == "color"]
    choices = {"all": names} | {f"without {name}": [n for n in names if n != name] for name in names if len(names) > 2}
    if pairs:
        choices |= {" + ".join(pair): list(pair) for pair in combinations(names, 2)} | {name: [name] for name in names}
    means = {}
    for words, chosen in choices.items():
        errors, result, seconds = tracked(path, chosen)
        known = errors[np.isfinite(errors)]
        means[words] = float(known.mean()) if known.size else float("nan")
        near = float((known < 0.10).mean()) if known.size else float("nan")
        lost = result.status.count("lost") / len(result)
        print(
            f"{words:<64}{100 * means[words]:6.2f} cm {100 * near:6.1f} % {100 * lost:6.1f} % {1e3 * seconds:7.1f} ms",
            flush=True,
        )
    return means


if __name__ == "__main__":
    words = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    words.add_argument("recording", type=Path)
    words.add_argument("--pairs", action="store_true", help="two cameras and one, too")
    given = words.parse_args()
    main(given.recording, pairs=given.pairs)
