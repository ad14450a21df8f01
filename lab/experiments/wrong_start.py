"""A start that was given wrongly: how soon the body is right again.

    python lab/experiments/wrong_start.py D/rendered/dev_* --at 0.2 0.4 0.6
    python lab/experiments/wrong_start.py D/utd-mhad --every 40

A tracker is put, by `reset`, where the reference has the joints at some frames, but turned about the vertical through the root
by 90 or 180 degrees, or moved by 0.2 to 1 m in a level direction that a seed draws; then it tracks by depth alone. It is right
again in the first frame from which on, to WINDOW_S after the reset, the mean error of the twelve joints is within 10 cm, or
within 1.5 times that of the same run from the right start, whichever is more. Where the reference is a skeleton it is 15 cm:
Kinect's joints are 6 cm from where a body has them. Prints for each disturbance the median of the
seconds until then, the share of the runs within 0.3 and 1 s, those that are never right, and how many runs there were; and the
share of the runs that were right again, or said that they are not (a status other than "tracking"), within 0.3 s, and of the
frames after that in which the body is not right the share that is called "tracking".
A run whose right start goes wrong itself, beyond 10 cm on average, is left out.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np

import voodoo
from voodoo.evaluation import metrics
from voodoo.evaluation.search import find_recordings
from voodoo.pipeline.front_end import FrontEnd
from voodoo.pipeline.pairing import paired
from voodoo.recordings import RecordedFrame, Recording
from voodoo.sensors.settings import FrontEndSettings

WINDOW_S = 2.5
"""What is not right so long after the reset counts as never right."""
RIGHT_M = 0.10
RIGHT_OF_SKELETON_M = 0.15
FACTOR = 1.5
SOON_S = 0.3
"""By then a wrong start is right, or said."""
TURNS_DEG = (90.0, 180.0)
MOVES_M = (0.2, 0.4, 0.6, 1.0)
CASES = [(turn, 0.0) for turn in TURNS_DEG] + [(0.0, move) for move in MOVES_M]
"""Degrees and meters."""


def words(turn: float, move: float) -> str:
    """A disturbance, for the table."""
    return f"turned by {turn:g} degrees" if turn else f"moved by {move:g} m"


def up_of(recording: Recording) -> np.ndarray:
    """The vertical (3,) in the root frame: z, or -y of a camera's frame."""
    return np.array([0.0, -1.0, 0.0] if recording.root_frame.endswith("optical_frame") else [0.0, 0.0, 1.0])


def disturbed(
    joints: dict[str, np.ndarray], turn: float, move: float, up: np.ndarray, angle: float
) -> dict[str, np.ndarray]:
    """The joints turned about the vertical through the root by `turn` degrees, and moved by `move` meters in the level
    direction that an angle [rad] says."""
    root = joints["humanoid_root"]
    a = np.radians(turn)
    level = np.eye(3)[np.argsort(np.abs(up))[:2]]
    step = move * (np.cos(angle) * level[0] + np.sin(angle) * level[1])

    def placed(place: np.ndarray) -> np.ndarray:
        rel = place - root
        turned = rel * np.cos(a) + np.cross(up, rel) * np.sin(a) + up * (up @ rel) * (1.0 - np.cos(a))
        return root + turned + step

    return {name: placed(place) for name, place in joints.items()}


def errors(
    recording: Recording, frames: Sequence[RecordedFrame], joints: dict[str, np.ndarray], body: voodoo.Body
) -> tuple[np.ndarray, np.ndarray]:
    """Mean error [m] of the twelve joints in each of the frames (F,), from a start, infinite where nobody is tracked; and which
    of them (F,) are called "tracking"."""
    reference = recording.reference
    tracker = voodoo.Tracker(body)
    tracker.reset(joints=joints)
    front_end = FrontEnd(tracker, settings=FrontEndSettings.of(recording, use=("depth",)))
    columns = [reference.names.index(name) for name in metrics.JOINTS]
    found, called = [], []
    for frame in frames:
        estimate = front_end.step(frame)
        places = estimate.joints
        called.append(estimate.status == "tracking")
        truth = reference.positions[np.argmin(np.abs(reference.stamps - frame.stamp)), columns]
        away = [
            np.linalg.norm(places[name] - there) for name, there in zip(metrics.JOINTS, truth, strict=True) if places
        ]
        found.append(np.nanmean(away) if away else np.inf)
    return np.array(found), np.array(called)


def is_right(wrong: np.ndarray, right: np.ndarray, least: float) -> np.ndarray:
    """In which frames (F,) the errors from a wrong start are small enough."""
    return wrong <= np.maximum(least, FACTOR * right)


def reported_counts(good: np.ndarray, called: np.ndarray, stamps: np.ndarray) -> tuple[bool, int, int]:
    """Whether within SOON_S a frame is right or not called "tracking"; of the wrong frames after that how many are called so, and
    how many there are."""
    soon = stamps - stamps[0] <= SOON_S + 1e-6
    wrong_late = ~soon & ~good
    return bool((soon & (good | ~called)).any()), int((wrong_late & called).sum()), int(wrong_late.sum())


