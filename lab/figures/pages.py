"""Blocks of the pages, filled with the values of the runs.

A page marks a block by two lines, `<!-- figures: NAME -->` and `<!-- /figures -->`. What stands between them is
blocks/NAME.md, in which `{run.value}` is a value of a run in runs.json; a format may follow as in Python, `{run.value:.2f}`.
The block `runs` lists all runs.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
PAGES = tuple(
    ROOT / name
    for name in (
        "README.md",
        "python/README.md",
        "docs/index.md",
        "docs/figures.md",
        "docs/explanation/tried-on.md",
        "lab/training/CARD.md",
        "lab/figures/README.md",
    )
)
"""The pages that show figures."""
BLOCK = re.compile(r"^<!-- figures: ([\w-]+) -->\n(.*?)^<!-- /figures -->$", re.MULTILINE | re.DOTALL)
VALUE = re.compile(r"\{([a-z0-9-]+)\.(\w+)(:[^}]*)?\}")


@dataclass(frozen=True)
class Run:
    """One measurement.

    Args:
        id: name by which blocks refer to it.
        command: what makes it; `D` is the folder of the data.
        commit: the commit that recorded it.
        date: of that commit.
        machine: key of `machines`.
        threads: threads of the tracker.
        input: data or setting.
        values: name -> number; the name ends with the unit if there is one.
    """

    id: str
    command: str
    commit: str
    date: str
    machine: str
    threads: int
    input: str
    values: Mapping[str, float]


def load(path: Path = HERE / "runs.json") -> tuple[dict[str, str], dict[str, Run]]:
    """Machines and runs by name.

    Raises:
        ValueError: two runs of one name, or a machine that is not described.
    """
    content = json.loads(path.read_text(encoding="utf-8"))
    machines, runs = content["machines"], [Run(**run) for run in content["runs"]]
    found = {run.id: run for run in runs}
    if len(found) != len(runs):
        raise ValueError(f"{path}: expected every id once, found {sorted(run.id for run in runs)}")
    for run in runs:
        if run.machine not in machines:
            raise ValueError(f"{path}: {run.id}: expected one of {sorted(machines)}, found {run.machine!r}")
    return machines, found


def rendered(name: str, machines: Mapping[str, str], runs: Mapping[str, Run]) -> str:
    """A block with its numbers.

    Raises:
        KeyError: a run or value that is not there.
    """
    if name == "runs":
        return _listed(machines, runs)

    def value(found: re.Match[str]) -> str:
        number = runs[found[1]].values[found[2]]
        return format(number, (found[3] or ":").removeprefix(":"))

    return VALUE.sub(value, (HERE / "blocks" / f"{name}.md").read_text(encoding="utf-8"))


def updated(page: str, machines: Mapping[str, str], runs: Mapping[str, Run]) -> str:
    """The text of a page with its blocks made anew."""

    def block(found: re.Match[str]) -> str:
        return f"<!-- figures: {found[1]} -->\n{rendered(found[1], machines, runs)}<!-- /figures -->"

    return BLOCK.sub(block, page)


def _listed(machines: Mapping[str, str], runs: Mapping[str, Run]) -> str:
    """Machines, and what made each figure."""
    lines = ["| machine | description |", "|---|---|"]
    lines += [f"| {name} | {text} |" for name, text in machines.items()]
    lines += ["", "| run | command | input | machine | commit |", "|---|---|---|---|---|"]
    lines += [
        f"| {run.id} | `{run.command}` | {run.input} | {run.machine} | {run.commit}, {run.date} |"
        for run in runs.values()
    ]
    return "\n".join(lines) + "\n"
