"""Evaluates results of several persons, of voodoo or other programs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from voodoo.config import Config
from voodoo.errors import RecordingError, VoodooError
from voodoo.evaluation.people import PeopleScore, motmetrics, score
from voodoo.export.people import PeopleTrack
from voodoo.export.table import Arrays, opened_result
from voodoo.model.body import Body
from voodoo.names import Automatic, HumanModel
from voodoo.people import People
from voodoo.pipeline.run import track
from voodoo.recordings.loaders import open_recording
from voodoo.recordings.people_truth import PEOPLE_TRUTH_FILE, PeopleTruth
from voodoo.recordings.recording import Recording
from voodoo.recordings.truth import find_beside
from voodoo.sensors.settings import FrontEndSettings


def has_people(path: Path) -> bool:
    """Whether a recording has the ground truth of several persons, without opening it."""
    return find_beside(path, PEOPLE_TRUTH_FILE) is not None


def evaluate_result(
    path: Path, result: Path, *, loader: str | None = None, options: Mapping[str, Any] | None = None
) -> PeopleScore:
    """Evaluate a result file, see voodoo.export.table.opened_result.

    Args:
        path: of the recording, with truth_people.csv beside it.
        result: .csv or .npz in the recording's root frame.
        loader, options: see open_recording.

    Raises:
        VoodooError: one of them cannot be read, or their stamps do not match.
    """
    recording = open_recording(path, loader=loader, **(options or {}))
    truth = truth_of(recording)
    rows = read_rows(result)
    stamps = rows["stamps"]
    about = recording.info()
    late = about.start_stamp + about.duration
    outside = (stamps < about.start_stamp - 0.5) | (stamps > late + 0.5)
    if outside.any():
        raise VoodooError(
            f"{result}: expected stamps from {about.start_stamp:.6f} to {late:.6f} s as in {recording.name}, found "
            f"{stamps[outside][0]:.6f}"
        )
    return score(recording.name, path, truth, rows, seconds=about.duration)


def read_rows(result: Path) -> Arrays:
    """Read a result, see voodoo.export.table.opened_result.

    Raises:
        VoodooError: it cannot be read, stamps fall, or a person has two rows at one stamp.
    """
    with opened_result(result) as content:
        rows = dict(content)
        if (np.diff(rows["stamps"]) < 0.0).any():
            raise VoodooError("stamp_s: expected finite numbers that do not fall, found others")
        if len(set(zip(rows["stamps"].tolist(), rows["person"].tolist(), strict=True))) != len(rows["stamps"]):
            raise VoodooError("expected one row for a person and stamp, found several")
        return rows


def judge(recording: Recording, people: People, *, settings: FrontEndSettings | None = None) -> PeopleScore:
    """Track all persons in a recording and evaluate the result.

    Raises:
        VoodooError: the recording has no ground truth of several persons, or a frame was rejected.
    """
    truth = truth_of(recording)
    motmetrics()  # a missing library must be reported before the work
    steps = list(track(recording, people, settings=settings))
    rows = PeopleTrack.of([step.estimate for step in steps]).arrays()
    seconds = float(np.mean([step.seconds for step in steps])) if steps else np.nan
    about = recording.info()
    return score(recording.name, recording.path, truth, rows, seconds=about.duration, step_s=seconds)


def evaluate_people(
    path: Path,
    *,
    config: Config | None = None,
    loader: str | None = None,
    options: Mapping[str, Any] | None = None,
    model: HumanModel | None = None,
    use: Sequence[str] | None = None,
    init: Automatic | None = None,
) -> tuple[PeopleScore, None]:
    """Track all persons in a recording and evaluate the result; without a table of frames.

    Args:
        path: of a recording with truth_people.csv beside it.
        config: None means the defaults.
        loader, options: see open_recording.
        model: model of the human; None: that of `voodoo.People`.
        use: kinds of inputs; None: all.
        init: of no effect, since persons are always searched for.

    Raises:
        VoodooError: it cannot be read, or a frame was refused.
    """
    recording = open_recording(path, loader=loader, **(options or {}))
    people = People(None if model is None else Body.human(model=model), config=config)
    return judge(recording, people, settings=FrontEndSettings.of(recording, use=use)), None


def truth_of(recording: Recording) -> PeopleTruth:
    """The ground truth of several persons.

    Raises:
        RecordingError: it has none.
    """
    if recording.people is None:
        raise RecordingError(f"{recording.path}: expected {PEOPLE_TRUTH_FILE} beside the recording, found none")
    return recording.people
