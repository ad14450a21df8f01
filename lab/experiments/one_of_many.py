"""Who is followed when several people come and go, and one is tracked: found, seated, gone, and the next one found.

    python lab/experiments/one_of_many.py D/people/pp_*

Depth alone, without a first pose. The first table has a row for every stretch of time in which the same person, nobody or
something else is followed; a person is followed while the tracked root is within 0.5 m of theirs. The second has a row for
every stretch in which a person is in view, by 80 % of their pixels at some time: how long after that the first pose of them
comes (before it where less of them was enough), the share of the frames they are followed in, how it was while they sat, and
how long after they left nobody or another person is followed: a body that is left behind belongs to no person. A person who
comes while another one is followed is not followed: one body is tracked.
"""

import argparse
import csv
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path

import numpy as np

import voodoo
from voodoo.evaluation import metrics
from voodoo.pipeline.run import track
from voodoo.pipeline.start import start_tracker
from voodoo.sensors.settings import FrontEndSettings

NEAR_M = 0.5
"""A root is a person's within this."""
IN_VIEW = 0.8
"""A person is in view when so many of their pixels are, as in first_seen.json."""
SEATED = 0.75
"""Who sits has the root below this share of its greatest height."""
NOBODY = 0
ELSE = -1
"""Numbers beside those of people: nothing is tracked, or what is no person."""


@dataclass(frozen=True, eq=False)
class People:
    """Truth of several people: at each of the stamps (F,) [s], of each person, P of them.

    Args:
        stamps: (F,) [s].
        numbers: (P,) as in the file, from 1.
        in_view: (F, P) share of their pixels, 0 where there is none.
        roots: (F, P, 3) [m], NaN where there is none.
        joints: (F, P, 12, 3) [m], metrics.JOINTS.
    """

    stamps: np.ndarray
    numbers: np.ndarray
    in_view: np.ndarray
    roots: np.ndarray
    joints: np.ndarray

    @classmethod
    def load(cls, path: Path) -> "People":
        """Read a truth_people.csv: stamp_s, person, in_view, then NAME_x, NAME_y, NAME_z [m]."""
        with path.open(newline="", encoding="utf-8") as file:
            header, *rows = csv.reader(file)
        if header[:3] != ["stamp_s", "person", "in_view"] or not rows:
            raise SystemExit(f"{path}: expected rows of stamp_s, person, in_view, ..., found {header[:3]}")
        table = np.array(rows, dtype=np.float64)
        stamps, frame = np.unique(table[:, 0], return_inverse=True)
        numbers, person = np.unique(table[:, 1].astype(int), return_inverse=True)
        in_view = np.zeros((len(stamps), len(numbers)))
        in_view[frame, person] = table[:, 2]
        places = []
        for name in ("humanoid_root", *metrics.JOINTS):
            first = header.index(f"{name}_x")
            place = np.full((len(stamps), len(numbers), 3), np.nan)
            place[frame, person] = table[:, first : first + 3]
            places.append(place)
        return cls(stamps, numbers, in_view, places[0], np.stack(places[1:], axis=2))

    def at(self, stamps: np.ndarray) -> "People":
        """The same at other stamps (F,) [s]: of the nearest time, nobody where none is within 10 ms."""
        index = np.abs(self.stamps - stamps[:, None]).argmin(axis=1)
        missing = np.abs(self.stamps[index] - stamps) > 0.01
        in_view, roots, joints = self.in_view[index], self.roots[index], self.joints[index]
        in_view[missing], roots[missing], joints[missing] = 0.0, np.nan, np.nan
        return People(stamps, self.numbers, in_view, roots, joints)

    def followed(self, roots: np.ndarray) -> np.ndarray:
        """Who each of the tracked roots (F, 3) [m] belongs to, (F,): their number, NOBODY where it is NaN, else ELSE."""
        away = np.linalg.norm(self.roots - roots[:, None], axis=2)
        away[np.isnan(away)] = np.inf
        who = np.where(away.min(axis=1) <= NEAR_M, self.numbers[away.argmin(axis=1)], ELSE)
        return np.where(np.isfinite(roots).all(axis=1), who, NOBODY)


@dataclass(frozen=True, eq=False)
class Followed:
    """A recording tracked by depth alone, F frames.

    Args:
        truth: at the frames' stamps.
        who: number of who is followed (F,), NOBODY or ELSE.
        lost: whether the status was `lost` (F,).
        errors: mean error [m] (F,) of the twelve joints against who is followed; NaN without.
    """

    truth: People
    who: np.ndarray
    lost: np.ndarray
    errors: np.ndarray


