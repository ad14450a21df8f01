"""False bodies: what a tracker without a pose takes for a person where there is none.

    python lab/experiments/false_bodies.py --rooms 48 --seconds 5
    python lab/experiments/false_bodies.py D/people/pp_* --rooms 0

Rooms come from rooms.py: cupboards, coat stands, lamps, pillars, palms and dummies, three in each, one seed a room,
in turn by three sensors and with the floor known and not. They stand still, and so they do in the synthetic room of
tests/room_walk.py without its person. Of recordings of people the frames without a person in view count, and what is tracked
counts as false while its root is farther than 0.5 m from everybody.

A false body is a run of frames in which one is tracked, whatever its status. One that is left behind by a person who was
followed is counted by itself, and so is one that begins while people are in view.
"""

import argparse
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import rooms
from one_of_many import ELSE, follow, stretches

import voodoo
from voodoo.names import SEARCHING

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests"))

from room_walk import Walk
from synthetic.gait import Stop


@dataclass(frozen=True)
class Body:
    """A false body.

    Args:
        seconds: how long it is tracked.
        lost: share of that in which its status is `lost`.
        where: in words.
        kind: "empty" room, "left" behind by a person, or "others": it begins while people are in view.
    """

    seconds: float
    lost: float
    where: str
    kind: str = "empty"


@dataclass(frozen=True)
class Observed:
    """What was seen of empty rooms: for how long [s] they were empty, and the false bodies."""

    name: str
    empty: float
    bodies: tuple[Body, ...]


def in_room(room: rooms.Room, seconds: float, *, floor_known: bool) -> list[Body]:
    """False bodies in a room that was made."""
    estimates = stepped(room.frames(seconds, floor_known=floor_known))
    roots = {index: estimate.joints["humanoid_root"] for index, estimate in enumerate(estimates) if estimate.joints}
    return found(
        estimates,
        rooms.RATE_HZ,
        lambda index: f"room {room.seed}, {room.nearest(*roots[index][:2])}",
    )


def stepped(frames: Iterable[voodoo.Frame]) -> list[voodoo.Estimate]:
    """What a tracker that was never reset says of them."""
    tracker = voodoo.Tracker(voodoo.Body.human())
    return [tracker.step(frame) for frame in frames]


def found(estimates: Sequence[voodoo.Estimate], rate: float, where) -> list[Body]:
    """Every run of frames with a pose."""
    tracked = np.array([estimate.status != SEARCHING for estimate in estimates])
    lost = np.array([estimate.status == "lost" for estimate in estimates])
    runs = [part for part in stretches(tracked) if tracked[part.start]]
    return [Body((part.stop - part.start) / rate, float(lost[part].mean()), where(part.start)) for part in runs]


def in_synthetic(seconds: float) -> Observed:
    """The synthetic room whose person is away."""
    stops = (Stop(0.0, 2.4, 0.0, np.pi), Stop(seconds, 2.4, 0.0, np.pi))
    walk = Walk(body=voodoo.Body.human(), stops=stops, away=((0.0, np.inf),))
    bodies = found(stepped(map(walk.measurement, walk)), rooms.RATE_HZ, lambda _: "synthetic room")
    return Observed("synthetic room", seconds, tuple(bodies))


def in_recording(path: Path) -> Observed:
    """A recording of people who come and go, tracked as one person by depth alone."""
    result = follow(path)
    stamps = result.truth.stamps
    period = float(np.median(np.diff(stamps)))
    empty = ~(result.truth.in_view > 0.0).any(axis=1)
    bodies = []
    for part in stretches(result.who == ELSE):
        if result.who[part.start] != ELSE:
            continue
        left = part.start > 0 and result.who[part.start - 1] > 0
        kind = "left" if left else "empty" if empty[part.start] else "others"
        where = f"{path.name}, {stamps[part.start] - stamps[0]:.1f} s ({kind})"
        bodies.append(Body((part.stop - part.start) * period, float(result.lost[part].mean()), where, kind))
    return Observed(path.name, float(empty.sum()) * period, tuple(bodies))


def row(observed: Observed) -> str:
    """A line of the table."""
    false = [body for body in observed.bodies if body.kind == "empty"]
    minute = f"{60.0 * len(false) / observed.empty:.1f}" if observed.empty else ""
    seconds = sum(body.seconds for body in false)
    lost_fraction = f"{100.0 * sum(body.seconds * body.lost for body in false) / seconds:.0f} %" if false else ""
    longest = f"{max(body.seconds for body in false):.1f}" if false else ""
    left, others = (sum(body.kind == kind for body in observed.bodies) for kind in ("left", "others"))
    cells = [
        observed.name,
        f"{observed.empty:.0f}",
        f"{len(false)}",
        minute,
        longest,
        lost_fraction,
        f"{left}",
        f"{others}",
    ]
    return "| " + " | ".join(cells) + " |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recordings", nargs="*", type=Path, help="folders with a bag and truth_people.csv")
    parser.add_argument("--rooms", type=int, default=48, help="rooms that are made (default 48)")
    parser.add_argument("--first", type=int, default=0, help="seed of the first of them (default 0)")
    parser.add_argument("--seconds", type=float, default=5.0, help="how long each stands still (default 5)")
    options = parser.parse_args()
    if options.rooms < 0 or options.seconds <= 0.0:
        parser.error(
            f"--rooms, --seconds: expected at least 0 and more than 0, found {options.rooms} and {options.seconds:g}"
        )
    print("| where | empty, s | false bodies | a minute | longest, s | called lost | left behind | people in view |")
    print("|---|---|---|---|---|---|---|---|")
    all_of_them: list[Observed] = []
    seeds = range(options.first, options.first + options.rooms)
    for place, sensor in enumerate(rooms.SENSORS):
        mine = [seed for seed in seeds if seed % len(rooms.SENSORS) == place]
        bodies = [
            body
            for seed in mine
            for body in in_room(rooms.room(seed), options.seconds, floor_known=seed // len(rooms.SENSORS) % 2 == 0)
        ]
        if mine:
            all_of_them.append(
                Observed(f"{len(mine)} rooms, {sensor.name}", len(mine) * options.seconds, tuple(bodies))
            )
            print(row(all_of_them[-1]), flush=True)
    for watch in [lambda: in_synthetic(options.seconds)] * (options.rooms > 0) + [
        lambda path=path: in_recording(path) for path in options.recordings
    ]:
        all_of_them.append(watch())
        print(row(all_of_them[-1]), flush=True)
    total = tuple(body for observed in all_of_them for body in observed.bodies)
    print(row(Observed("together", sum(observed.empty for observed in all_of_them), total)) + "\n")
    for body in total:
        print(f"{body.where}: {body.seconds:.1f} s, {100.0 * body.lost:.0f} % of it called lost")


if __name__ == "__main__":
    main()
