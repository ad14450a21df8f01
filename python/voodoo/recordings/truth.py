"""Reads truth.csv, truth_people.csv and init.json beside a recording: exact joint positions and the initial pose."""

from __future__ import annotations

import csv
import io
from array import array
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Annotated, TypeAlias

import numpy as np
from pydantic import BaseModel, Field, FiniteFloat

from voodoo.errors import RecordingError, columns_in, reading
from voodoo.measurements import ROUNDED_S, FloatArray
from voodoo.model.joint import valid
from voodoo.model.projection import transform
from voodoo.recordings.left_out import LeftOut
from voodoo.recordings.people_truth import PeopleTruth
from voodoo.recordings.recording import Recording, Reference, Start
from voodoo.stored import MOST_BYTES, MOST_METADATA, numbers_in, read_stored_text

OWN_ROOTS = ("base_link", "world")
"""The default root frame of a recording is the first of these in its transforms; the files are in it."""
STILL_FRAMES = ("odom", "map")
"""Fixed frames of a moving robot (REP-105): the first is smooth but drifts, the second has no drift but jumps."""
TRUTH_FILE, PEOPLE_TRUTH_FILE = "truth.csv", "truth_people.csv"
_FIRST = ("stamp_s", "person", "in_view")
_LAST = np.iinfo(np.int32).max

RootFromTruth: TypeAlias = Callable[[float], FloatArray]
"""(4, 4) from the frame of truth.csv to the root frame at a stamp [s]."""
RootFromStart: TypeAlias = Callable[[str | None], FloatArray]
"""(4, 4) from the frame named in init.json, or that of truth.csv, to the root frame."""


class FirstPose(BaseModel):
    """The entries of init.json that pose and size a body, see `voodoo.pipeline.start.Init`."""

    height_m: Annotated[FiniteFloat, Field(gt=0.3, lt=3.0)] | None = None
    frame: str | None = None
    joints: Annotated[dict[str, tuple[FiniteFloat, FiniteFloat, FiniteFloat]], Field(min_length=1)]
    stamp_s: FiniteFloat | None = None

    def moved(self, pose: FloatArray) -> dict[str, tuple[float, float, float]]:
        """The joints in another frame, by the transform (4, 4) to it."""
        places = {name: (pose[:3, :3] @ place + pose[:3, 3]).tolist() for name, place in self.joints.items()}
        return {name: (x, y, z) for name, (x, y, z) in places.items()}


def find_beside(bag: Path, name: str) -> Path | None:
    """`name` in the bag's folder or in the folder above, or None."""
    folder = bag if bag.is_dir() else bag.parent
    for candidate in (folder / name, folder.parent / name):
        if candidate.is_file():
            return candidate
    return None


def read_positions(path: Path, first: tuple[str, ...]) -> tuple[tuple[str, ...], FloatArray]:
    """The names and cells (R, C) of a table whose columns are `first` and then NAME_x, NAME_y, NAME_z; NaN for empty cells.

    Raises:
        RecordingError: another header, a short row, a cell that is not a number.
    """
    text = read_stored_text(path, "a table of joint positions")
    with reading(path, "a table of joint positions"):
        rows = csv.reader(io.StringIO(text))
        header = next(rows, [])
        names = tuple(cell.removesuffix("_x") for cell in header[len(first) :: 3])
        if header != [*first, *(f"{name}_{axis}" for name in names for axis in "xyz")] or len(set(names)) != len(names):
            expected = ", ".join((*first, "NAME_x", "NAME_y", "NAME_z", "..."))
            raise RecordingError(f"{path}: expected columns {expected}, found {columns_in(header)}")
        cells = array("d")  # a list takes thirty times the size of the file
        for line, row in enumerate(rows, start=2):
            if len(row) != len(header):
                raise RecordingError(f"{path}, line {line}: expected {len(header)} cells, found {len(row)}")
            cells.extend(numbers_in(f"{path}, line {line}", row))
    if not cells:
        raise RecordingError(f"{path}: expected a header and at least one row, found {int(bool(header))} lines")
    return names, np.array(cells).reshape(-1, len(header))


