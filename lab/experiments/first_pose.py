"""The first pose: people who are found by depth alone in the first frames of recordings.

    python lab/experiments/first_pose.py D/utd-mhad D/rendered
    python lab/experiments/first_pose.py D/utd-mhad --every 20

Nothing that lies beside a recording is used for the start (as with `--init auto`), and recordings without a complete reference
in their first frame are left out. A row for exact truth and one for reference skeletons:

- exchanged: shoulders and hips lie nearer to the reference's opposite ones, so left is right or front is back: in the first
  pose, and LATER frames after it;
- not started by the fifth frame; the number of the first frame with a pose, counted from 1 (median and worst);
- mean error of the twelve joints there, and with each joint's constant offset removed: of a reference skeleton, the median
  difference over all recordings, in its trunk axes.
"""

import argparse
import multiprocessing
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import voodoo
from voodoo.evaluation import metrics
from voodoo.evaluation.evaluate import use_one_thread
from voodoo.evaluation.search import find_recordings
from voodoo.names import SEARCHING
from voodoo.pipeline.run import track
from voodoo.pipeline.start import start_tracker
from voodoo.sensors.settings import FrontEndSettings

LATER = 10
IN_TIME = 5
"""A start is in time in one of the first five frames."""
LONGEST = 30
"""Frames in which somebody is looked for."""
PAIRS = [(metrics.JOINTS.index(f"l_{joint}"), metrics.JOINTS.index(f"r_{joint}")) for joint in ("shoulder", "hip")]


@dataclass(frozen=True, eq=False)
class First:
    """The first pose of a recording.

    Args:
        name: of the recording.
        exact: whether its reference is truth.
        frame: number of the first frame with a pose, from 1; None: nobody was found in LONGEST frames.
        joints: metrics.JOINTS there (12, 3) [m].
        reference: the same of the reference.
        exchanged: in the first pose, and LATER frames after it.
    """

    name: str
    exact: bool
    frame: int | None
    joints: np.ndarray
    reference: np.ndarray
    swapped: tuple[bool, bool]


def first(path: Path) -> First | None:
    """The first pose of a recording, found by depth alone; None where the reference does not know the first frame."""
    recording = voodoo.open_recording(path)
    reference = recording.reference
    if reference is None or not set(metrics.JOINTS) <= set(reference.names):
        return None
    places = reference.positions[:, [reference.names.index(name) for name in metrics.JOINTS]]
    if not np.isfinite(places[0]).all():
        return None
    tracker = start_tracker(recording, init="auto", use=("depth",))
    settings = FrontEndSettings.of(recording, use=("depth",))
    nothing = np.full((len(metrics.JOINTS), 3), np.nan)
    found: int | None = None
    at_first, later = (nothing, nothing), (nothing, nothing)
    for frame in track(recording, tracker, settings=settings):
        if frame.index >= (LONGEST if found is None else found + LATER):
            break
        if frame.estimate.status == SEARCHING:
            continue
        nearest = np.argmin(np.abs(reference.stamps - frame.estimate.stamp))
        later = (np.array([frame.estimate.joints[name] for name in metrics.JOINTS]), places[nearest])
        if found is None:
            found, at_first = frame.index + 1, later
    return First(recording.name, reference.exact, found, *at_first, (swapped(*at_first), swapped(*later)))


def swapped(joints: np.ndarray, reference: np.ndarray) -> bool:
    """Whether shoulders and hips (12, 3) lie nearer to the reference's opposite ones than to their own."""
    own = sum(np.linalg.norm(joints[[left, right]] - reference[[left, right]], axis=1).sum() for left, right in PAIRS)
    other = sum(np.linalg.norm(joints[[left, right]] - reference[[right, left]], axis=1).sum() for left, right in PAIRS)
    return bool(other < own)


def row(which: str, poses: Sequence[First]) -> str:
    """A line of the table."""
    numbers = np.array([LONGEST + 1 if pose.frame is None else pose.frame for pose in poses])
    late = int((numbers > IN_TIME).sum())
    joints, reference = (np.array([getattr(pose, what) for pose in poses]) for what in ("joints", "reference"))
    plain = metrics.mean_or_nan(metrics.joint_errors(joints, reference))
    without = metrics.mean_or_nan(metrics.without_offsets(joints, reference))
    at_first, later = (sum(pose.swapped[when] for pose in poses) for when in (0, 1))
    worst = f"{numbers.max()}" if numbers.max() <= LONGEST else "never"
    cells = [
        which,
        f"{len(poses)}",
        f"{at_first}; {later}",
        f"{late} ({100.0 * late / len(poses):.1f} %)",
        f"{np.median(numbers):.0f}; {worst}",
        f"{100.0 * plain:.1f}",
        f"{100.0 * without:.1f}" if len(poses) > 1 and not poses[0].exact else "",
    ]
    return "| " + " | ".join(cells) + " |"


def poses_of(paths: Sequence[Path], jobs: int) -> Iterator[First]:
    """The first poses of those recordings that have a reference for the first frame."""
    if jobs == 1:
        yield from (pose for pose in map(first, paths) if pose is not None)
        return
    with ProcessPoolExecutor(jobs, multiprocessing.get_context("spawn"), initializer=use_one_thread) as pool:
        yield from (pose for pose in pool.map(first, paths, chunksize=4) if pose is not None)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recordings", nargs="+", type=Path, help="recordings, or folders of them")
    parser.add_argument("--every", type=int, default=1, help="use every n-th recording (default 1)")
    parser.add_argument("--jobs", type=int, default=2, help="processes (default 2)")
    options = parser.parse_args()
    if options.every < 1 or options.jobs < 1:
        parser.error(f"--every, --jobs: expected at least 1, found {options.every} and {options.jobs}")
    poses = list(poses_of(find_recordings(options.recordings)[:: options.every], options.jobs))
    print(
        "| reference | recordings | exchanged: first, later | late | frame: median, worst | error, cm | no offsets, cm |"
    )
    print("|---|---|---|---|---|---|---|")
    for which, exact in (("exact truth", True), ("a skeleton", False)):
        group = [pose for pose in poses if pose.exact == exact]
        if group:
            print(row(which, group))
    wrong = [pose.name for pose in poses if any(pose.swapped)]
    late = [f"{pose.name} ({pose.frame or 'never'})" for pose in poses if pose.frame is None or pose.frame > IN_TIME]
    print(f"\nexchanged: {', '.join(wrong) or 'none'}\nlate: {', '.join(late) or 'none'}")


if __name__ == "__main__":
    main()
