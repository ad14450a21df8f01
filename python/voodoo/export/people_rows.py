"""The .csv of several persons: one row for every person present in a frame."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from voodoo.errors import VoodooError, columns_in, reading
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
    with reading(path, "a result of voodoo track --people"), path.open(newline="", encoding="utf-8-sig") as file:
        header, *rows = list(csv.reader(file)) or [[]]
    first = next((i for i, cell in enumerate(header) if cell.endswith("_rad")), len(header))
    names = tuple(cell.removesuffix("_x") for cell in header[4:first:3])
    angle_names = tuple(cell.removesuffix("_rad") for cell in header[first:])
    if header != header_of(names, angle_names):
        raise VoodooError(f"{path}: expected columns {', '.join(FIRST)}, NAME_x, ..., found {columns_in(header)}")
    table = np.full((len(rows), len(header)), np.nan)
    for index, row in enumerate(rows):
        where = f"{path}, line {index + 2}"
        if len(row) != len(header):
            raise VoodooError(f"{where}: expected {len(header)} cells, found {len(row)}")
        if row[2] not in STATUSES:
            raise VoodooError(f"{where}: status: expected one of {', '.join(STATUSES)}, found {row[2]!r}")
        try:
            table[index] = [float(cell or "nan") for cell in (*row[:2], "", *row[3:])]
        except ValueError as error:
            raise VoodooError(f"{where}: expected numbers, found {error}") from error
    _check(path, table)
    return PeopleRows(
        stamps=table[:, 0],
        persons=table[:, 1].astype(np.int64),
        status=tuple(row[2] for row in rows),
        residual=table[:, 3],
        joint_names=names,
        joints=table[:, 4:first].reshape(len(rows), len(names), 3),
        angle_names=angle_names,
        angles=table[:, first:],
    )


def _check(path: Path, table: FloatArray) -> None:
    """Reject rows (N, columns) that are not a consistent result."""
    stamps, persons = table[:, 0], table[:, 1]
    if not np.isfinite(stamps).all() or (np.diff(stamps) < 0.0).any():
        raise VoodooError(f"{path}: stamp_s: expected finite numbers that do not fall, found others")
    wrong = ~((persons >= 1) & (persons % 1.0 == 0.0))
    if wrong.any():
        line = int(np.flatnonzero(wrong)[0]) + 2
        raise VoodooError(f"{path}, line {line}: person: expected an integer from 1, found {persons[line - 2]:g}")
    if len(np.unique(table[:, :2], axis=0)) != len(table):
        raise VoodooError(f"{path}: expected one row for a person and stamp, found several")
    if np.isinf(table).any():
        raise VoodooError(f"{path}: expected finite numbers or empty cells, found others")


def write_rows(path: Path, parts: Iterable[PeopleRows]) -> None:
    """Write consecutive rows, positions to 1 um; names are those of the first part that has rows."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        header: list[str] = []
        for rows in parts:
            if not header and len(rows):
                header = header_of(rows.joint_names, rows.angle_names)
                writer.writerow(header)
            writer.writerows(_cells(rows))
        if not header:
            writer.writerow(header_of((), ()))


def _cells(rows: PeopleRows) -> Iterable[list[str]]:
    columns = (rows.stamps, rows.persons, rows.status, rows.residual, rows.joints, rows.angles)
    for stamp, person, status, residual, joints, angles in zip(*columns, strict=True):
        # repr keeps stamps in epoch seconds exact; six digits of a meter are enough for the rest.
        numbers = ["" if np.isnan(value) else f"{value:.6f}" for value in (residual, *joints.ravel(), *angles)]
        yield [repr(float(stamp)), str(int(person)), status, *numbers]


def header_of(names: Sequence[str], angle_names: Sequence[str]) -> list[str]:
    """The columns of such a file."""
    places = [f"{name}_{axis}" for name in names for axis in "xyz"]
    return [*FIRST, *places, *(f"{name}_rad" for name in angle_names)]


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
