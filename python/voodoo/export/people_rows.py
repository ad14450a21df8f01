"""The .csv of several persons: one row for every person present in a frame."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from voodoo.errors import VoodooError, columns_in, naming, reading
from voodoo.stored import MOST_RECORDED, check_stored
from voodoo.unpacking import stored_arrays

FloatArray: TypeAlias = npt.NDArray[np.float64]

FIRST = ("stamp_s", "person", "status", "residual_m")
"""The first columns, which distinguish such a file from the result of one person."""
STATUSES = ("tracking", "degraded", "lost", "searching")


@dataclass(frozen=True, eq=False, repr=False)
class PeopleRows:
    """R rows of a result of several people, in the order of their stamps.

    Args:
        stamps: (R,) [s].
        persons: (R,) ids from 1.
        status: R words.
        residual: (R,) [m]; NaN = not known.
        joint_names: J names of joints and sites.
        joints: (R, J, 3) [m] in the recording's root frame; NaN = no pose.
        angle_names: A names of joint angles.
        angles: (R, A) [rad].
    """

    stamps: FloatArray
    persons: npt.NDArray[np.int64]
    status: tuple[str, ...]
    residual: FloatArray
    joint_names: tuple[str, ...]
    joints: FloatArray
    angle_names: tuple[str, ...]
    angles: FloatArray

    def __len__(self) -> int:
        """Number of rows."""
        return len(self.stamps)

    def __repr__(self) -> str:
        """One line with the counts."""
        return f"PeopleRows({len(self)} rows, {len(set(self.persons.tolist()))} persons)"

    def of(self, name: str) -> FloatArray:
        """Positions (R, 3) [m] of a site; NaN where it is missing."""
        if name not in self.joint_names:
            return np.full((len(self), 3), np.nan)
        return np.asarray(self.joints[:, self.joint_names.index(name)])


def read_rows(path: Path) -> PeopleRows:
    """Read a result of several persons, written by any program: the columns of FIRST, then NAME_x, NAME_y, NAME_z, then NAME_rad.

    Empty cells are unknown values.

    Raises:
        VoodooError: another header, an invalid cell, decreasing stamps, or two rows of a person at one stamp.
    """
    check_stored(path, "a result of voodoo track --people", most=MOST_RECORDED)
    with reading(path, "a result of voodoo track --people"), naming(path, VoodooError):
        return read_cells(path, FIRST)[0]


def read_cells(
    path: Path, first: Sequence[str], *, more: bool = False
) -> tuple[PeopleRows, dict[str, tuple[str, ...]]]:
    """Read the rows of one person or several; see `header_of`.

    Args:
        path: the file.
        first: the first columns.
        more: whether other columns may follow.

    Returns:
        The rows, without the column `person` all of person 1; and the words in each of the other columns.

    Raises:
        VoodooError: see `read_rows`; without the name of the file.
    """
    with path.open(newline="", encoding="utf-8-sig") as file:
        header, *lines = list(csv.reader(file)) or [[]]
    at, end = first.index("status"), len(first)
    while end + 3 <= len(header) and header[end : end + 3] == [f"{header[end][:-2]}_{axis}" for axis in "xyz"]:
        end += 3
    last = next((i for i in range(end, len(header)) if not header[i].endswith("_rad")), len(header))
    names = tuple(cell.removesuffix("_x") for cell in header[len(first) : end : 3])
    angle_names = tuple(cell.removesuffix("_rad") for cell in header[end:last])
    known = header if not more else header[:last]
    if known != header_of(first, names, angle_names) or len(set(header)) != len(header):
        raise VoodooError(f"expected columns {', '.join(first)}, NAME_x, ..., found {columns_in(header)}")
    table = np.full((len(lines), last), np.nan)
    for number, (line, row) in enumerate(zip(lines, table, strict=True), start=2):
        if len(line) != len(header):
            raise VoodooError(f"line {number}: expected {len(header)} cells, found {len(line)}")
        try:
            row[:] = [float(cell or "nan") for cell in (*line[:at], "", *line[at + 1 : last])]
        except ValueError as error:
            raise VoodooError(f"line {number}: expected numbers, found {error}") from error
    status, persons = tuple(line[at] for line in lines), np.ones(len(lines), dtype=np.int64)
    if "person" in first:
        _check(table, status)
        persons = table[:, first.index("person")].astype(np.int64)
    rows = PeopleRows(
        stamps=table[:, 0],
        persons=persons,
        status=status,
        residual=table[:, len(first) - 1],
        joint_names=names,
        joints=table[:, len(first) : end].reshape(len(lines), len(names), 3),
        angle_names=angle_names,
        angles=table[:, end:],
    )
    return rows, {header[i]: tuple(line[i] for line in lines) for i in range(last, len(header))}


def _check(table: FloatArray, status: Sequence[str]) -> None:
    """Reject rows (N, columns) that are not a consistent result."""
    if unknown := [index for index, word in enumerate(status) if word not in STATUSES]:
        expected = f"status: expected one of {', '.join(STATUSES)}, found {status[unknown[0]]!r}"
        raise VoodooError(f"line {unknown[0] + 2}: {expected}")
    stamps, persons = table[:, 0], table[:, 1]
    if not np.isfinite(stamps).all() or (np.diff(stamps) < 0.0).any():
        raise VoodooError("stamp_s: expected finite numbers that do not fall, found others")
    wrong = ~((persons >= 1) & (persons % 1.0 == 0.0))
    if wrong.any():
        line = int(np.flatnonzero(wrong)[0]) + 2
        raise VoodooError(f"line {line}: person: expected an integer from 1, found {persons[line - 2]:g}")
    if len(np.unique(table[:, :2], axis=0)) != len(table):
        raise VoodooError("expected one row for a person and stamp, found several")
    if np.isinf(table).any():
        raise VoodooError("expected finite numbers or empty cells, found others")


def write_rows(path: Path, parts: Iterable[PeopleRows]) -> None:
    """Write consecutive rows, positions to 1 um; names are those of the first part that has rows."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        header: list[str] = []
        for rows in parts:
            if not header and len(rows):
                header = header_of(FIRST, rows.joint_names, rows.angle_names)
                writer.writerow(header)
            writer.writerows(_cells(rows))
        if not header:
            writer.writerow(header_of(FIRST, (), ()))


