"""Measure figures again: `python -m lab.figures.measure [ID ...] --machine NAME [--data D] [--jobs 2]`.

Runs the commands of runs of runs.json (by default of all whose output is read here) with this build, and writes the values, the
machine (a key of `machines` in runs.json), the commit and the date. Nothing that git tracks may have changes, but for runs.json.
Runs that share a command share its output. What takes a quiet machine (times) or training is not here.
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import re
import shlex
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

from lab.figures.pages import HERE, ROOT

COVERED_CM = 7
"""Below this error a person was found again."""
ANYBODY = {"child": "ab_d1", "wheelchair": "ab_d2", "desk": "ab_d3", "skirt": "ab_d4", "heavy": "ab_d5"}


SHOWN: dict[str, tuple[str, int, int | None]] = {
    "mean_cm": ("error_m", 100, 1), "within_10cm": ("within_10cm", 100, 1), "lost": ("class_0", 1, None),
    "sequences": ("sequences", 1, None), "recordings": ("sequences", 1, None), "tracking_class": ("class_average", 1, 2),
    "first_cm": ("first_pose_error_m", 100, 1), "recall": ("lost_recall_together", 100, None),
    "false_alarm": ("false_alarm_rate_together", 100, 1), "offsets_cm": ("error_without_offsets_m", 100, 1),
    "offsets_class": ("class_without_offsets", 1, 2), "left_out": ("left_out_share", 100, 1),
}  # fmt: skip
"""Values of a summary.csv: its column, a factor, and digits (None: an integer)."""


@dataclass(frozen=True)
class Output:
    """What a command printed, the first row of the summary.csv that it wrote, and all of its people.csv, if it did."""

    text: str
    summary: Mapping[str, str] = field(default_factory=dict)
    people: Sequence[Mapping[str, str]] = ()

    @property
    def rows(self) -> list[list[str]]:
        """The cells of all rows of tables."""
        lines = (line.strip() for line in self.text.splitlines())
        return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines if line.startswith("|")]

    def row(self, *begin: str) -> list[str]:
        """The first row whose first cells begin with these texts.

        Raises:
            ValueError: there is none.
        """
        for row in self.rows:
            if all(cell.startswith(text) for cell, text in zip(row, begin, strict=False)):
                return row
        raise ValueError(f"expected a row {begin}, found none in:\n{self.text}")

    def found(self, pattern: str) -> list[float]:
        """The numbers of the first match of a pattern's groups.

        Raises:
            ValueError: nothing matches.
        """
        match = re.search(pattern, self.text)
        if match is None:
            raise ValueError(f"expected {pattern!r}, found nothing like it in:\n{self.text}")
        return [number(group) for group in match.groups()]


Read = Callable[[Output], dict[str, float]]


def number(text: str) -> float:
    """The first number of a text, as an integer where it is one."""
    found = re.search(r"-?\d+(?:\.\d+)?", text)
    if found is None:
        raise ValueError(f"expected a number, found {text!r}")
    return float(found[0]) if "." in found[0] else int(found[0])


def evaluated(output: Output) -> dict[str, float]:
    """All that the runs show of `voodoo eval`, without what is not known."""
    of = {name: float(value) for name, value in output.summary.items() if name != "kind" and value}
    found = {name: round(by * of[column], digits) for name, (column, by, digits) in SHOWN.items() if column in of}
    if "lost_without_offsets" in of:
        found["offsets_lost"] = round(of["lost_without_offsets"] * of["sequences"])
    return found


def disturbed(output: Output) -> dict[str, float]:
    """Runs of disturbed starts."""
    mean, lost, runs = output.found(r"mean ([\d.]+) cm; (\d+) of (\d+) runs")
    [recall] = output.found(r"limbs off by 10 cm: ([\d.]+) %")
    [false_alarm] = output.found(r"limbs nearer: ([\d.]+) %")
    return {"mean_cm": mean, "lost": lost, "runs": runs, "recall": recall, "false_alarm": false_alarm}


def anybody(output: Output) -> dict[str, float]:
    """Every recording, and all together."""
    values: dict[str, float] = {}
    for name, recording in ANYBODY.items():
        _, frame, first, mean, _, lost, *_ = output.row(recording)
        values |= {f"{name}_frame": number(frame), f"{name}_first_cm": number(first), f"{name}_mean_cm": number(mean)}
        values[f"{name}_lost"] = 0 if lost == "none" else len(lost.split(","))
    *_, mean, _, lost, _ = output.row("all")
    return values | {"mean_cm": number(mean), "ends_lost": number(lost)}


def wrong_starts(output: Output) -> dict[str, float]:
    """All starts together."""
    right, never, cases = output.row("all")[3:6]
    return {"right": number(right), "never": number(never), "cases": number(cases)}


def made_up(output: Output) -> dict[str, float]:
    """Switches of all scenes."""
    kinds = ("returning", "crossing", "passing", "four")
    return {"switches": sum(output.found(rf"{kind}: (\d+) switches")[0] for kind in kinds)}


def passed_by(output: Output) -> dict[str, float]:
    """Speeds at which the person was far off, and the frames of the worst."""
    rows = [[number(cell) for cell in row[1:5]] for row in output.rows if row[0].startswith("dev_")]
    speed, _, tracking, far = max(rows, key=lambda row: row[3])
    bad = sum(row[3] > 0 for row in rows)
    return {"speeds": len(rows), "bad": bad, "bad_at": speed, "tracking": tracking, "far": far}


def changed(kind: str) -> Read:
    """How far joints move when one frame is missing, or has other depths."""

    def values(output: Output) -> dict[str, float]:
        names = ("mean_mm", "p99_mm", "most_mm", "within_5mm", "poses", "truth_mm")
        pattern = rf"{kind}: mean (.+?) mm, 99 % (.+?) mm, greatest (.+?) mm, within 5 mm (.+?)%,"
        pattern += " poses in the mean (.+?)%; from the truth (.+?) mm"
        return dict(zip(names, output.found(pattern), strict=True))

    return values


def cut(output: Output) -> dict[str, float]:
    """Images that end below the hips, below the knees, at one side."""
    values: dict[str, float] = {}
    for kind in ("hips", "knees", "side"):
        names = ("by_frame_3", "lost_percent", "cm", "whole_cm")
        cells = output.row("all", kind)[2:]
        values |= {f"{kind}_{name}": number(cell) for name, cell in zip(names, cells, strict=True)}
    return values


def people(output: Output) -> dict[str, float]:
    """All recordings of several persons."""
    heads, *_, last = output.rows
    names = {"mota": "MOTA", "idf1": "IDF1", "switches": "id switches", "mean_cm": "joint error, cm"}
    false_bodies = sum(int(row["false_bodies"]) for row in output.people)
    return {value: number(last[heads.index(name)]) for value, name in names.items()} | {"false_bodies": false_bodies}


def empty_rooms(output: Output) -> dict[str, float]:
    """All rooms together."""
    return {"seconds": number(output.row("together")[1]), "false_bodies": number(output.row("together")[2])}


def covered(output: Output) -> dict[str, float]:
    """Cases whose error is small half a second later, with and without relocalization."""
    cases = [[number(cell) for cell in row[3:5]] for row in output.rows if row[0].startswith("dev_")]
    back, no_search = (sum(case[kind] < COVERED_CM for case in cases) for kind in (0, 1))
    return {"cases": len(cases), "back": back, "limit_cm": COVERED_CM, "no_search": no_search}


def reliability(output: Output) -> dict[str, float]:
    """Percent of limb ends within 10 cm, by the probability that was reported."""
    ranges = {"below_50": "0.0 to 0.5", "from_50": "0.5 to 0.8", "from_80": "0.8 to 0.95", "from_95": "0.95 to 1.0"}
    return {name: number(output.row(cell)[3]) for name, cell in ranges.items()}


def stress(output: Output) -> dict[str, float]:
    """The default strength of the jitter penalty, and none."""
    [_, lost, mean, *_] = output.row("0.25")
    [of, joints] = lost.split(" of ")
    values = {"mean_mm": number(mean.split(" / ")[0]), "lost": number(of), "joints": number(joints)}
    return values | {"no_prior_mm": number(output.row("100 ")[2].split(" / ")[0])}


def real(output: Output) -> dict[str, float]:
    """Persons found in images of one, of five, and of head and shoulders; false bodies in those of none."""
    persons = {row[0]: number(row[1]) for row in output.rows[2:]}
    single = [found for name, found in persons.items() if name.startswith(("uc_alberto", "uc_juggling"))]
    rooms = [number(row[2]) for row in output.rows if row[0].startswith(("neg_", "uc_empty"))]
    group, near = persons["pcl_five"], persons["pcl_person"]
    return {
        "images": len(single), "found": sum(found == 1 for found in single), "group": 5, "group_found": group,
        "near": 1, "near_found": near, "rooms": len(rooms), "false_bodies": sum(rooms),
    }  # fmt: skip


def first_poses(output: Output) -> dict[str, float]:
    """The best and the worst recording.

    Raises:
        ValueError: one of them has no first pose, or there is none.
    """
    errors = re.findall(r"([\d.]+) cm off$", output.text, re.MULTILINE)
    if not errors or len(errors) != len(output.text.splitlines()):
        raise ValueError(f"expected a first pose in every line, found:\n{output.text}")
    return {"least_cm": min(map(float, errors)), "most_cm": max(map(float, errors))}


READ: dict[str, Read] = {
    **dict.fromkeys(("rendered", "rendered-auto", "kinect", "kinect-auto", "kinect-others"), evaluated),
    **dict.fromkeys(("kinect-others-status", "rendered-status", "sitting"), evaluated),
    **dict.fromkeys(("disturbed", "backwards", "every-second"), disturbed),
    **dict.fromkeys(("anybody", "anybody-given"), anybody),
    **dict.fromkeys(("wrong-start-rendered", "wrong-start-kinect"), wrong_starts),
    **{"missing": changed("missing"), "missing-noise": changed("noise"), "missing-pixel": changed("pixel")},
    **dict.fromkeys(("probability-rendered", "probability-kinect"), reliability),
    **{"people": people, "made-up-people": made_up, "passer-by": passed_by, "cut-pictures": cut},
    **{"empty-rooms": empty_rooms, "covered": covered, "stress": stress, "real-people": real, "real-rooms": real},
    "start-keypoints-depth": first_poses,
}
"""How the values of a run of runs.json are read from what its command prints."""


def measured(command: str, data: Path) -> Output:
    """Run a command, in which `D` is the folder of the data.

    Raises:
        ValueError: it fails.
    """
    words = [word.replace("D/", f"{data}/", 1) if word.startswith("D/") else word for word in shlex.split(command)]
    words = [path for word in words for path in (expanded(word) if word.startswith(str(data)) else [word])]
    with tempfile.TemporaryDirectory() as folder:
        words = [sys.executable, *(["-m", *words, "--out", folder] if words[0] == "voodoo" else words[1:])]
        done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True)
        if done.returncode:
            raise ValueError(f"{command}: expected to end with 0, found {done.returncode}:\n{done.stderr[-2000:]}")
        summary, people = (rows_of(Path(folder, name)) for name in ("summary.csv", "people.csv"))
        return Output(done.stdout, summary[0] if summary else {}, people)


def rows_of(path: Path) -> list[dict[str, str]]:
    """The rows of a table, none where there is no file."""
    return list(csv.DictReader(path.read_text(encoding="utf-8").splitlines())) if path.exists() else []


def state(root: Path) -> tuple[str, str]:
    """Commit and date of a checkout.

    Raises:
        SystemExit: files that git tracks have changes, other than runs.json.
    """

    def git(*words: str) -> str:
        return subprocess.run(["git", *words], cwd=root, capture_output=True, text=True, check=True).stdout

    if changes := git("status", "--porcelain", "--untracked-files=no", "--", ".", ":!lab/figures/runs.json"):
        raise SystemExit(f"expected a tree without changes, found:\n{changes}")
    commit, date = git("show", "-s", "--format=%h %as", "--abbrev=8", "HEAD").split()
    return commit, date


def expanded(pattern: str) -> list[str]:
    """The paths of a pattern, in order; what is no pattern is itself."""
    path = Path(pattern)
    return sorted(str(found) for found in path.parent.glob(path.name)) if "*" in path.name else [pattern]


def main() -> int:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("runs", nargs="*", metavar="ID", help=f"of {', '.join(READ)}")
    default = Path(os.environ.get("VOODOO_DATA", ROOT.parent / "shared" / "data"))
    parser.add_argument("--machine", required=True, metavar="NAME", help="of `machines` in runs.json")
    parser.add_argument("--data", type=Path, default=default, help="folder of the measurement data")
    parser.add_argument("--jobs", type=int, default=1, help="commands at the same time")
    options = parser.parse_args()
    if unknown := set(options.runs) - set(READ):
        parser.error(f"expected runs of {sorted(READ)}, found {sorted(unknown)}")
    path = HERE / "runs.json"
    content = json.loads(path.read_text(encoding="utf-8"))
    if options.machine not in content["machines"]:
        parser.error(f"--machine: expected one of {sorted(content['machines'])}, found {options.machine!r}")
    commit, date = state(ROOT)
    chosen = [run for run in content["runs"] if run["id"] in (options.runs or READ)]
    commands = list(dict.fromkeys(run["command"] for run in chosen))
    with ThreadPoolExecutor(options.jobs) as pool:
        printed = list(pool.map(measured, commands, [options.data.resolve()] * len(commands)))
    outputs = dict(zip(commands, printed, strict=True))
    read = {run["id"]: READ[run["id"]](outputs[run["command"]]) for run in chosen}
    content = json.loads(path.read_text(encoding="utf-8"))  # it may have been edited meanwhile
    for run in (run for run in content["runs"] if run["id"] in read):
        found = read[run["id"]]
        for name, value in run["values"].items():
            print(f"{run['id']}.{name}: {value} -> {found.get(name, 'not in the output: check it')}")
            run["values"][name] = found.get(name, value)
        run |= {"commit": commit, "date": date, "machine": options.machine}
    path.write_text(json.dumps(content, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
