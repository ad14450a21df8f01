"""Shared code of commands that track: open a recording, track, draw. Imported when a command runs, not for its help."""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import nullcontext, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import typer

from voodoo.cli.common import print_message, progressing
from voodoo.cli.options import Reading, Tracking
from voodoo.cli.paths import check_paths
from voodoo.cli.recover import recover_before
from voodoo.cli.signals import deferred
from voodoo.config import Config
from voodoo.detectors import AnyDetector, OnnxDetector
from voodoo.drawing.ink import Picture
from voodoo.errors import NoPoseError, VoodooError
from voodoo.export.files import check_target, is_table
from voodoo.export.spool import Spool
from voodoo.export.track import Track
from voodoo.export.upright import Turn, by_axes, by_feet, by_floor, lying_words
from voodoo.measurements import ASSUMED_RATE_HZ
from voodoo.pipeline.floor import visible_floor
from voodoo.pipeline.run import TrackedFrame
from voodoo.pipeline.start import AUTO, Beginning, beginning_of, start_people, start_tracker
from voodoo.recordings.left_out import LeftOut, no_frame
from voodoo.recordings.loaders import open_recording
from voodoo.recordings.recording import Recording
from voodoo.sensors.depth import DepthFilter
from voodoo.sensors.settings import LEVEL_FRAMES, Box, FrontEndSettings
from voodoo.visualization.image_writer import PictureWriter
from voodoo.visualization.overlay import Overlay
from voodoo.visualization.rerun_viewer import Viewer

TOGETHER = 250
"""Frames whose poses a crash costs at most, and that are in memory."""


class Run(NamedTuple):
    """Outcome of a run over a recording: the time of every frame [s], the requested images, whether it was ended by a signal,
    which of `overlay` and `save` are written, and what failed."""

    seconds: Sequence[float]
    pictures: list[Picture]
    interrupted: bool
    written: list[Path]
    failures: list[Exception]


@dataclass(frozen=True)
class ParsedTracking:
    """How a tracker starts, by the options of a command.

    Args:
        limit: largest number of persons; None: any.
        beginning: first pose; with several persons they are searched for.
        options: others of `start_tracker`.
        filters: entries of FrontEndSettings.
    """

    limit: int | None
    beginning: Beginning | None
    options: Mapping[str, Any]
    filters: Mapping[str, Any]

    @classmethod
    def of(cls, asked: Tracking) -> ParsedTracking:
        """Parse the options.

        Raises:
            typer.BadParameter: options that exclude each other.
            VoodooError: an option of another form, or a file that is wrong.
        """
        limit = limit_of(asked.people)
        if limit != 1 and asked.init not in (None, AUTO):
            raise VoodooError(
                f"init: expected none with --people any or N, where everybody is looked for, found {asked.init}"
            )
        detector: AnyDetector = "shipped" if asked.detector is None else OnnxDetector(asked.detector)
        how = {"config": config_of(asked.config), "use": kinds_of(asked.use), "detector": detector}
        filters = {"depth_filter": depth_filter_of(asked.depth_range), "exclude": boxes_of(asked.exclude)}
        return cls(limit, beginning_of(asked.init) if limit == 1 else AUTO, asked.start() | how, filters)

    def settings(self, source: Recording) -> FrontEndSettings:
        """Those of the front end."""
        return replace(FrontEndSettings.of(source, use=self.options["use"]), **self.filters)

    def tracker(self, source: Recording, **more: Any) -> Any:  # noqa: ANN401 - of start_tracker; a Tracker or People
        """The tracker of one person, or of several."""
        if self.limit != 1:
            return start_people(source, limit=self.limit, **self.options, **more)
        return start_tracker(source, init=self.beginning, **self.options, **more)


def opened(path: Path, reading: Reading, **options: Any) -> Recording:  # noqa: ANN401 - the loader checks them
    """Open a recording."""
    return open_recording(path, **reading.words() | options)


def limit_of(word: str) -> int | None:
    """Parse the largest number of persons, from 1, or "any": None.

    Raises:
        VoodooError: another word.
    """
    if word != "any" and (not word.isdecimal() or int(word) < 1):
        raise VoodooError(f"people: expected any or a whole number from 1, found {word!r}")
    return None if word == "any" else int(word)


def kinds_of(words: str | None) -> tuple[str, ...] | None:
    """The kinds of inputs in "depth,scan"; None: the best ones for the recording.

    Raises:
        VoodooError: an unknown kind.
    """
    if words is None:
        return None
    return FrontEndSettings(use=tuple(word.strip() for word in words.split(","))).use


def _meters(option: str, names: str, word: str) -> list[float]:
    """The numbers in a word, as many as there are names.

    Raises:
        VoodooError: others.
    """
    with suppress(ValueError):
        if len(numbers := [float(part) for part in word.split(",")]) == len(names.split(",")):
            return numbers
    raise VoodooError(f"{option}: expected {names} in meters, found {word!r}")


def depth_filter_of(words: str | None) -> DepthFilter | None:
    """The filter of "NEAR,FAR" in meters; none for None.

    Raises:
        VoodooError: not two numbers, or an empty range.
    """
    if words is None:
        return None
    nearest, farthest = _meters("depth-range", "NEAR,FAR", words)
    return DepthFilter(nearest=nearest, farthest=farthest)


def refuse_unused(has: set[str], **options: tuple[object, tuple[str, ...]]) -> None:
    """Reject options for inputs that are not used.

    Args:
        has: kinds of inputs that are used; empty: not known.
        **options: name, with _ for -, -> its value, None or empty if it is not given, and the kinds of inputs it is for.

    Raises:
        VoodooError: names option and inputs.
    """
    for name, (given, kinds) in options.items():
        if given and has and not has & set(kinds):
            raise VoodooError(
                f"{name.replace('_', '-')}: expected an input it is for ({', '.join(kinds)}), found "
                f"{', '.join(sorted(has))}"
            )


