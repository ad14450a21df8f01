"""Measure figures again: `python -m lab.figures.measure [ID ...] [--data D] [--jobs 2]`.

Runs the command of every named run of runs.json (all that are known here by default), with this build, and writes the values
that its output shows, the commit and the date. Runs that share a command share its output. What takes a quiet machine (times),
training or a look (pictures of rooms and of people) is not here.
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
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from lab.figures.pages import HERE, ROOT

Values = Mapping[str, float]
KINECT_DEVELOPMENT = "voodoo eval D/utd-mhad --only 'a[3467]_s[1-4]_t[1-3]_*' --only 'a13_s[1-4]_t[1-3]_*'"
KINECT_DEVELOPMENT += " --only 'a2[23467]_s[1-4]_t[1-3]_*'"
KINECT_OTHERS = "voodoo eval D/utd-mhad --only 'a[12589]_*' --only 'a1[0-24-9]_*' --only 'a2[015]_*'"
MISSING = "python lab/experiments/missing_frames.py D/rendered/dev_* --every 24"
ANYBODY = {"child": "ab_d1", "wheelchair": "ab_d2", "desk": "ab_d3", "skirt": "ab_d4", "heavy": "ab_d5"}


@dataclass(frozen=True)
class Output:
    """What a command printed, and the folder of its `--out` if it has one."""

    text: str
    folder: Path

    def cell(self, label: str, at: int = 0) -> float:
        """The number in a cell of the first table row that begins with `label`, from 0 after the label.

        Raises:
            ValueError: there is no such row, or no number in it.
        """
        for line in self.text.splitlines():
            cells = [cell.strip() for cell in line.strip().strip("|").split("|")]
            if cells[0].startswith(label) and len(cells) > at + 1:
                return number(cells[at + 1])
        raise ValueError(f"expected a row {label!r}, found none in:\n{self.text}")

    def found(self, pattern: str) -> list[float]:
        """The numbers of the first match of a pattern's groups.

        Raises:
            ValueError: nothing matches.
        """
        match = re.search(pattern, self.text)
        if match is None:
            raise ValueError(f"expected {pattern!r}, found nothing like it in:\n{self.text}")
        return [number(group) for group in match.groups()]

    def summary(self) -> dict[str, str]:
        """The first row of summary.csv."""
        with (self.folder / "summary.csv").open(encoding="utf-8") as file:
            return next(iter(csv.DictReader(file)))


def number(text: str) -> float:
    """The first number of a text, as an integer where it is one."""
    found = re.search(r"-?\d+(?:\.\d+)?", text)
    if found is None:
        raise ValueError(f"expected a number, found {text!r}")
    return float(found[0]) if "." in found[0] else int(found[0])


def evaluated(output: Output) -> dict[str, float]:
    """All that the runs show of `voodoo eval`."""
    row = output.summary()
    of = {name: float(value) for name, value in row.items() if name != "kind" and value}
    return {
        "mean_cm": round(100 * of["error_m"], 1), "within_10cm": round(100 * of["within_10cm"], 1),
        "lost": round(of["class_0"]), "sequences": round(of["sequences"]), "recordings": round(of["sequences"]),
        "tracking_class": round(of["class_average"], 2), "first_cm": round(100 * of.get("first_pose_error_m", 0.0), 1),
        "recall": round(100 * of["lost_recall_together"]), "false_alarm": round(100 * of["false_alarm_rate_together"], 1),
        "offsets_cm": round(100 * of.get("error_without_offsets_m", 0.0), 1),
        "offsets_class": round(of.get("class_without_offsets", 0.0), 2),
        "offsets_lost": round(of.get("lost_without_offsets", 0.0) * of["sequences"]),
        "left_out": round(100 * of.get("left_out_share", 0.0), 1),
    }  # fmt: skip


def disturbed(output: Output) -> dict[str, float]:
    """Runs of disturbed starts."""
    mean, lost, runs = output.found(r"mean ([\d.]+) cm; (\d+) of (\d+) runs")
    [recall] = output.found(r"limbs off by 10 cm: ([\d.]+) %")
    [false_alarm] = output.found(r"limbs nearer: ([\d.]+) %")
    return {"mean_cm": mean, "lost": lost, "runs": runs, "recall": recall, "false_alarm": false_alarm}


def anybody(output: Output) -> dict[str, float]:
    """Every recording, and all together."""
    values: dict[str, float] = {}
    for name, label in ANYBODY.items():
        line = next(line for line in output.text.splitlines() if line.startswith(f"| {label}"))
        cells = [cell.strip() for cell in line.strip().strip("|").split("|")]
        lost = 0 if cells[5] == "none" else len(cells[5].split(","))
        values |= {f"{name}_frame": number(cells[1]), f"{name}_first_cm": number(cells[2])}
        values |= {f"{name}_mean_cm": number(cells[3]), f"{name}_lost": lost}
    return values | {"mean_cm": output.cell("all", 4), "ends_lost": output.cell("all", 6)}


def wrong_starts(output: Output) -> dict[str, float]:
    """All starts together."""
    return {"right": output.cell("all", 2), "never": output.cell("all", 3), "cases": output.cell("all", 4)}


def made_up(output: Output) -> dict[str, float]:
    """Switches of all scenes but those of four, and of these."""
    of = {kind: output.found(rf"{kind}: (\d+) switches")[0] for kind in ("returning", "crossing", "passing", "four")}
    return {"switches": sum(of.values()) - of["four"], "switches_of_four": of["four"]}


def passed_by(output: Output) -> dict[str, float]:
    """Speeds at which a joint was far off, and the frames of the only one if there is one."""
    rows = [line.strip().strip("|").split("|") for line in output.text.splitlines() if line.startswith("| dev_")]
    bad = [row for row in rows if number(row[4]) > 0]
    values: dict[str, float] = {"speeds": len(rows), "bad": len(bad)}
    if len(bad) == 1:
        values |= {"bad_at": number(bad[0][1]), "far": number(bad[0][4]), "tracking": number(bad[0][3])}
    return values


def changed(kind: str) -> Callable[[Output], dict[str, float]]:
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
        line = next(line for line in output.text.splitlines() if line.startswith(f"| all | {kind}"))
        cells = [cell.strip() for cell in line.strip().strip("|").split("|")]
        values |= {f"{kind}_by_frame_3": number(cells[2]), f"{kind}_lost_percent": number(cells[3])}
        values |= {f"{kind}_cm": number(cells[4]), f"{kind}_whole_cm": number(cells[5])}
    return values


def people(output: Output) -> dict[str, float]:
    """All recordings of several persons."""
    table = [line.strip().strip("|").split("|") for line in output.text.splitlines() if line.startswith("|")]
    cell = {name.strip(): table[-1][at] for at, name in enumerate(table[0])}
    names = {"mota": "MOTA", "idf1": "IDF1", "switches": "id switches", "mean_cm": "joint error, cm"}
    return {value: number(cell[name]) for value, name in names.items()}


RUNS: dict[str, tuple[str, Callable[[Output], Values]]] = {
    "rendered": ("voodoo eval D/rendered --depth-only", evaluated),
    "rendered-auto": ("voodoo eval D/rendered --depth-only --init auto", evaluated),
    "disturbed": ("python lab/experiments/disturbed_starts.py D/rendered/dev_* --starts 8", disturbed),
    "backwards": ("python lab/experiments/disturbed_starts.py D/rendered/dev_* --starts 5 --backwards", disturbed),
    "every-second": ("python lab/experiments/disturbed_starts.py D/rendered/dev_* --starts 8 --every 2", disturbed),
    "kinect": (KINECT_DEVELOPMENT, evaluated),
    "kinect-auto": (f"{KINECT_DEVELOPMENT} --init auto", evaluated),
    "kinect-others": (KINECT_OTHERS, evaluated),
    "kinect-others-status": (KINECT_OTHERS, evaluated),
    "sitting": ("voodoo eval D/utd-mhad --only 'a24_*' --only 'a25_*'", evaluated),
    "anybody": ("python lab/experiments/unseen_people.py D/anybody/ab_*", anybody),
    "anybody-given": ("python lab/experiments/unseen_people.py --init given D/anybody/ab_*", anybody),
    "wrong-start-rendered": ("python lab/experiments/wrong_start.py D/rendered/dev_*", wrong_starts),
    "wrong-start-kinect": ("python lab/experiments/wrong_start.py D/utd-mhad --every 40", wrong_starts),
    "people": ("voodoo eval D/people", people),
    "made-up-people": (
        "python lab/experiments/made_up_people.py --returning 10 --crossing 6 --passing 6 --four 8", made_up
    ),
    "passer-by": (
        "python lab/experiments/passer_by.py D/rendered/dev_06*"
        " --speed 0.3 0.4 0.5 0.6 0.7 0.75 0.8 0.85 0.9 1.0 1.1 1.2 1.3 1.4", passed_by
    ),
    "missing": (MISSING, changed("missing")),
    "missing-noise": (MISSING, changed("noise")),
    "missing-pixel": (MISSING, changed("pixel")),
    "cut-pictures": ("python lab/experiments/cut_pictures.py D/rendered/dev_*", cut),
    "empty-rooms": (
        "python lab/experiments/false_bodies.py --rooms 48 --seconds 5",
        lambda output: {"false_bodies": output.cell("together", 1)},
    ),
}  # fmt: skip


def measured(command: str, data: Path) -> Output:
    """Run a command, in which `D` is the folder of the data.

    Raises:
        ValueError: it fails.
    """
    words = [word.replace("D/", f"{data}/", 1) if word.startswith("D/") else word for word in shlex.split(command)]
    words = [path for word in words for path in (expanded(word) if word.startswith(str(data)) else [word])]
    folder = Path(tempfile.mkdtemp(prefix="figures-"))
    words = [sys.executable, *(["-m", *words, "--out", str(folder)] if words[0] == "voodoo" else words[1:])]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True)
    if done.returncode:
        raise ValueError(f"{command}: expected to end with 0, found {done.returncode}:\n{done.stderr[-2000:]}")
    return Output(done.stdout, folder)


def expanded(pattern: str) -> list[str]:
    """The paths of a pattern, in order; what is no pattern is itself."""
    path = Path(pattern)
    return sorted(str(found) for found in path.parent.glob(path.name)) if "*" in path.name else [pattern]


def main() -> int:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("runs", nargs="*", metavar="ID", help=f"of {', '.join(RUNS)}")
    default = Path(os.environ.get("VOODOO_DATA", ROOT.parent / "shared" / "data"))
    parser.add_argument("--data", type=Path, default=default, help="folder of the measurement data")
    parser.add_argument("--jobs", type=int, default=1, help="commands at the same time")
    options = parser.parse_args()
    if unknown := set(options.runs) - set(RUNS):
        parser.error(f"expected runs of {sorted(RUNS)}, found {sorted(unknown)}")
    chosen = {name: RUNS[name] for name in options.runs or RUNS}
    commands = list(dict.fromkeys(command for command, _ in chosen.values()))
    with ThreadPoolExecutor(options.jobs) as pool:
        outputs = dict(
            zip(commands, pool.map(measured, commands, [options.data.resolve()] * len(commands)), strict=True)
        )
    path = HERE / "runs.json"
    content = json.loads(path.read_text(encoding="utf-8"))
    git = ["git", "show", "-s", "--format=%h %as", "--abbrev=8", "HEAD"]
    commit, date = subprocess.run(git, cwd=ROOT, capture_output=True, text=True, check=True).stdout.split()
    for run in content["runs"]:
        if run["id"] not in chosen:
            continue
        command, read = chosen[run["id"]]
        found = {name: value for name, value in read(outputs[command]).items() if name in run["values"]}
        for name, value in found.items():
            print(f"{run['id']}.{name}: {run['values'][name]} -> {value}")
        run["values"] |= found
        run |= {"command": command, "commit": commit, "date": date}
    path.write_text(json.dumps(content, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
