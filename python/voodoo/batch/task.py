"""Task of a worker: track one recording and write its Parquet table, with a row per frame and person."""

from __future__ import annotations

import faulthandler
import io
import json
import os
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

import numpy as np
import numpy.typing as npt

from voodoo.batch.storage import Store, on_disk
from voodoo.batch.summary import DONE, FAILED, REPORTS, Row
from voodoo.config import Config
from voodoo.errors import RecordingError, installed
from voodoo.evaluation import metrics
from voodoo.evaluation.evaluate import compare, use_one_thread
from voodoo.export.people import PeopleTrack
from voodoo.export.table import columns_of as columns_of_rows
from voodoo.export.track import Track
from voodoo.model.body import Body
from voodoo.people import PeopleEstimate, everybody
from voodoo.pipeline.inputs import pictures_alone
from voodoo.pipeline.inspection import inspect
from voodoo.pipeline.run import track
from voodoo.pipeline.start import AUTO, start_people, start_tracker
from voodoo.recordings.left_out import LeftOut, no_frame
from voodoo.recordings.loaders import open_recording
from voodoo.recordings.recording import Recording
from voodoo.sensors.settings import FrontEndSettings
from voodoo.visualization.report_page import report_page

Columns: TypeAlias = dict[str, npt.NDArray[Any]]

NOTE = b"voodoo"
"""Key in the metadata of the file; the value is JSON with the recording's summary row and the settings."""


def columns_of(tracks: Mapping[int, Track]) -> Columns:
    """The columns of all persons, sorted by time and person.

    `stamp_s` float64 [s], `person` int32, `status`, `residual_m`, NAME_x, NAME_y, NAME_z [m] and NAME_rad as float32 (a tenth of
    a millimeter at a kilometer), LIMB_status, and NAME_sigma_m as in a result's .csv. NaN and "" mean unknown.

    Args:
        tracks: of each person, from 1; with the same joints.
    """
    rows = PeopleTrack(np.empty(0), tracks).arrays()
    kinds = {"stamp_s": np.float64, "person": np.int32}
    return {
        name: column if column.dtype.kind == "U" else column.astype(kinds.get(name, np.float32))
        for name, column in columns_of_rows(rows, sure=rows["covariance"].size > 0).items()
    }


def encode(parts: Sequence[Columns], note: Mapping[str, Any]) -> bytes:
    """The bytes of a Parquet file of consecutive rows, with a note in its footer; a column that a part lacks is unknown there.

    Raises:
        VoodooError: pyarrow is not installed.
    """
    pa, pq = _pyarrow(), _pyarrow("pyarrow.parquet")

    def array(column: npt.NDArray[Any]) -> Any:  # noqa: ANN401 - it has no types
        if column.dtype.kind == "U":
            return pa.array([value or None for value in column.tolist()], pa.string())
        return pa.array(column, from_pandas=True)

    tables = [pa.table({name: array(column) for name, column in part.items()}) for part in parts or ({},)]
    table = pa.concat_tables(tables, promote_options="default").combine_chunks()
    words = [field.name for field in table.schema if pa.types.is_string(field.type)]
    out = io.BytesIO()
    # Neighboring frames have equal high bytes: splitting the numbers by byte improves compression.
    split = {name: "BYTE_STREAM_SPLIT" for name in table.column_names if name not in (*words, "person")}
    table = table.replace_schema_metadata({NOTE: json.dumps(note).encode()})
    pq.write_table(table, out, compression="zstd", use_dictionary=[*words, "person"], column_encoding=split)
    return out.getvalue()


def note_of(file: Any) -> dict[str, Any] | None:  # noqa: ANN401 - a binary file of any kind
    """The note in the footer of a Parquet file; None without one, or if the file is damaged."""
    pq = _pyarrow("pyarrow.parquet")
    try:
        found = json.loads(pq.read_metadata(file).metadata[NOTE])
    except Exception:  # a damaged file can cause any error in the reader; the file is written again
        return None
    return found if isinstance(found, dict) else None