def read_beside(
    recording: Recording,
    find: Callable[[str], Path | None],
    *,
    root: str,
    first: float,
    left_out: LeftOut | None = None,
) -> None:
    """Set the reference, the persons and the start of a recording by the files beside it.

    Args:
        recording: the recording.
        find: returns the file of a name, or None.
        root: the frame of the files, unless init.json names another one.
        first: stamp of the first frame [s].
        left_out: of the recording; with it, a file that does not fit is only noted.

    Raises:
        RecordingError: a file that cannot be used.
    """
    own = partial(recording.root_from, root)
    for name in (TRUTH_FILE, PEOPLE_TRUTH_FILE, "init.json"):
        file = find(name)
        try:
            if file is not None and name == TRUTH_FILE:
                recording.reference = read_truth(file, own)
            elif file is not None and name == PEOPLE_TRUTH_FILE:
                recording.people = read_people_truth(file, own)
            elif file is not None:
                recording.start = read_start(file, lambda frame: recording.root_from(frame or root, first), first=first)
        except RecordingError as error:
            if left_out is None:
                raise
            recording.assumed = (*recording.assumed, f"{file} is not used: {error}")


def read_truth(path: Path, root_from_truth: RootFromTruth) -> Reference:
    """Read a truth.csv: stamp_s, then NAME_x,NAME_y,NAME_z [m] in the recording's own root frame; empty cells are missing joints.

    Raises:
        RecordingError: another header, a short row, a cell that is not a number, stamps that do not increase.
    """
    names, table = read_positions(path, ("stamp_s",))
    stamps = table[:, 0]
    if not np.isfinite(stamps).all() or (np.diff(stamps) <= 0.0).any() or np.isinf(table).any():
        raise RecordingError(f"{path}: expected rising stamps and finite positions, found others")
    positions = table[:, 1:].reshape(len(table), len(names), 3)
    for index, stamp in enumerate(stamps):
        positions[index] = transform(root_from_truth(float(stamp)), positions[index])
    return Reference(stamps, names, positions, exact=True)


def read_people_truth(path: Path, root_from_truth: RootFromTruth) -> PeopleTruth:
    """Read a truth_people.csv: stamp_s, person, in_view, then NAME_x,NAME_y,NAME_z [m] in base_link.

    Args:
        path: the file.
        root_from_truth: (4, 4) root_from_base_link at a stamp [s].

    Raises:
        RecordingError: another header, a short row, a cell that is not a number, or two rows of a person at one stamp.
    """
    names, table = read_positions(path, _FIRST)
    if not names:
        raise RecordingError(f"{path}: expected joints, NAME_x, NAME_y, NAME_z, found none")
    numbers = table[:, 1]
    if not np.isfinite(table).all() or not ((numbers >= 1) & (numbers <= _LAST) & (numbers % 1.0 == 0.0)).all():
        raise RecordingError(f"{path}: expected finite numbers and persons from 1, found others")
    stamps, frame = np.unique(table[:, 0], return_inverse=True)
    persons, column = np.unique(numbers.astype(np.int64), return_inverse=True)
    if len(np.unique(frame * len(persons) + column)) != len(table):
        raise RecordingError(f"{path}: expected one row for a person and stamp, found several")
    if len(stamps) * len(persons) * len(names) * 24 > MOST_BYTES:
        raise RecordingError(
            f"{path}: expected people who are there together, found {len(persons)} at {len(stamps)} stamps"
        )
    in_view = np.zeros((len(stamps), len(persons)))
    in_view[frame, column] = table[:, 2]
    positions = np.full((len(stamps), len(persons), len(names), 3), np.nan)
    positions[frame, column] = table[:, 3:].reshape(len(table), len(names), 3)
    for index, stamp in enumerate(stamps):
        positions[index] = transform(root_from_truth(float(stamp)), positions[index])
    return PeopleTruth(stamps, persons, in_view, names, positions)


def read_start(path: Path, root_from: RootFromStart, *, first: float) -> Start:
    """Read an init.json: {"height_m": stature, "frame": name, "joints": {name: [x, y, z]}}; height and frame are optional.

    Raises:
        RecordingError: not JSON, another format, a frame without a transform, or a pose of a later time than `first` [s].
    """
    content = read_stored_text(path, "a JSON file", most=MOST_METADATA)
    with valid(path, RecordingError, most=1):
        written = FirstPose.model_validate_json(content, strict=True)
    if written.stamp_s is not None and written.stamp_s > first + ROUNDED_S:
        raise RecordingError(
            f"{path}: expected the pose in the first frame, at {first:.6f} s, found one at {written.stamp_s:.6f} s; --init FILE "
            "takes it"
        )
    start = Start(joints=written.moved(root_from(written.frame)))
    if written.height_m is not None:
        start["height_m"] = written.height_m
    return start
