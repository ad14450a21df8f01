"""Shared code of commands that track: open a recording, track, draw. Imported when a command runs, not for its help."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from voodoo.cli.common import progressing
from voodoo.config import Config
from voodoo.detectors import AnyDetector, OnnxDetector
from voodoo.errors import VoodooError
from voodoo.export.files import is_turned
from voodoo.export.track import Track
from voodoo.export.upright import Turn, by_axes, by_feet, by_floor, lying_words
from voodoo.pipeline.floor import seen_floor
from voodoo.pipeline.run import track
from voodoo.pipeline.start import Beginning
from voodoo.pipeline.starts.chosen import Starts
from voodoo.recordings.left_out import LeftOut
from voodoo.recordings.loaders import open_recording
from voodoo.recordings.recording import Recording
from voodoo.sensors.depth import DepthFilter
from voodoo.sensors.kinds import inputs_of
from voodoo.sensors.settings import LEVEL_FRAMES, Box, FrontEndSettings
from voodoo.tracker import Tracker
from voodoo.visualization.image_writer import PictureWriter
from voodoo.visualization.ink import Picture
from voodoo.visualization.overlay import Overlay
from voodoo.visualization.rerun_viewer import Viewer


class Run(NamedTuple):
    """Outcome of a run over a recording: the result, the time of every frame [s], the requested images, whether it was ended by
    Ctrl-C, and why images of `overlay` are missing."""

    track: Track
    seconds: list[float]
    pictures: list[Picture]
    interrupted: bool
    failure: VoodooError | OSError | None


def opened(path: Path, loader: str | None, frame: str | None, **options: Any) -> Recording:  # noqa: ANN401 - the loader checks them
    """Open a recording, in the requested root frame."""
    if frame is not None:
        options["root_frame"] = frame
    return open_recording(path, loader=loader, **options)


def kinds_of(words: str | None) -> tuple[str, ...] | None:
    """The kinds of inputs in "depth,scan"; None: the best ones for the recording.

    Raises:
        VoodooError: an unknown kind.
    """
    if words is None:
        return None
    return FrontEndSettings(use=tuple(word.strip() for word in words.split(","))).use


def depth_filter_of(words: str | None) -> DepthFilter | None:
    """The filter of "NEAR,FAR" in meters; none for None.

    Raises:
        VoodooError: not two numbers, or an empty range.
    """
    if words is None:
        return None
    try:
        nearest, farthest = (float(word) for word in words.split(","))
    except ValueError:
        raise VoodooError(f"depth-range: expected NEAR,FAR in meters, found {words!r}") from None
    return DepthFilter(nearest=nearest, farthest=farthest)


def bare_for(init: Beginning | None) -> dict[str, Any]:
    """The option of `open_recording` that ignores files beside the recording if another start is given or searched for."""
    return {} if init is None else {"bare": True}


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


def used_inputs(source: Recording, settings: FrontEndSettings) -> set[str]:
    """Kinds of inputs that a recording has and that are used."""
    return {kind for sensor in source.info().sensors for kind in inputs_of(sensor.kind)} & set(settings.use)


def boxes_of(words: Sequence[str] | None) -> tuple[Box, ...]:
    """Parse boxes of the form "X0,Y0,Z0,X1,Y1,Z1", lower corner first.

    Raises:
        VoodooError: not six finite numbers, or a box without inside.
    """
    boxes = []
    for word in words or ():
        try:
            numbers = [float(part) for part in word.split(",")]
        except ValueError:
            numbers = []
        if len(numbers) != 6 or not np.isfinite(numbers).all():
            raise VoodooError(f"exclude: expected X0,Y0,Z0,X1,Y1,Z1 in meters, found {word!r}")
        low, high = np.sort(np.reshape(numbers, (2, 3)), axis=0).tolist()
        boxes.append(((low[0], low[1], low[2]), (high[0], high[1], high[2])))
    return FrontEndSettings(exclude=tuple(boxes)).exclude


def config_of(path: Path | None) -> Config:
    """Load a configuration; None: the defaults."""
    return Config() if path is None else Config.load(path)


def detector_of(path: Path | None) -> AnyDetector:
    """Load the network of an ONNX file; None: the shipped detector.

    Raises:
        ConfigError: the file is not such a network.
    """
    return "shipped" if path is None else OnnxDetector(path)


def turn_of(source: Recording, tracks: Sequence[Track], targets: Sequence[Path], *, upright: bool = False) -> Turn:
    """How files are turned upright whose root frame is a camera's: by the floor that is seen, else by its axes.

    Args:
        source: the recording.
        tracks: its results.
        targets: the files.
        upright: turn any root frame to z up and put the feet on z = 0; one that is known to be so stays.
    """
    root, optical = source.root_frame, source.info().camera_root
    stands = root in LEVEL_FRAMES and not optical and not any(lying_words(track, root) for track in tracks)
    if stands or not (upright or (optical and any(map(is_turned, targets)))):
        return by_axes(root, optical=optical)
    floor = seen_floor(source)
    if floor is not None:
        return by_floor(floor, optical=optical)
    return by_feet(tracks, root, optical=optical) if upright else by_axes(root, optical=optical)


def run(
    source: Recording,
    tracker: Tracker,
    overlay: Path | None,
    *,
    sheet: int = 0,
    settings: FrontEndSettings | None = None,
    starts: Starts | None = None,
    viewer: Viewer | None = None,
    left_out: LeftOut | None = None,
) -> Run:
    """Track and draw, with `sheet` images spread over the recording. Ctrl-C ends the run with the frames so far, if any."""
    estimates, seconds, pictures, interrupted = [], [], [], False
    chosen = set(np.linspace(0, len(source) - 1, sheet).round().astype(int).tolist())
    rate = source.info().rate_hz
    drawing = Overlay(source)
    writer = None if overlay is None else PictureWriter(overlay, rate_hz=rate if np.isfinite(rate) else 30.0)
    with writer or nullcontext():
        try:
            steps = track(source, tracker, settings=settings, starts=starts, left_out=left_out)
            for step in progressing(steps, source.name, len(source)):
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
    if not estimates:
        raise VoodooError(
            f"{source.name}: expected at least one frame that can be used, found none: {left_out or 'it is empty'}"
            + (f" (the first: {next(iter(left_out.first.values()))})" if left_out else "")
        )
    left = {} if left_out is None else left_out.counts
    failure = None if writer is None else writer.failure
    return Run(Track.of(estimates, body=tracker.body, left_out=left), seconds, pictures, interrupted, failure)


def viewer_of(view: bool, save: Path | None, name: str) -> AbstractContextManager[Viewer | None]:
    """Open the requested viewer before the work, so that a missing Rerun is reported immediately."""
    return Viewer(save=save, name=name) if view or save is not None else nullcontext()
