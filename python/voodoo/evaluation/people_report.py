"""Writes the evaluation of several persons as Markdown and .csv."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path

from voodoo.evaluation.people import ABSENT_S, IN_VIEW, JOINTS_IN_VIEW, MATCH_M, PeopleScore, together
from voodoo.evaluation.tables import write_table
from voodoo.whole import appearing_whole

_HEADER = (
    "recording",
    "persons",
    "ids",
    "MOTA",
    "IDF1",
    "id switches",
    "same id after return",
    "first pose after, s (worst)",
    "never found",
    "false bodies a minute",
    "left behind",
    "joint error, cm",
    "ms a frame",
)
DERIVED = ("mota", "idf1", "false_a_minute")


def people_markdown(scores: Sequence[PeopleScore]) -> str:
    """A table with a row per recording, and one for all together."""
    lines = ["## Several people, against exact truth\n", _row(_HEADER), "|" + "---|" * len(_HEADER)]
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
    with appearing_whole(text) as part:
        part.write_text(people_markdown(scores), encoding="utf-8")
    return [table, text]


def _line(score: PeopleScore) -> str:
    if score.failure:
        return _row((score.name, score.failure.replace("|", "/"), *[""] * (len(_HEADER) - 2)))
    wait = _word(score.first_pose_s, 2)
    return _row(
        (
            score.name,
            f"{score.persons}",
            f"{score.ids}",
            _word(score.mota, 3),
            _word(score.idf1, 3),
            f"{score.switches}",
            f"{score.returned} of {score.returns}" if score.returns else "-",
            wait if wait == "-" else f"{wait} ({_word(score.worst_first_pose_s, 2)})",
            f"{score.visits - score.visits_matched} of {score.visits}",
            _word(score.false_a_minute, 1),
            f"{score.left_behind}",
            _word(100.0 * score.joint_error_m, 1),
            _word(1000.0 * score.step_s, 1),
        )
    )


def _row(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cells) + " |"


def _word(value: float, digits: int) -> str:
    return f"{value:.{digits}f}" if math.isfinite(value) else "-"
