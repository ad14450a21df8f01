"""Shared code of all commands: parse options, reject conflicting ones, show progress, print errors as one line."""

from __future__ import annotations

import os
import sys
import time
import warnings
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, redirect_stderr
from pathlib import Path
from typing import Any, TypeVar

import typer

from voodoo.cli.signals import INTERRUPTED
from voodoo.cli.terminal import READER_LEFT, Escaped
from voodoo.errors import NoPoseError, UnitWarning, VoodooError, reason

T = TypeVar("T")
WIDTH = 200
"""Longest line that is printed, but for names without spaces."""
_LINE_S = 5.0
FAILED, NO_POSE = 1, 3
EXIT_CODES = {
    0: "success; of a command that tracks: at least one pose",
    FAILED: "refused or failed; one line names what was expected and found",
    2: "a wrong option",
    NO_POSE: "no pose: nobody was found, and files tell so, or no frame could be used",
    INTERRUPTED: "ended by Ctrl-C (128 + SIGINT); the frames up to there are written",
    143: "ended by SIGTERM (128 + 15), as by Ctrl-C",
    129: "ended by SIGHUP (128 + 1), as by Ctrl-C",
    READER_LEFT: "what read the output has ended, as `head` does (128 + SIGPIPE); nothing more is said",
}
"""What the exit codes of all commands mean; Typer uses 2."""


def refuse_both(name: str, value: object, **others: object) -> None:
    """Reject options that exclude another one; None: not given.

    Raises:
        typer.BadParameter: one of them is given.
    """
    for other, given in others.items():
        if value is not None and given is not None:
            raise typer.BadParameter(f"give {name} or {other}, not both")


def states(status: Iterable[str]) -> str:
    """Number of frames per status, e.g. "88 tracking, 2 lost"."""
    return ", ".join(f"{count} {word}" for word, count in Counter(status).items())


def print_result(message: str, targets: Iterable[Path]) -> None:
    """The last lines of a command on stdout; on stderr if a target is stdout."""
    print_text(message, err=Path("-") in targets)


def wrote(files: Sequence[Path]) -> str:
    """The end of a message that names the written files; empty without any."""
    files = [file for file in files if str(file) != "-"]
    return f"; wrote {' and '.join(map(str, files))}" if files else ""


def print_written(files: Iterable[Path], *, aside: bool) -> None:
    """Name the written files on stdout; `aside`: on stderr."""
    (print_message if aside else typer.echo)(f"wrote {', '.join(map(str, files))}")


def refuse_missing(failures: Sequence[Exception], done: str) -> None:
    """Raise an error if outputs are missing, which tells what there is.

    Raises:
        VoodooError: names what is missing and why.
    """
    if failures:
        raise VoodooError(f"not written: {'; '.join(map(reason, failures))}. {done}")


def progressing(items: Iterable[T], words: str, total: int) -> Iterator[T]:
    """Show a progress bar on stderr; if it is no terminal, a line every few seconds."""
    if not sys.stderr.isatty():
        reported = time.monotonic()
        for count, item in enumerate(items, 1):
            yield item
            if time.monotonic() - reported > _LINE_S:
                reported = time.monotonic()
                print_message(f"{words}: {count} of {total}")
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    console = Console(file=getattr(sys.stderr, "stream", sys.stderr))  # whose commands are Rich's own
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True) as progress:
        with redirect_stderr(Escaped(sys.stderr)):  # Rich writes lines above the bar
            yield from progress.track(items, total=total, description=words)


def cores() -> int:
    """Number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def print_interrupted(interrupted: bool, done: str) -> None:
    """After Ctrl-C, print what was done on stderr and exit with its code.

    Raises:
        typer.Exit: it was pressed.
    """
    if interrupted:
        typer.echo(f"voodoo: interrupted: {done}", err=True)
        raise typer.Exit(INTERRUPTED)


@contextmanager
def clear_errors() -> Iterator[None]:
    """Convert expected errors to one line on stderr and the exit code FAILED or NO_POSE.

    NumPy's warnings (e.g. on overflow in a damaged file), and those of units, which commands doubt in their own words, are
    suppressed; -W shows them.
    """
    try:
        with warnings.catch_warnings():
            if not sys.warnoptions:
                warnings.simplefilter("ignore", RuntimeWarning)
                warnings.simplefilter("ignore", UnitWarning)
            yield
    except (VoodooError, OSError, MemoryError) as error:
        little = isinstance(error, MemoryError)
        print_message("expected enough memory for this recording, found too little" if little else reason(error))
        if hint := getattr(error, "hint", ""):
            typer.echo(hint, err=True)
        raise typer.Exit(NO_POSE if isinstance(error, NoPoseError) else FAILED) from None


def print_message(message: str) -> None:
    """One line on stderr, or several if it is long."""
    print_text(f"voodoo: {' '.join(message.split())}", err=True)


def print_text(text: str, *, err: bool = False) -> None:
    """Lines on stdout or stderr; one of more than WIDTH characters goes on in the next line."""
    from textwrap import wrap

    for line in text.splitlines():
        how: Any = {"subsequent_indent": "  ", "break_long_words": False, "break_on_hyphens": False}
        typer.echo(line if len(line) <= WIDTH else "\n".join(wrap(line, WIDTH, drop_whitespace=True, **how)), err=err)


def print_json(value: object) -> None:
    """A value on stdout as JSON: dataclasses are objects, what is not known (NaN) is null."""
    from pydantic_core import to_json

    typer.echo(to_json(value, indent=2, inf_nan_mode="null", fallback=str).decode("utf-8"))


@contextmanager
def reporting(as_json: bool) -> Iterator[dict[str, Any] | None]:
    """An object that is printed as JSON at the end, whatever happens; None without --json."""
    report: dict[str, Any] = {}
    try:
        yield report if as_json else None
    finally:
        if report:
            print_json(report)
