"""Evaluates results of several persons, of voodoo or other programs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from voodoo.config import Config
from voodoo.errors import RecordingError, VoodooError
from voodoo.evaluation.people import PeopleScore, motmetrics, score
from voodoo.export.people import PeopleTrack
from voodoo.export.people_rows import read_rows
from voodoo.model.body import Body
from voodoo.names import HumanModel
from voodoo.people import People
from voodoo.pipeline.people import track_people
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
    """Evaluate a result file of several persons, see voodoo.export.people_rows.

    Args:
        path: of the recording, with truth_people.csv beside it.
        result: .csv in the recording's root frame.
        loader, options: see open_recording.

    Raises:
        VoodooError: one of them cannot be read, or their stamps do not match.
    """
    recording = open_recording(path, loader=loader, **(options or {}))
    truth = truth_of(recording)
    rows = read_rows(result)
    about = recording.info()
    late = about.start_stamp + about.duration
    outside = (rows.stamps < about.start_stamp - 0.5) | (rows.stamps > late + 0.5)
    if outside.any():
        raise VoodooError(
            f"{result}: expected stamps from {about.start_stamp:.6f} to {late:.6f} s as in {recording.name}, found "
            f"{rows.stamps[outside][0]:.6f}"
        )
    return score(recording.name, path, truth, rows, seconds=about.duration)


def judge(recording: Recording, people: People, *, settings: FrontEndSettings | None = None) -> PeopleScore:
    """Track all persons in a recording and evaluate the result.

    Raises:
        VoodooError: the recording has no ground truth of several persons, or a frame was rejected.
    """
    truth = truth_of(recording)
    motmetrics()  # a missing library must be reported before the work
    steps = list(track_people(recording, people, settings=settings))
    rows = PeopleTrack.of([step.estimate for step in steps]).rows()
    seconds = float(np.mean([step.seconds for step in steps])) if steps else np.nan
    about = recording.info()
    return score(recording.name, recording.path, truth, rows, seconds=about.duration, step_s=seconds)


def evaluate_all_people(
    paths: Sequence[Path],
    *,
    config_file: Path | None = None,
    loader: str | None = None,
    options: Mapping[str, Any] | None = None,
    model: HumanModel | None = None,
    use: Sequence[str] | None = None,
) -> Iterator[PeopleScore]:
    """Track all persons in recordings, without a start, and evaluate the results; one that fails yields a score with a `failure`.

    Args:
        paths: of recordings with truth_people.csv beside them.
        config_file: None means the defaults.
        loader, options: see open_recording.
        model: model of the human; None: that of `voodoo.People`.
        use: kinds of inputs; None: all.
    """
    for path in paths:
        try:
            config = None if config_file is None else Config.load(config_file)
            recording = open_recording(path, loader=loader, **(options or {}))
            people = People(None if model is None else Body.human(model=model), config=config)
            yield judge(recording, people, settings=FrontEndSettings.of(recording, use=use))
        except (VoodooError, OSError) as error:
            yield PeopleScore(path.name, path, failure=str(error))


def truth_of(recording: Recording) -> PeopleTruth:
    """The ground truth of several persons.

    Raises:
        RecordingError: it has none.
    """
    if recording.people is None:
        raise RecordingError(f"{recording.path}: expected {PEOPLE_TRUTH_FILE} beside the recording, found none")
    return recording.people
