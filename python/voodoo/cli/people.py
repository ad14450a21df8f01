"""`voodoo track --people` and `voodoo eval` for several persons."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from voodoo.cli.common import print_written
from voodoo.errors import NoPoseError, VoodooError

if TYPE_CHECKING:
    from voodoo.evaluation.people import PeopleScore
    from voodoo.evaluation.score import Score

ANY = "any"


def limit_of(word: str) -> int | None:
    """Parse the largest number of persons, from 1, or "any": None.

    Raises:
        VoodooError: another word.
    """
    if word != ANY and (not word.isdecimal() or int(word) < 1):
        raise VoodooError(f"people: expected any or a whole number from 1, found {word!r}")
    return None if word == ANY else int(word)


def refuse_several(**options: object) -> None:
    """Options of one person; names with _ for -.

    Raises:
        VoodooError: one is given.
    """
    for name, value in options.items():
        if value:
            raise VoodooError(f"{name.replace('_', '-')}: expected none with --people any or N, it is for one person")


def show_people(scores: Sequence[PeopleScore], out: Path | None, *, report: dict[str, Any] | None) -> None:
    """Print and write the table of several persons."""
    from voodoo.evaluation.people_report import DERIVED, people_markdown, write_people

    if report is not None:
        report["people"] = [{**vars(score), **{name: getattr(score, name) for name in DERIVED}} for score in scores]
    else:
        typer.echo(people_markdown(scores))
    if out is not None:
        print_written(write_people(out, scores), aside=report is not None)


def refuse_failures(scores: Sequence[PeopleScore | Score]) -> None:
    """Raise an error if a recording could not be tracked to its end, or nobody was found in any.

    Raises:
        VoodooError: names the first.
        NoPoseError: nobody was found.
    """
    failures = [score for score in scores if score.failure]
    if failures:
        raise VoodooError(f"{len(failures)} of {len(scores)} recordings failed, the first: {failures[0].failure}")
    if scores and all(score.nobody for score in scores):
        raise NoPoseError(f"nobody was found in {', '.join(score.name for score in scores[:3])}")
