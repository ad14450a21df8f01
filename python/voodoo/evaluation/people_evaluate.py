"""Evaluates results of several persons, of voodoo or other programs, and writes what is found as Markdown and .csv."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from voodoo.errors import RecordingError, VoodooError
from voodoo.evaluation.people import ROOT, RULES, PeopleScore, motmetrics, score, together
from voodoo.evaluation.score import RATIO, written
from voodoo.evaluation.summary import table_head, table_row, table_text
from voodoo.export.people import PeopleTrack
from voodoo.export.table import Arrays, opened_result
from voodoo.names import Automatic
from voodoo.people import ONE, People
from voodoo.pipeline.run import track
from voodoo.pipeline.start import start_people
from voodoo.recordings.loaders import open_recording
from voodoo.recordings.people_truth import PeopleTruth
from voodoo.recordings.recording import Recording
from voodoo.recordings.truth import PEOPLE_TRUTH_FILE, TRUTH_FILE, find_beside
from voodoo.sensors.settings import FrontEndSettings
from voodoo.whole import write_whole


def has_people(path: Path) -> bool:
    """Whether a recording has the ground truth of several persons, without opening it."""
    return find_beside(path, PEOPLE_TRUTH_FILE) is not None


def evaluate_result(path: Path, result: Path, *, options: Mapping[str, Any] | None = None) -> PeopleScore:
    """Evaluate a result file, see voodoo.export.table.opened_result.

    Args:
        path: of the recording, with truth_people.csv or truth.csv beside it.
        result: .csv or .npz in the recording's root frame.
        options: see open_recording.

    Raises:
        VoodooError: one of them cannot be read, or their stamps do not match.
    """
    recording = open_recording(path, **(options or {}))
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
    options: Mapping[str, Any] | None = None,
    use: Sequence[str] | None = None,
    init: Automatic | None = None,
    **how: Any,  # noqa: ANN401 - of start_people
) -> tuple[PeopleScore, None]:
    """Track all persons in a recording and evaluate the result; without a table of frames.

    Args:
        path: of a recording with truth_people.csv beside it.
        options: see open_recording.
        use: kinds of inputs; None: all.
        init: of no effect, since persons are always searched for.
        **how: config and model, see start_people.

    Raises:
        VoodooError: it cannot be read, or a frame was refused.
    """
    recording = open_recording(path, **(options or {}))
    people = start_people(recording, use=use, **how)
    return judge(recording, people, settings=FrontEndSettings.of(recording, use=use)), None


def truth_of(recording: Recording) -> PeopleTruth:
    """The ground truth of several persons, or of the only one, who is in view wherever the root is known.

    Raises:
        RecordingError: it has none, or none with the root.
    """
    one = recording.reference
    if recording.people is not None:
        return recording.people
    expected = f"{recording.path}: expected {PEOPLE_TRUTH_FILE} or {TRUTH_FILE} with {ROOT} beside the recording"
    if one is None or not one.exact:
        raise RecordingError(f"{expected}, found {'none' if one is None else 'joints that another tracker estimated'}")
    if ROOT not in one.names:
        raise RecordingError(f"{expected}, found {', '.join(one.names)}")
    in_view = np.asarray(np.isfinite(one.positions[:, one.names.index(ROOT)]).all(axis=1), dtype=np.float64)
    return PeopleTruth(one.stamps, np.array([ONE]), in_view[:, None], one.names, one.positions[:, None])


DERIVED = ("mota", "idf1", "false_a_minute")


def people_markdown(scores: Sequence[PeopleScore]) -> str:
    """A table with a row per recording, and one for all together."""
    lines = ["## People, against exact truth\n", *table_head(name for name, _ in _COLUMNS)]
    lines += [_line(score) for score in scores]
    if len([score for score in scores if not score.failure]) > 1:
        lines.append(_line(together(scores)))
    return "\n".join([*lines, f"\n{RULES}\n"])


def write_people(folder: Path, scores: Sequence[PeopleScore]) -> list[Path]:
    """Write people.csv (a row per recording) and people.md; returns both paths.

    Raises:
        OSError: a file cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    table, text = folder / "people.csv", folder / "people.md"
    names = [*(item.name for item in fields(PeopleScore)), *DERIVED]
    write_whole(table, table_text(names, ([getattr(score, name) for name in names] for score in scores)))
    write_whole(text, people_markdown(scores))
    return [table, text]


def _line(score: PeopleScore) -> str:
    if score.failure:
        return table_row((score.name, score.failure.replace("|", "/"), *[""] * (len(_COLUMNS) - 2)))
    return table_row(cell(score) for _, cell in _COLUMNS)


def _first_pose(score: PeopleScore) -> str:
    wait = written(score.first_pose_s, RATIO)
    return wait if wait == "-" else f"{wait} ({written(score.worst_first_pose_s, RATIO)})"


_COLUMNS: tuple[tuple[str, Callable[[PeopleScore], str]], ...] = (
    ("recording", lambda score: score.name),
    ("persons", lambda score: f"{score.persons}"),
    ("ids", lambda score: f"{score.ids}"),
    ("MOTA", lambda score: written(score.mota, (1.0, ".3f", ""))),
    ("IDF1", lambda score: written(score.idf1, (1.0, ".3f", ""))),
    ("id switches", lambda score: f"{score.switches}"),
    ("same id after return", lambda score: f"{score.returned} of {score.returns}" if score.returns else "-"),
    ("first pose after, s (worst)", _first_pose),
    ("never found", lambda score: f"{score.visits - score.visits_matched} of {score.visits}"),
    ("false bodies a minute", lambda score: written(score.false_a_minute, (1.0, ".1f", ""))),
    ("left behind", lambda score: f"{score.left_behind}"),
    ("joint error, cm", lambda score: written(score.joint_error_m, (100.0, ".1f", ""))),
    ("ms a frame", lambda score: written(score.step_s, (1000.0, ".1f", ""))),
)
"""Name and cell of each column."""
