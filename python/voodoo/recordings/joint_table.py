"""Reads .csv tables of joint positions: truth.csv and truth_people.csv."""

from __future__ import annotations

import csv
import io
import math
from pathlib import Path

import numpy as np

from voodoo.errors import RecordingError, reading
from voodoo.measurements import FloatArray
from voodoo.stored import read_stored_text


def read_positions(path: Path, first: tuple[str, ...]) -> tuple[tuple[str, ...], FloatArray]:
    """The names and cells (R, C) of a table whose columns are `first` and then NAME_x, NAME_y, NAME_z; NaN for empty cells.

    Raises:
        RecordingError: another header, a short row, a cell that is not a number.
    """
    with reading(path, "a table of joint positions"):
        rows = list(csv.reader(io.StringIO(read_stored_text(path, "a table of joint positions"))))
    if len(rows) < 2:
        raise RecordingError(f"{path}: expected a header and at least one row, found {len(rows)} lines")
    header = rows[0]
    names = tuple(cell.removesuffix("_x") for cell in header[len(first) :: 3])
    if header != [*first, *(f"{name}_{axis}" for name in names for axis in "xyz")] or len(set(names)) != len(names):
        expected = ", ".join((*first, "NAME_x", "NAME_y", "NAME_z", "..."))
        raise RecordingError(f"{path}: expected columns {expected}, found {header[: len(first) + 3]}...")
    table = np.empty((len(rows) - 1, len(header)))
    for index, row in enumerate(rows[1:]):
        where = f"{path}, line {index + 2}"
        if len(row) != len(header):
            raise RecordingError(f"{where}: expected {len(header)} cells, found {len(row)}")
        try:
            table[index] = [float(cell) if cell else math.nan for cell in row]
        except ValueError as error:
            raise RecordingError(f"{where}: expected numbers, found {error}") from error
    return names, table
