"""Reads .csv tables of joint positions: truth.csv and truth_people.csv."""

from __future__ import annotations

import csv
import io
import math
from array import array
from pathlib import Path

import numpy as np

from voodoo.errors import RecordingError, columns_in, reading
from voodoo.measurements import FloatArray
from voodoo.stored import read_stored_text


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
            try:
                cells.extend(float(cell) if cell else math.nan for cell in row)
            except ValueError as error:
                raise RecordingError(f"{path}, line {line}: expected numbers, found {error}") from error
    if not cells:
        raise RecordingError(f"{path}: expected a header and at least one row, found {int(bool(header))} lines")
    return names, np.array(cells).reshape(-1, len(header))