def _pyarrow(module: str = "pyarrow") -> Any:  # noqa: ANN401 - it has no types
    return installed(module, "tables are written by pyarrow: pip install 'voodoo-tracker[batch]'")


T = TypeVar("T")
_TOGETHER = 500
"""Number of frames whose estimates are kept in memory."""
_GRACE_S = 10.0
"""Time after the limit at which a worker ends that does not return from a library [s]."""
_NOWHERE = Path(os.devnull).open("w")


@dataclass(frozen=True)
class Settings:
    """Settings for all recordings of a batch; see `voodoo track`.

    Args:
        use: kinds of inputs; None: the best ones for each recording.
        init: "auto": search for a person even if there is a start beside a recording; None: use that start.
        model, loader, options: see start_tracker and open_recording.
        people: 1: one person; a larger number: at most that many; None: any number.
        strict: a damaged recording fails; else unusable measurements are left out.
        config: parameters that differ from the defaults.
        version: version of voodoo.
    """

    use: tuple[str, ...] | None = None
    init: str | None = None
    model: str | None = None
    loader: str | None = None
    options: Mapping[str, Any] | None = None
    people: int | None = 1
    strict: bool = False
    config: Mapping[str, Any] | None = None
    version: str = ""

    def as_dict(self) -> dict[str, Any]:
        """The settings as JSON values."""
        found = {**vars(self), "use": None if self.use is None else list(self.use)}
        return {**found, "options": dict(self.options or {}), "config": dict(self.config or {})}


@dataclass(frozen=True)
class Job:
    """A recording to track: name, source, target of its table, settings, longest time [s], and whether a page shows it."""

    name: str
    source: str
    out: str
    settings: Settings
    limit_s: float | None = None
    report: bool = False


def do(job: Job) -> Row:
    """Track a recording and write its table, unless it exists; never raises.

    Raises:
        Nothing: errors are in the row.
    """
    began = time.perf_counter()
    use_one_thread()
    if job.limit_s is not None:  # for what cannot be interrupted; a part of the time is for what can
        faulthandler.dump_traceback_later(job.limit_s + _GRACE_S, exit=True, file=_NOWHERE)
    try:
        done = row_of(job)
        if done is not None:
            return done
        with on_disk(job.source) as path:
            row, columns = _track(job, path)
            row = replace(row, seconds=time.perf_counter() - began)
            note = {"row": dict(vars(row)), "settings": job.settings.as_dict()}
            Store(job.out).write(Store(job.out).place_of(job.name), encode(columns, note))
            return row
    except Exception as error:
        # An error in one recording must not affect the others.
        words = " ".join(str(error).split()) or "no further detail"
        text = words if isinstance(error, (ValueError, OSError)) else f"{type(error).__name__}: {words}"
        return failed(job, text, time.perf_counter() - began)
    finally:
        faulthandler.cancel_dump_traceback_later()


def failed(job: Job, why: str, seconds: float = float("nan")) -> Row:
    """The row of a recording that could not be tracked."""
    return Row(job.name, status=FAILED, error=why, seconds=seconds, source=job.source)


def row_of(job: Job) -> Row | None:
    """The row in the existing table of a recording, if it has the same source and settings; or None."""
    row = stored_row(job.out, job.name, job.settings)
    return row if row is not None and row.source == job.source else None


def stored_row(out: str, name: str, settings: Settings) -> Row | None:
    """The row in the footer of a table; None if it is not complete, or has other settings."""
    file = Store(out).opened(name)
    if file is None:
        return None
    with file:
        note = note_of(file)
    if note is None or note.get("settings") != settings.as_dict():
        return None
    try:
        row = Row.of(note["row"])
    except (KeyError, TypeError, ValueError, AttributeError):
        return None
    return row if row.status == DONE else None


