"""What several commands do: open a recording, run over it, show progress, turn errors into one line."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np
import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

import voodoo
from voodoo.cli.options import NUMBERS, TOPICS
from voodoo.errors import VoodooError
from voodoo.overlay import Overlay
from voodoo.overlay_inputs import Picture
from voodoo.picture_writer import PictureWriter
from voodoo.recordings import Recording, open_recording
from voodoo.results import Track
from voodoo.running import track
from voodoo.sensors.depth import DepthFilter
from voodoo.sensors.front_end import INPUTS, FrontEndSettings
from voodoo.view import Viewer

T = TypeVar("T")
INTERRUPTED = 130
"""Exit code after Ctrl-C, as of every program that SIGINT ends."""


class Run(NamedTuple):
    """What a run over a recording leaves: the result, the time of every frame [s], the pictures that were asked for, and
    whether Ctrl-C ended it before the recording did."""

    track: Track
    seconds: list[float]
    pictures: list[Picture]
    interrupted: bool


def opened(path: Path, loader: str | None, frame: str | None, **options: Any) -> Recording:  # noqa: ANN401 - the loader checks them
    """The recording, in the root frame that was asked for."""
    if frame is not None:
        options["root_frame"] = frame
    return open_recording(path, loader=loader, **options)


def topics_of(words: Sequence[str] | None) -> dict[str, str | list[str]]:
    """The loader's options of "depth=/front/depth/image" each.

    Raises:
        VoodooError: another form or kind, or several calibrations.
    """
    names: dict[str, list[str]] = {}
    for word in words or ():
        kind, _, name = word.partition("=")
        if kind not in TOPICS or not name:
            raise VoodooError(f"topic: expected KIND=NAME with one of {', '.join(TOPICS)}, found {word!r}")
        names.setdefault(kind, []).append(name)
    if len(names.get("camera_info", ())) > 1:
        raise VoodooError(f"topic: expected one camera_info, found {', '.join(names['camera_info'])}")
    return {f"{kind}_topic": found if len(found) > 1 else found[0] for kind, found in names.items()}


def numbers_of(words: Sequence[str] | None) -> dict[str, float]:
    """The loader's options of "rate=30" each.

    Raises:
        VoodooError: another form or name.
    """
    numbers: dict[str, float] = {}
    for word in words or ():
        name, _, value = word.partition("=")
        try:
            number = float(value) if name in NUMBERS else None
        except ValueError:
            number = None
        if number is None:
            raise VoodooError(f"option: expected NAME=NUMBER with one of {', '.join(NUMBERS)}, found {word!r}")
        numbers[name] = number
    return numbers


def refuse_both(name: str, value: object, **others: object) -> None:
    """Refuse options that would not be read beside another one; None: not given.

    Raises:
        typer.BadParameter: one of them is given.
    """
    for other, given in others.items():
        if value is not None and given is not None:
            raise typer.BadParameter(f"give {name} or {other}, not both")


def kinds_of(words: str | None) -> tuple[str, ...]:
    """The kinds of inputs in "depth,scan"; all of them for None.

    Raises:
        VoodooError: an unknown kind.
    """
    return INPUTS if words is None else FrontEndSettings(use=tuple(word.strip() for word in words.split(","))).use


def depth_filter_of(words: str | None) -> DepthFilter | None:
    """The filter of "NEAR,FAR" in metres; none for None.

    Raises:
        VoodooError: not two numbers, or limits that leave nothing.
    """
    if words is None:
        return None
    try:
        nearest, farthest = (float(word) for word in words.split(","))
    except ValueError:
        raise VoodooError(f"depth-range: expected NEAR,FAR in metres, found {words!r}") from None
    return DepthFilter(nearest=nearest, farthest=farthest)


def config_of(path: Path | None) -> voodoo.Config:
    """The configuration of a file; the defaults for None."""
    return voodoo.Config() if path is None else voodoo.Config.load(path)


def run(
    source: Recording,
    tracker: voodoo.Tracker,
    overlay: Path | None,
    *,
    sheet: int = 0,
    settings: FrontEndSettings | None = None,
    viewer: Viewer | None = None,
) -> Run:
    """Track and draw, with `sheet` pictures spread over the recording. Ctrl-C ends it with the frames up to there, if any."""
    estimates, seconds, pictures, interrupted = [], [], [], False
    chosen = set(np.linspace(0, len(source) - 1, sheet).round().astype(int).tolist())
    rate = source.info().rate_hz
    drawing = Overlay(source)
    writer = None if overlay is None else PictureWriter(overlay, rate_hz=rate if np.isfinite(rate) else 30.0)
    with writer or nullcontext():
        try:
            for step in progressing(track(source, tracker, settings=settings), source.name, len(source)):
                estimates.append(step.estimate)
                seconds.append(step.seconds)
                if viewer is not None:
                    viewer.log(
                        step.estimate,
                        tracker.body,
                        recorded=step.recorded,
                        front_end=step.front_end,
                        seconds=step.seconds,
                    )
                if writer is not None or step.index in chosen:
                    picture = drawing.draw(
                        step.recorded, tracker.body, step.estimate, index=step.index, front_end=step.front_end
                    )
                    if writer is not None:
                        writer.write(picture)
                    if step.index in chosen:
                        pictures.append(picture)
        except KeyboardInterrupt:
            if not estimates:
                raise
            interrupted = True
    return Run(Track.of(estimates, body=tracker.body), seconds, pictures, interrupted)


def viewer_of(view: bool, save: Path | None, name: str) -> AbstractContextManager[Viewer | None]:
    """The viewer that was asked for, opened before the work so that a missing Rerun is told at once."""
    return Viewer(save=save, name=name) if view or save is not None else nullcontext()


def states(result: Track) -> str:
    """How many frames the tracker itself called what, e.g. "88 tracking, 2 lost"."""
    return ", ".join(f"{result.status.count(word)} {word}" for word in dict.fromkeys(result.status))


def progressing(items: Iterable[T], words: str, total: int) -> Iterator[T]:
    """Show a progress bar on stderr, if a person looks at it."""
    console = Console(stderr=True)
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True, disable=not sys.stderr.isatty()) as progress:
        yield from progress.track(items, total=total, description=words)


@contextmanager
def clear_errors() -> Iterator[None]:
    """Turn errors that have a clear message into that one line on stderr and exit code 1."""
    try:
        yield
    except VoodooError as error:
        _fail(str(error))
    except OSError as error:
        _fail(f"{error.filename}: {error.strerror}" if error.filename and error.strerror else str(error))


def _fail(message: str) -> None:
    typer.echo(f"voodoo: {' '.join(message.split())}", err=True)
    raise typer.Exit(1)