def boxes_of(words: Sequence[str] | None) -> tuple[Box, ...]:
    """Parse boxes of the form "X0,Y0,Z0,X1,Y1,Z1", lower corner first.

    Raises:
        VoodooError: not six finite numbers, or a box without inside.
    """
    boxes = []
    for word in words or ():
        numbers = _meters("exclude", "X0,Y0,Z0,X1,Y1,Z1", word)
        low, high = np.sort(np.reshape(numbers, (2, 3)), axis=0).tolist()
        boxes.append(((low[0], low[1], low[2]), (high[0], high[1], high[2])))
    return FrontEndSettings(exclude=tuple(boxes)).exclude


def config_of(path: Path | None) -> Config:
    """Load a configuration; None: the defaults."""
    return Config() if path is None else Config.load(path)


def spool_of(
    source: Recording,
    out: Sequence[Path] | None,
    context: typer.Context,
    *,
    suffix: str = ".csv",
    upright: bool = False,
) -> Spool:
    """Where poses are kept until the outputs of a command are written, by default one with the name of the recording.

    What killed commands left in their folders is completed before.

    Raises:
        VoodooError: an output that cannot be written, or is an input.
    """
    targets = out or [Path(f"{source.name}{suffix}")]
    for target in targets:
        check_target(target)
    if not out:
        check_paths(context, targets)
    recover_before(targets)
    how: dict[str, Any] = {"optical": source.info().camera_root, "upright": upright}
    return Spool(targets, root_frame=lambda: source.root_frame, together=TOGETHER, **how)


def turn_of(
    source: Recording,
    tracks: Sequence[Track],
    targets: Sequence[Path],
    *,
    upright: bool = False,
    left_out: LeftOut | None = None,
) -> Turn:
    """How files are turned upright whose root frame is a camera's: by the floor that is seen, else by its axes.

    Args:
        source: the recording.
        tracks: its results.
        targets: the files.
        upright: turn any root frame to z up and put the feet on z = 0; one that is known to be so stays.
        left_out: that of the recording, which does not count again what is read again.
    """
    root, optical = source.root_frame, source.info().camera_root
    stands = root in LEVEL_FRAMES and not optical and not any(lying_words(track, root) for track in tracks)
    if stands or not (upright or (optical and not all(map(is_table, targets)))):
        return by_axes(root, optical=optical)
    floor = visible_floor(source, left_out=left_out)
    if floor is not None:
        return by_floor(floor, optical=optical)
    return by_feet(tracks, root, optical=optical) if upright else by_axes(root, optical=optical)


def run(
    source: Recording,
    steps: Iterable[Any],
    *,
    take: Callable[[Any], None],
    overlay: Path | None = None,
    save: Path | None = None,
    viewer: Viewer | None = None,
    sheet: int = 0,
    left_out: LeftOut | None = None,
) -> Run:
    """Track and draw; a signal ends the run with the frames so far, if any. What cannot be drawn or shown costs no poses.

    Args:
        source: the recording.
        steps: its frames, tracked, of one person or several.
        take: keeps the poses of a frame. An OSError, also of the recording, ends the run.
        overlay: PictureWriter's path.
        save: file of the viewer.
        viewer: closed at the end.
        sheet: number of images of `overlay` to return, spread over the recording.
        left_out: told if no frame can be used.

    Raises:
        NoPoseError: no frames.
    """
    seconds, pictures, interrupted = array("d"), [], False
    failures: list[Exception] = []
    chosen = set(np.linspace(0, len(source) - 1, sheet).round().astype(int).tolist())
    rate = source.info().rate_hz
    writer = None if overlay is None else PictureWriter(overlay, rate_hz=rate if np.isfinite(rate) else ASSUMED_RATE_HZ)
    if writer is not None and writer.note:
        print_message(writer.note)
    drawing: list[Overlay] = []

    def draw(writer: PictureWriter, step: TrackedFrame[Any]) -> None:
        if not drawing:
            with nullcontext() if left_out is None else left_out.aside():
                drawing.append(Overlay(source))
        about: dict[str, Any] = {"index": step.index, "front_end": step.front_end}
        picture = drawing[0].draw(step.recorded, step.front_end.bodies, step.estimate, **about)
        writer.write(picture)
        if step.index in chosen:
            pictures.append(picture)

    def show(viewer: Viewer, step: TrackedFrame[Any]) -> None:
        about: dict[str, Any] = {"recorded": step.recorded, "front_end": step.front_end, "seconds": step.seconds}
        viewer.log(step.estimate, step.front_end.bodies, **about)

    with deferred() as ended, viewer or nullcontext(), writer or nullcontext():
        try:
            for step in progressing(steps, source.name, len(source)):
                seconds.append(step.seconds)
                take(step)
                if viewer is not None:
                    viewer.attempt(show, viewer, step)
                if writer is not None:
                    writer.attempt(draw, writer, step)
                if interrupted := ended.is_set():
                    break
        except KeyboardInterrupt:
            if not seconds:
                raise
            interrupted = True
        except OSError as error:
            if not seconds:
                raise
            failures.append(error)
    if not seconds:
        raise NoPoseError(no_frame(source.name, left_out))
    outputs = [(path, output.failure) for path, output in ((overlay, writer), (save, viewer)) if output is not None]
    failures += [failure for _, failure in outputs if failure is not None]
    done = [path for path, failure in outputs if path is not None and failure is None]
    return Run(seconds, pictures, interrupted, done, failures)