def _track(job: Job, path: Path) -> tuple[Row, list[Columns]]:
    chosen = job.settings
    left_out = None if chosen.strict else LeftOut()
    options = {"loader": chosen.loader, **(chosen.options or {})} | pictures_alone(path, chosen.loader, chosen.use)
    recording = open_recording(path, left_out=left_out, bare=False, **options)
    doubts = inspect(recording, left_out=left_out).doubts
    settings = FrontEndSettings.of(recording, use=chosen.use)
    config = Config(**dict(chosen.config or {}))
    one_only = chosen.people == 1
    columns: list[Columns] = []
    found: dict[int, list[Track]] = {}
    for part in _tracks(job, recording, settings, config, left_out):
        columns.append(columns_of(part))
        for one, own in part.items():
            found.setdefault(one, []).append(own if job.report else joined([own]))  # what only a page shows is large
    if one_only and not columns:
        raise RecordingError(no_frame(job.source, left_out))
    if job.report:
        counts = {} if left_out is None else left_out.counts
        by_person = {f"person {one}": replace(Track.joined(own), left_out=counts) for one, own in found.items()}
        Store(job.out).write(f"{REPORTS}/{job.name}.html", report_page(job.name, by_person).encode())
    tracks = {one: joined(own) for one, own in found.items()}
    error = _error(recording, tracks[1]) if one_only else float("nan")
    words = [word for one in tracks.values() for word in one.status]
    row = Row(
        recording=job.name,
        frames=len(words),
        recorded_s=recording.info().duration,
        persons=sum(bool(one.found.any()) for one in tracks.values()),
        tracking_share=float(np.mean([word in ("tracking", "degraded") for word in words])) if words else float("nan"),
        joint_error_m=error,
        left_out=0 if left_out is None else len(left_out),
        source=job.source,
        doubts="; ".join(doubts),
    )
    return row, columns


def _tracks(
    job: Job, recording: Recording, settings: FrontEndSettings, config: Config, left_out: LeftOut | None
) -> Iterator[Mapping[int, Track]]:
    """The tracks of all persons, part by part."""
    chosen = job.settings
    bodies: dict[int, Body] = {}
    tracker: Any
    how: dict[str, Any] = {"model": chosen.model, "config": config, "use": chosen.use}
    if chosen.people == 1:
        tracker = start_tracker(recording, init=AUTO if chosen.init == AUTO else None, **how)
    else:
        tracker = start_people(recording, limit=chosen.people, **how)

    def estimates() -> Iterator[PeopleEstimate]:
        for step in track(recording, tracker, settings=settings, left_out=left_out):
            bodies.update(step.front_end.bodies)
            yield everybody(step.estimate)

    for part in _parts(estimates(), job.limit_s):
        yield PeopleTrack.of(part, bodies=bodies).tracks


def _parts(items: Iterable[T], limit_s: float | None) -> Iterator[list[T]]:
    """Yields lists of limited length, because the estimates of hours would fill the memory.

    Raises:
        RecordingError: they take longer than a limit [s].
    """
    began = time.monotonic()
    part: list[T] = []
    for item in items:
        part.append(item)
        if limit_s is not None and time.monotonic() - began > limit_s:
            raise RecordingError(f"expected to be tracked in {limit_s:g} s, the time limit, found it to take longer")
        if len(part) == _TOGETHER:
            yield part
            part = []
    if part:
        yield part


def joined(parts: Sequence[Track]) -> Track:
    """Concatenates tracks of one body; limbs and joint angles are left out."""
    return Track.joined(
        [Track(p.stamps, p.status, p.residual, p.joint_names, p.joints, (), np.empty((len(p), 0, 4, 4))) for p in parts]
    )


def _error(recording: Recording, result: Track) -> float:
    """Mean error of the twelve joints [m]: at lag 0 against exact truth, at the best lag against a reference; NaN without."""
    if recording.reference is None:
        return float("nan")
    return metrics.mean_or_nan(compare(recording, result, at_best_lag=not recording.reference.exact))