def follow(path: Path) -> Followed:
    """Track a recording of several people as one person, by depth alone and without a first pose."""
    recording = voodoo.open_recording(path, use=("depth",))
    tracker = start_tracker(recording, init="auto")
    estimates = [step.estimate for step in track(recording, tracker, settings=FrontEndSettings.of(recording))]
    nothing = np.full(3, np.nan)
    names = ("humanoid_root", *metrics.JOINTS)
    found = np.array([[estimate.joints.get(name, nothing) for name in names] for estimate in estimates])
    truth = People.load(path / "truth_people.csv").at(np.array([estimate.stamp for estimate in estimates]))
    who = truth.followed(found[:, 0])
    errors = np.full(len(who), np.nan)
    for column, number in enumerate(truth.numbers):
        there = who == number
        errors[there] = np.linalg.norm(found[there, 1:] - truth.joints[there, column], axis=2).mean(axis=1)
    lost = np.array([estimate.status == "lost" for estimate in estimates])
    return Followed(truth, who, lost, errors)


def stretches(flags: np.ndarray) -> list[slice]:
    """Runs of the same value, as slices."""
    ends = np.cumsum([len(list(run)) for _, run in groupby(flags.tolist())])
    return [slice(int(start), int(end)) for start, end in zip([0, *ends[:-1]], ends, strict=True)]


def cm(errors: np.ndarray) -> str:
    """Their mean in centimeters, nothing without any."""
    mean = metrics.mean_or_nan(errors)
    return f"{100.0 * mean:.1f}" if np.isfinite(mean) else ""


def timeline(result: Followed) -> list[str]:
    """Rows of the first table."""
    words = {NOBODY: "nobody", ELSE: "something else"}
    times = result.truth.stamps - result.truth.stamps[0]
    rows = []
    for part in stretches(result.who):
        who = int(result.who[part.start])
        lost = f"{100.0 * result.lost[part].mean():.0f} %" if who != NOBODY else ""
        span = f"{times[part][0]:.1f} to {times[part][-1]:.1f}"
        rows.append(f"| {span} | {words.get(who, f'person {who}')} | {lost} | {cm(result.errors[part])} |")
    return rows


def visits(result: Followed) -> list[str]:
    """Rows of the second table."""
    truth = result.truth
    times = truth.stamps - truth.stamps[0]
    rows = []
    for column, number in enumerate(truth.numbers):
        height = truth.roots[:, column, 2]
        seated = height < SEATED * np.nanmax(height)
        for part in stretches(truth.in_view[:, column] > 0.0):
            clear = np.flatnonzero(truth.in_view[part, column] >= IN_VIEW)
            if not len(clear):
                continue
            mine = result.who[part] == number
            begins = part.start + int(clear[0])
            wait, error = "never", ""
            if mine.any():
                first = part.start + int(mine.argmax())
                wait, error = f"{times[first] - times[begins]:+.2f} s ({first - begins:+d})", cm(result.errors[[first]])
            sat = seated[part]
            sitting = f"{100.0 * mine[sat].mean():.0f} %, {cm(result.errors[part][mine & sat])} cm" if sat.any() else ""
            stayed = ""
            if mine[-1] and part.stop < len(times):
                gone = np.flatnonzero(~np.isin(result.who[part.stop :], (number, ELSE)))
                end = part.stop + int(gone[0]) if len(gone) else len(times) - 1
                stayed = f"{'' if len(gone) else 'over '}{times[end] - times[part.stop]:.1f} s"
            span = f"{number}: {times[part][0]:.1f} to {times[part][-1]:.1f}"
            rows.append(f"| {span} | {wait} | {error} | {100.0 * mine.mean():.0f} % | {sitting} | {stayed} |")
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recordings", nargs="+", type=Path, help="folders with a bag and truth_people.csv")
    for path in parser.parse_args().recordings:
        result = follow(path)
        print(f"{path.name}\n\n| seconds | followed | called lost | error, cm |\n|---|---|---|---|")
        print("\n".join(timeline(result)))
        print("\n| person in view, s | first pose after | error, cm | followed | seated: followed | stayed after |")
        print("|---|---|---|---|---|---|")
        print("\n".join(visits(result)) + "\n", flush=True)


if __name__ == "__main__":
    main()