def seconds_until_right(wrong: np.ndarray, right: np.ndarray, stamps: np.ndarray, least: float = RIGHT_M) -> float:
    """Seconds from the first frame to the first from which on the errors (F,) are small enough: `least` meters always are.
    Infinite without one."""
    good = is_right(wrong, right, least)
    if not good[-1]:
        return float("inf")
    bad = np.flatnonzero(~good)
    return float(stamps[bad[-1] + 1] - stamps[0]) if len(bad) else 0.0


def run(path: Path, at: Sequence[float], seed: int) -> tuple[list[list[float]], list[list[tuple[bool, int, int]]], int]:
    """Seconds until the body is right again and what status it had, for each of CASES lists over the starts; and how many starts
    were left out."""
    recording = voodoo.open_recording(path)
    reference = recording.reference
    if reference is None or "humanoid_root" not in reference.names:
        raise SystemExit(f"{recording.name}: expected a recording with a reference, found none")
    frames = list(paired(recording))
    stamps = np.array([frame.stamp for frame in frames])
    height = (recording.start or {}).get("height_m")
    body = voodoo.Body.human() if height is None else voodoo.Body.human(height)
    chance = np.random.default_rng(seed)
    times: list[list[float]] = [[] for _ in CASES]
    reported: list[list[tuple[bool, int, int]]] = [[] for _ in CASES]
    left_out = 0
    for fraction in at:
        angles = chance.uniform(0.0, 2.0 * np.pi, len(CASES))
        first = round(fraction * (len(frames) - 1))
        part = slice(first, int(np.searchsorted(stamps, stamps[first] + WINDOW_S)))
        there = reference.positions[np.argmin(np.abs(reference.stamps - stamps[first]))]
        joints = {
            name: place
            for name, place in zip(reference.names, there, strict=True)
            if np.isfinite(place).all() and not name.endswith("_toe")
        }
        right, _ = errors(recording, frames[part], joints, body)
        if right.mean() > RIGHT_M or len(right) < 2:
            left_out += 1
            continue
        for times_of, reported_of, (turn, move), angle in zip(times, reported, CASES, angles, strict=True):
            start = disturbed(joints, turn, move, up_of(recording), angle)
            wrong, called = errors(recording, frames[part], start, body)
            least = RIGHT_M if reference.exact else RIGHT_OF_SKELETON_M
            times_of.append(seconds_until_right(wrong, right, stamps[part], least))
            reported_of.append(reported_counts(is_right(wrong, right, least), called, stamps[part]))
    return times, reported, left_out


def row(what: str, times: Sequence[float], reported: Sequence[tuple[bool, int, int]]) -> str:
    """A line of the table."""
    seconds = np.array(times)
    median = float(np.median(seconds)) if len(seconds) else float("nan")
    fractions = (
        [f"{100.0 * np.mean(seconds <= within + 1e-6):.0f} %" for within in (0.3, 1.0)] if len(seconds) else ["", ""]
    )
    never = int(np.isinf(seconds).sum())
    soon = f"{100.0 * np.mean([one[0] for one in reported]):.0f} %" if reported else ""
    called, wrong = sum(one[1] for one in reported), sum(one[2] for one in reported)
    late = f"{100.0 * called / wrong:.0f} % of {wrong}" if wrong else "none"
    cells = [
        what,
        f"{median:.2f}" if np.isfinite(median) else "never",
        *fractions,
        f"{never}",
        f"{len(seconds)}",
        soon,
        late,
    ]
    return "| " + " | ".join(cells) + " |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recordings", nargs="+", type=Path, help="recordings, or folders of them")
    parser.add_argument(
        "--at", nargs="+", type=float, default=[0.1, 0.3, 0.5], help="resets, in shares of the recording"
    )
    parser.add_argument("--every", type=int, default=1, help="use every n-th recording (default 1)")
    options = parser.parse_args()
    if options.every < 1 or not all(0.0 <= fraction < 1.0 for fraction in options.at):
        parser.error(f"--every, --at: expected at least 1 and shares in [0, 1), found {options.every} and {options.at}")
    all_times: list[list[float]] = [[] for _ in CASES]
    all_reported: list[list[tuple[bool, int, int]]] = [[] for _ in CASES]
    left_out = 0
    for seed, path in enumerate(find_recordings(options.recordings)[:: options.every]):
        times, reported, out = run(path, options.at, seed)
        left_out += out
        for index in range(len(CASES)):
            all_times[index] += times[index]
            all_reported[index] += reported[index]
    print(
        "| start | right again after, s (median) | within 0.3 s | within 1 s | never | runs | right or said within 0.3 s "
        "| later wrong frames called tracking |\n|---|---|---|---|---|---|---|---|"
    )
    for (turn, move), times, reported in zip(CASES, all_times, all_reported, strict=True):
        print(row(words(turn, move), times, reported))
    print(
        row(
            "all", [one for times in all_times for one in times], [one for reported in all_reported for one in reported]
        )
    )
    print(f"\nstarts left out, since the right one goes wrong: {left_out}")


if __name__ == "__main__":
    main()
