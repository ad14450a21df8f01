"""Several made-up people: who comes back has the same id, who crosses keeps it, and how long a frame takes.

    python lab/experiments/made_up_people.py --returning 10 --crossing 6 --passing 6 --four 8 --starts 3

Recordings are rendered from our own bodies, one seed each: people of other statures, girths and clothes in a furnished room,
320x240, with noise, flying and lost pixels. In `returning` somebody is out of view for five seconds, and in every other of them
somebody else comes meanwhile. In `passing` somebody walks by 0.8 m in front of somebody who stands. With `--starts 3` each is
made again with everybody 2 cm farther away, and 2 cm aside. Depth alone, on one thread.
"""

import argparse
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import voodoo
from voodoo.evaluation.people import PeopleScore, together
from voodoo.evaluation.people_evaluate import judge, people_markdown

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests"))

from synthetic import stories
from synthetic.people import MadeUpRecording

KINDS: dict[str, tuple[Callable[[int], MadeUpRecording], int]] = {
    "returning": (stories.returning, 10),
    "crossing": (stories.crossing, 4),
    "passing": (stories.passing, 2),
    "four": (stories.four, 2),
}
"""How each is made, and how many by default."""
STARTS = ((0.0, 0.0), (0.02, 0.0), (0.0, 0.02))
"""How far everybody is moved [m]."""


def moved(recording: MadeUpRecording, x: float, y: float) -> MadeUpRecording:
    """The recording with everybody moved by x and y [m]."""
    scene = recording.scene
    stops = [[replace(stop, x=stop.x + x, y=stop.y + y) for stop in one.stops] for one in scene.people]
    people = tuple(replace(one, stops=places) for one, places in zip(scene.people, stops, strict=True))
    return MadeUpRecording(replace(scene, people=people))


def judged(recording: MadeUpRecording) -> PeopleScore:
    """Follow everybody on one thread."""
    return judge(recording, voodoo.People(config=voodoo.Config(threads=1)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for kind, (_, count) in KINDS.items():
        parser.add_argument(f"--{kind}", type=int, default=count, help=f"how many (default {count})")
    parser.add_argument("--starts", type=int, default=1, choices=(1, 2, 3), help="recordings of each (default 1)")
    parser.add_argument("--first", type=int, default=0, help="seed of the first of each (default 0)")
    options = vars(parser.parse_args())
    everything: list[PeopleScore] = []
    for kind, (make, _) in KINDS.items():
        seeds = range(options["first"], options["first"] + options[kind])
        scores = [judged(moved(make(seed), *by)) for seed in seeds for by in STARTS[: options["starts"]]]
        if not scores:
            continue
        everything += scores
        print(people_markdown(scores), flush=True)
        both = together(scores)
        back = f", {both.returned} of {both.returns} came back with the same id" if both.returns else ""
        print(f"{kind}: {both.switches} switches of identity{back}, {1e3 * both.step_s:.1f} ms a frame\n", flush=True)
    if not everything:
        parser.error("expected at least one recording")


if __name__ == "__main__":
    main()