def _cells(rows: PeopleRows) -> Iterable[list[str]]:
    columns = (rows.stamps, rows.persons, rows.status, rows.residual, rows.joints, rows.angles)
    for stamp, person, status, residual, joints, angles in zip(*columns, strict=True):
        # repr keeps stamps in epoch seconds exact; six digits of a meter are enough for the rest.
        yield [repr(float(stamp)), str(int(person)), status, *cells((residual, *joints.ravel(), *angles))]


def cells(values: Iterable[float]) -> list[str]:
    """Texts of numbers; empty if unknown."""
    return ["" if np.isnan(value) else f"{value:.6f}" for value in values]


def header_of(first: Sequence[str], names: Sequence[str], angle_names: Sequence[str]) -> list[str]:
    """The columns of a result: the first ones, those of joints, those of joint angles."""
    places = [f"{name}_{axis}" for name in names for axis in "xyz"]
    return [*first, *places, *(f"{name}_rad" for name in angle_names)]


def is_people_file(path: Path) -> bool:
    """Whether a .csv begins like the result of several people, or an .npz holds one."""
    if path.suffix == ".npz":
        with stored_arrays(path, "a result of voodoo track") as content:
            return "persons" in content
    check_stored(path, "a result of voodoo track", most=MOST_RECORDED)
    try:
        with path.open(encoding="utf-8-sig") as file:
            return file.readline().startswith(",".join(FIRST[:2]) + ",")
    except (OSError, UnicodeDecodeError):
        return False
