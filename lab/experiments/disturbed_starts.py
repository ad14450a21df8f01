"""How much of a result is chance: recordings tracked by depth alone from their own start and from disturbed ones.

    python lab/experiments/disturbed_starts.py ../shared/data/rendered/dev_* --starts 5

The first run starts from init.json, the others with 4 mm of noise on its joints. Prints mean error, class (K06 Table I made
automatic) and the joints that are still lost at the end, run by run; how many of the limbs that were off by 10 cm, and of the
others, were not called measured; and how errors compare with their standard deviations. Against a reference skeleton, which
leads the depth by some frames, errors are at the recording's best lag, without its implausible joints, and 15 cm count as lost,
as in `voodoo eval`. A joint is lost at the end if it is in the last frame in which the truth knows it.

`--backwards` plays the recordings from their end, starting from the true joints there, and `--every 2` leaves out every second
frame: other motions of the same people.
"""

import argparse
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

import voodoo
from voodoo.evaluation import metrics
from voodoo.evaluation.calibration import Deviations, calibrate, calibration_markdown, sigma_of
from voodoo.evaluation.evaluate import called_measured, limb_ends, reference_positions
from voodoo.evaluation.score import LIMIT_EXACT_M, LIMIT_REFERENCE_M
from voodoo.export.track import Track
from voodoo.pipeline.run import track
from voodoo.recordings import RecordedFrame, Recording, RecordingInfo, Reference, Start
from voodoo.sensors.settings import FrontEndSettings

NOISE_M = 0.004


def known(recording: Recording) -> tuple[Start, Reference]:
    """Start and reference of a recording that has both."""
    if recording.start is None or recording.reference is None:
        raise SystemExit(f"{recording.name}: expected a recording with a start and a reference, found none")
    return recording.start, recording.reference


class Played(Recording):
    """A recording with exact truth, played from its end or faster."""

    def __init__(self, recording: Recording, *, backwards: bool, every: int) -> None:
        start, truth = known(recording)
        self.recording = recording
        self.path, self.name, self.root_frame = recording.path, recording.name, recording.root_frame
        self.start, self.reference = start, truth
        self.frames = list(recording)
        if backwards:
            ends = self.frames[0].stamp + self.frames[-1].stamp
            last = truth.positions[np.argmin(np.abs(truth.stamps - self.frames[-1].stamp))]
            there = dict(zip(truth.names, last, strict=True))
            joints = {name: there[name] for name in start["joints"] if name in there}
            self.start = {**start, "joints": joints}
            self.reference = replace(truth, stamps=ends - truth.stamps[::-1], positions=truth.positions[::-1])
            self.frames = [mirrored(frame, ends) for frame in reversed(self.frames)]
        self.frames = self.frames[::every]

    def __len__(self) -> int:
        return len(self.frames)

    def __iter__(self) -> Iterator[RecordedFrame]:
        return iter(self.frames)

    def info(self) -> RecordingInfo:
        return self.recording.info()


def mirrored(frame: RecordedFrame, ends: float) -> RecordedFrame:
    """The frame at its stamp's mirror image between the ends."""
    items = [replace(item, stamp=ends - item.stamp) for item in frame.measurements]
    return replace(frame, stamp=ends - frame.stamp, measurements=tuple(items))


def run(
    recording: Recording, chance: np.random.Generator, noise: float
) -> tuple[float, int, list[str], list[tuple[int, int]], Deviations]:
    """Mean error [m], class, the joints lost at the end; of limbs off by 10 cm, and of the others, how many were not called
    measured and how many there were; and the errors by coordinate."""
    start, reference = known(recording)
    height = start.get("height_m")
    tracker = voodoo.Tracker(voodoo.Body.human() if height is None else voodoo.Body.human(height))
    joints = start["joints"].items()
    tracker.reset(joints={name: np.add(place, chance.normal(0.0, noise, 3)) for name, place in joints})
    settings = FrontEndSettings.of(recording, use=("depth",))
    estimates = [step.estimate for step in track(recording, tracker, settings=settings)]
    result = Track.of(estimates, body=tracker.body)
    positions = metrics.places_of(result.joint_names, result.joints)
    places, lag = reference_positions(recording, result.stamps), 0
    if not reference.exact:
        places = metrics.without_contradictions(places)
        lag = metrics.best_lag(positions, places)
    off = positions - metrics.shifted(places, lag)
    errors = np.linalg.norm(off, axis=2)
    limit = LIMIT_EXACT_M if reference.exact else LIMIT_REFERENCE_M
    kind, lost = metrics.tracking_class(errors, result.stamps, limit=limit)
    measured = np.array([called_measured(estimate) for estimate in estimates])
    known_lost = [gone[there] for gone, there in zip(lost.T, np.isfinite(errors).T, strict=True)]
    groups = [limb_ends(errors, far=far) for far in (True, False)]
    return (
        metrics.mean_or_nan(errors),
        kind,
        [name for name, gone in zip(metrics.JOINTS, known_lost, strict=True) if gone[-1:].any()],
        [(int((group & ~measured).sum()), int(group.sum())) for group in groups],
        Deviations(off, np.array([sigma_of(estimate) for estimate in estimates]), measured),
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recordings", nargs="+", type=Path)
    parser.add_argument("--starts", type=int, default=5)
    parser.add_argument("--backwards", action="store_true", help="play the recordings from their end")
    parser.add_argument("--every", type=int, default=1, help="use every n-th frame (default 1)")
    options = parser.parse_args()
    if options.every < 1:
        parser.error(f"--every: expected at least 1, found {options.every}")
    ended, means, counts, exact = 0, [], np.zeros((2, 2), dtype=int), True
    deviations: list[Deviations] = []
    print("| recording | error, cm | mean | class | lost at the end |\n|---|---|---|---|---|")
    for path in options.recordings:
        recording: Recording = voodoo.open_recording(path)
        if options.backwards or options.every > 1:
            recording = Played(recording, backwards=options.backwards, every=options.every)
        chance = np.random.default_rng(0)
        runs = [run(recording, chance, NOISE_M if start else 0.0) for start in range(options.starts)]
        errors = [100.0 * error for error, *_ in runs]
        gone = [", ".join(names) for _, _, names, *_ in runs if names]
        counts += np.sum([count for *_, count, _ in runs], axis=0)
        deviations += [each for *_, each in runs]
        exact &= known(recording)[1].exact
        ended += len(gone)
        means.append(np.mean(errors))
        cells = [
            " ".join(f"{error:.1f}" for error in errors),
            f"{means[-1]:.1f}",
            " ".join(str(kind) for _, kind, *_ in runs),
        ]
        print(f"| {recording.name} | " + " | ".join(cells) + f" | {'; '.join(gone) or 'none'} |", flush=True)
    total = len(options.recordings) * options.starts
    print(f"\nmean {np.mean(means):.2f} cm; {ended} of {total} runs end with a joint lost")
    for (not_measured, all_of_them), which in zip(counts, ("off by 10 cm", "nearer"), strict=True):
        fraction = f"{100.0 * not_measured / all_of_them:.1f} %" if all_of_them else "none"
        print(f"{all_of_them} limbs {which}: {fraction} not called measured")
    calibration = calibrate(deviations)
    if calibration is not None:
        print("\n" + calibration_markdown(calibration, "exact truth" if exact else "reference skeleton"))


if __name__ == "__main__":
    main()
