"""`voodoo track --people` and `voodoo eval` for several persons."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import typer

from voodoo.cli.common import INTERRUPTED, print_message, progressing, refuse_missing, wrote
from voodoo.errors import VoodooError

if TYPE_CHECKING:
    from voodoo.evaluation.people import PeopleScore
    from voodoo.evaluation.score import Score
    from voodoo.export.people import PeopleTrack
    from voodoo.model.body import Body
    from voodoo.names import HumanModel
    from voodoo.people import People
    from voodoo.pipeline.start import Automatic
    from voodoo.recordings.left_out import LeftOut
    from voodoo.recordings.recording import Recording
    from voodoo.sensors.settings import FrontEndSettings
    from voodoo.visualization.rerun_viewer import Viewer

ANY = "any"


def limit_of(word: str) -> tuple[bool, int | None]:
    """Parse "any" or a number from 1: whether several persons are tracked, and the largest number (None: any).

    Raises:
        VoodooError: another word.
    """
    if word == ANY:
        return True, None
    if not word.isdecimal() or int(word) < 1:
        raise VoodooError(f"people: expected any or a whole number from 1, found {word!r}")
    return int(word) > 1, int(word)


def no_starts(init: str | None) -> Automatic:
    """Several persons are always searched for.

    Raises:
        VoodooError: a start was given.
    """
    from voodoo.pipeline.start import AUTO

    if init not in (None, AUTO):
        raise VoodooError(f"init: expected none with --people any or N, where everybody is looked for, found {init}")
    return AUTO


def refuse_several(**options: object) -> None:
    """Options of one person; names with _ for -.

    Raises:
        VoodooError: one is given.
    """
    for name, value in options.items():
        if value:
            raise VoodooError(f"{name.replace('_', '-')}: expected none with --people any or N, it is for one person")


def body_of(body: Path | None, *, height: float | None, model: HumanModel | None) -> Body | None:
    """The body that is copied for new persons: from a file, a human of a stature, or None for the default."""
    from voodoo.model.body import Body

    if body is not None:
        return Body.load(body)
    if height is None and model is None:
        return None
    return Body.human(1.75 if height is None else height, model=model or "measured")


@dataclass(frozen=True, eq=False)
class Outputs:
    """Targets of a result: files, images, Rerun."""

    targets: Sequence[Path]
    overlay: Path | None
    save: Path | None
    viewer: Viewer | None
    upright: bool = False


def follow_people(
    source: Recording, people: People, settings: FrontEndSettings, outputs: Outputs, left_out: LeftOut | None
) -> None:
    """Track all persons in a recording, and write the requested outputs."""
    from voodoo.cli.running import turn_of
    from voodoo.export.files import upright_words, written
    from voodoo.export.people_files import save_people
    from voodoo.export.upright import SUFFIX, UNTURNED, lying_words, turned

    result, bodies, interrupted, failure = _run(source, people, settings, outputs, left_out)
    turn = turn_of(source, list(result.tracks.values()), outputs.targets, upright=outputs.upright)
    doubts = [words for track in result.tracks.values() if (words := lying_words(track, source.root_frame, turn))]
    how: Any = {"root_frame": source.root_frame, "turn": turn}
    if outputs.upright and turn.words:
        result = replace(result, tracks={one: turned(track, turn) for one, track in result.tracks.items()})
        how = {"root_frame": f"{source.root_frame}{SUFFIX}", "turn": UNTURNED}
    done, failed = written(outputs.targets, lambda path: save_people(result, path, bodies=bodies, **how))
    for words in [upright_words(done, turn, every=outputs.upright), *doubts[:1]]:
        if words:
            print_message(words)
    done += [path for path in (None if failure else outputs.overlay, outputs.save) if path is not None]
    rows = sum(len(track) for track in result.tracks.values())
    count = len(result.tracks)
    message = f"{len(result)} frames, {count} {'person' if count == 1 else 'persons'} in {rows} rows{wrote(done)}"
    refuse_missing([*failed, failure], message)
    if interrupted:
        typer.echo(f"voodoo: interrupted, the rest of {len(source)} frames is missing: {message}", err=True)
        raise typer.Exit(INTERRUPTED)
    typer.echo(message)
    if not result.tracks:
        typer.echo(f"voodoo: {source.name}: nobody was found in {len(result)} frames", err=True)


class _Followed(NamedTuple):
    track: PeopleTrack
    bodies: dict[int, Body]
    interrupted: bool
    failure: VoodooError | OSError | None


def _run(
    source: Recording, people: People, settings: FrontEndSettings, outputs: Outputs, left_out: LeftOut | None
) -> _Followed:
    """Track and draw. Ctrl-C ends the run with the frames so far, if any."""
    from voodoo.export.people import PeopleTrack
    from voodoo.pipeline.people import track_people
    from voodoo.visualization.image_writer import PictureWriter
    from voodoo.visualization.overlay import Overlay

    estimates, interrupted = [], False
    bodies: dict[int, Body] = {}
    rate = source.info().rate_hz
    drawing = None if outputs.overlay is None else Overlay(source)
    writer = (
        None if outputs.overlay is None else PictureWriter(outputs.overlay, rate_hz=rate if np.isfinite(rate) else 30.0)
    )
    with writer or nullcontext():
        try:
            steps = track_people(source, people, settings=settings, left_out=left_out)
            for step in progressing(steps, source.name, len(source)):
                estimates.append(step.estimate)
                bodies |= {person.id: people.body(person.id) for person in step.estimate}
                if outputs.viewer is not None:
                    outputs.viewer.log_people(step.estimate, bodies, recorded=step.recorded, seconds=step.seconds)
                if writer is not None and drawing is not None:
                    writer.write(drawing.draw_people(step.recorded, step.estimate, bodies, index=step.index))
        except KeyboardInterrupt:
            if not estimates:
                raise
            interrupted = True
    failure = None if writer is None else writer.failure
    return _Followed(PeopleTrack.of(estimates, bodies=bodies), bodies, interrupted, failure)


def judged(paths: Sequence[Path], result: Path, loader: str | None, options: Mapping[str, Any]) -> PeopleScore:
    """Evaluate a result file of one recording."""
    from voodoo.evaluation.people_evaluate import evaluate_result

    if len(paths) != 1:
        raise typer.BadParameter(f"--result is the result of one recording, found {len(paths)}")
    return evaluate_result(paths[0], result, loader=loader, options=options)


def show_people(scores: Sequence[PeopleScore], out: Path | None) -> None:
    """Print and write the table of several persons."""
    from voodoo.evaluation.people_report import people_markdown, write_people

    typer.echo(people_markdown(scores))
    if out is not None:
        typer.echo("wrote " + ", ".join(str(file) for file in write_people(out, scores)))


def refuse_failures(scores: Sequence[PeopleScore] | Sequence[Score]) -> None:
    """Raise an error if a recording could not be tracked to its end.

    Raises:
        VoodooError: names the first.
    """
    failures = [score for score in scores if score.failure]
    if failures:
        raise VoodooError(f"{len(failures)} of {len(scores)} recordings failed, the first: {failures[0].failure}")
