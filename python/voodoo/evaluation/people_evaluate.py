"""Judging several people: the result of a recording, by whatever program."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from voodoo.errors import RecordingError, VoodooError
from voodoo.evaluation.people import PeopleScore, score
from voodoo.export.people_rows import read_rows
from voodoo.recordings.loaders import open_recording
from voodoo.recordings.people_truth import PEOPLE_TRUTH_FILE, PeopleTruth
from voodoo.recordings.recording import Recording
from voodoo.recordings.truth import find_beside


def has_people(path: Path) -> bool:
    """Whether a recording comes with the truth of several people, without opening it."""
    return find_beside(path, PEOPLE_TRUTH_FILE) is not None


def evaluate_result(
    path: Path, result: Path, *, loader: str | None = None, root_frame: str | None = None
) -> PeopleScore:
    """Judge a result file of several people, see voodoo.export.people_rows.

    Args:
        path: of the recording, with truth_people.csv beside it.
        result: .csv in the recording's root frame.
        loader: see open_recording.
        root_frame: of the result; None: the recording's own.

    Raises:
        VoodooError: one of them cannot be read, or they do not belong together.
    """
    options: dict[str, Any] = {} if root_frame is None else {"root_frame": root_frame}
    recording = open_recording(path, loader=loader, **options)
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


def truth_of(recording: Recording) -> PeopleTruth:
    """The truth of several people.

    Raises:
        RecordingError: it has none.
    """
    if recording.people is None:
        raise RecordingError(f"{recording.path}: expected {PEOPLE_TRUTH_FILE} beside the recording, found none")
    return recording.people
