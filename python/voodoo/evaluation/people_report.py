"""Writes the evaluation of several persons as Markdown and .csv."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import fields
from pathlib import Path

from voodoo.evaluation.people import ABSENT_S, IN_VIEW, JOINTS_IN_VIEW, MATCH_M, PeopleScore, together
from voodoo.evaluation.score import RATIO, written
from voodoo.evaluation.tables import write_table
from voodoo.whole import write_whole

DERIVED = ("mota", "idf1", "false_a_minute")


def people_markdown(scores: Sequence[PeopleScore]) -> str:
    """A table with a row per recording, and one for all together."""
    lines = [
        "## Several people, against exact truth\n",
        _row([name for name, _ in _COLUMNS]),
        "|" + "---|" * len(_COLUMNS),
    ]
    lines += [_line(score) for score in scores]
    if len([score for score in scores if not score.failure]) > 1:
        lines.append(_line(together(scores)))
    lines.append(
        f"\nA match is a root within {MATCH_M:g} m of a person with {IN_VIEW:g} or more of their pixels in view; who is less in "
        f"view may be followed or not. MOTA, IDF1 and switches are those of py-motmetrics. First pose: from "
        f"{JOINTS_IN_VIEW:g} in view on. Return: after more than {ABSENT_S:g} s out of view. A false body is a stretch of an id "
        "that matches nobody; one that follows on a match of this id is left behind. Joints count from "
        f"{JOINTS_IN_VIEW:g} in view on.\n"
    )
    return "\n".join(lines)


def write_people(folder: Path, scores: Sequence[PeopleScore]) -> list[Path]:
    """Write people.csv (a row per recording) and people.md; returns both paths.

    Raises:
        OSError: a file cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    table, text = folder / "people.csv", folder / "people.md"
    names = [*(item.name for item in fields(PeopleScore)), *DERIVED]
    write_table(table, names, ([getattr(score, name) for name in names] for score in scores))
    write_whole(text, people_markdown(scores))
    return [table, text]


def _line(score: PeopleScore) -> str:
    if score.failure:
        return _row((score.name, score.failure.replace("|", "/"), *[""] * (len(_COLUMNS) - 2)))
    return _row([cell(score) for _, cell in _COLUMNS])


def _row(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cells) + " |"


def _first_pose(score: PeopleScore) -> str:
    wait = written(score.first_pose_s, RATIO)
    return wait if wait == "-" else f"{wait} ({written(score.worst_first_pose_s, RATIO)})"


_COLUMNS: tuple[tuple[str, Callable[[PeopleScore], str]], ...] = (
    ("recording", lambda score: score.name),
    ("persons", lambda score: f"{score.persons}"),
    ("ids", lambda score: f"{score.ids}"),
    ("MOTA", lambda score: written(score.mota, (1.0, ".3f", ""))),
    ("IDF1", lambda score: written(score.idf1, (1.0, ".3f", ""))),
    ("id switches", lambda score: f"{score.switches}"),
    ("same id after return", lambda score: f"{score.returned} of {score.returns}" if score.returns else "-"),
    ("first pose after, s (worst)", _first_pose),
    ("never found", lambda score: f"{score.visits - score.visits_matched} of {score.visits}"),
    ("false bodies a minute", lambda score: written(score.false_a_minute, (1.0, ".1f", ""))),
    ("left behind", lambda score: f"{score.left_behind}"),
    ("joint error, cm", lambda score: written(score.joint_error_m, (100.0, ".1f", ""))),
    ("ms a frame", lambda score: written(score.step_s, (1000.0, ".1f", ""))),
)
"""Name and cell of each column."""
