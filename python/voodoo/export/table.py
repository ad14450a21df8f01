"""A result as named arrays with a row for every person in a frame, and its files: .csv and .npz."""

from __future__ import annotations

import csv
import zipfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from math import isnan
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from voodoo.errors import VoodooError, a_path, columns_in, naming, reading
from voodoo.measurements import FloatArray
from voodoo.stored import MOST_RECORDED, check_stored, numbers_in
from voodoo.unpacking import stored_arrays
from voodoo.whole import appearing_whole

SUFFIXES = (".csv", ".npz")


def check_suffix(path: Path) -> None:
    """Refuse result files that are neither .csv nor .npz.

    Raises:
        VoodooError: names both.
    """
    if path.suffix not in SUFFIXES:
        raise VoodooError(f"{path}: expected a name that ends in {' or '.join(SUFFIXES)}, found {path.suffix!r}")


Arrays: TypeAlias = Mapping[str, npt.NDArray[Any]]
"""Arrays of a result, or of a part of it, by the names of docs/reference/files.md#results."""

BY_FRAME = ("stamps", "residual", "joints", "world_from_limb", "angles", "angle_sigma", "covariance", "root_covariance")
"""Arrays of numbers with a row each."""
_BY_ROW = (*BY_FRAME, "status", "limb_status", "person", "frame_stamps")
"""Arrays that are concatenated."""
BODIES, BODY_OF = "bodies", "body_of"
"""Arrays of a part that a result does not have: bodies as text, and their persons."""
_FIRST = ("stamp_s", "person", "status", "residual_m")
"""The first columns of .csv."""
_STATUS = "_status"
"""Suffix of the name of a limb's column in .csv."""
_STATUSES = ("tracking", "degraded", "lost", "searching")
_EXPECTED = "a result of voodoo track"


def save_result(path: str | Path, parts: Callable[[], Iterator[Arrays]], fixed: Arrays | None = None) -> None:
    """Write consecutive parts of a result as .csv or .npz; a part is in memory at a time. The file appears when it is complete.

    Args:
        path: the file.
        parts: returns their arrays, from the first part on.
        fixed: arrays of the whole result, in place of those of its parts; not in .csv.

    Raises:
        VoodooError: another suffix.
        OSError: the file cannot be written.
    """
    path = Path(path)
    check_suffix(path)
    with appearing_whole(path) as place:
        if path.suffix == ".csv":
            _write_csv(place, parts)
        else:
            _write_arrays(place, parts, fixed or {})


@contextmanager
def opened_result(path: str | Path) -> Iterator[Arrays]:
    """The arrays in a .csv or .npz of voodoo, or in a .csv of any program, with _FIRST, NAME_x, NAME_y, NAME_z, then NAME_rad.

    Empty cells are NaN. A .csv has no poses of limbs and no covariances, and of other columns only those of limbs are read.

    Raises:
        VoodooError: another suffix, damage, a file of another kind, or an error raised in the block; names the file.
    """
    path = a_path(path, error=VoodooError)
    check_suffix(path)
    if path.suffix == ".npz":
        with stored_arrays(path, _EXPECTED) as content, naming(path, VoodooError):
            yield content
        return
    check_stored(path, _EXPECTED, most=MOST_RECORDED)
    with reading(path, _EXPECTED), naming(path, VoodooError):
        yield _read_csv(path)


def columns_of(rows: Arrays, *, sure: bool) -> dict[str, npt.NDArray[Any]]:
    """The columns of .csv, by name; `sure`: with standard deviations."""
    names, count = rows["joint_names"].tolist(), len(rows["stamps"])
    numbers = [rows["residual"], *rows["joints"].reshape(count, 3 * len(names)).T, *rows["angles"].T]
    columns = [rows["stamps"], rows["person"], rows["status"], *numbers, *rows["limb_status"].T]
    header = _header(names, rows["angle_names"].tolist())
    header += [f"{limb}{_STATUS}" for limb in rows["limb_status_names"].tolist()]
    if sure:
        sigmas = joint_sigma(rows["covariance"])
        columns += [*(sigmas if sigmas.size else np.full((count, len(names)), np.nan)).T]
        header += [f"{name}_sigma_m" for name in names]
    return dict(zip(header, columns, strict=True))


def _write_csv(path: Path, parts: Callable[[], Iterator[Arrays]]) -> None:
    """Rows with positions to 1 um; names are those of the first part that has rows."""
    sure = any(part["covariance"].size for part in parts())
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        header: Sequence[str] = ()
        for part in parts():
            columns = columns_of(part, sure=sure)
            if not header and len(part["stamps"]):
                header = list(columns)
                writer.writerow(header)
            texts = {name: cells(one) if one.dtype.kind == "f" else one.tolist() for name, one in columns.items()}
            # repr keeps stamps in epoch seconds exact; six digits of a meter are enough for the rest.
            texts["stamp_s"] = [repr(stamp) for stamp in part["stamps"].tolist()]
            writer.writerows(zip(*texts.values(), strict=True))
        if not header:
            writer.writerow(_FIRST)


def joint_sigma(covariance: FloatArray) -> FloatArray:
    """Root mean square (R, J) of the standard deviations of x, y and z [m], from covariances (R, J, 3, 3) [m^2]."""
    return np.asarray(np.sqrt(np.trace(covariance, axis1=2, axis2=3) / 3.0))


def cells(values: Iterable[float]) -> list[str]:
    """Texts of numbers; empty if unknown."""
    return ["" if isnan(value) else f"{value:.6f}" for value in values]


def _header(names: Sequence[str], angle_names: Sequence[str]) -> list[str]:
    return [*_FIRST, *(f"{name}_{axis}" for name in names for axis in "xyz"), *(f"{name}_rad" for name in angle_names)]


def _read_csv(path: Path) -> Arrays:
    with path.open(newline="", encoding="utf-8-sig") as file:
        header, *lines = list(csv.reader(file)) or [[]]
    if header[:2] == ["stamp_s", "status"]:  # earlier versions wrote one person without this column
        header.insert(1, "person")
        for line in lines:
            line.insert(1, "1")
    at, first = _FIRST.index("status"), len(_FIRST)
    end = first
    while end + 3 <= len(header) and header[end : end + 3] == [f"{header[end][:-2]}_{axis}" for axis in "xyz"]:
        end += 3
    last = next((i for i in range(end, len(header)) if not header[i].endswith("_rad")), len(header))
    names = [cell.removesuffix("_x") for cell in header[first:end:3]]
    angle_names = [cell.removesuffix("_rad") for cell in header[end:last]]
    if header[:last] != _header(names, angle_names) or len(set(header)) != len(header):
        raise VoodooError(f"expected columns {', '.join(_FIRST)}, NAME_x, ..., found {columns_in(header)}")
    table = np.full((len(lines), last), np.nan)
    for number, (line, row) in enumerate(zip(lines, table, strict=True), start=2):
        if len(line) != len(header):
            raise VoodooError(f"line {number}: expected {len(header)} cells, found {len(line)}")
        if line[at] not in _STATUSES:
            raise VoodooError(f"line {number}: status: expected one of {', '.join(_STATUSES)}, found {line[at]!r}")
        row[:] = numbers_in(f"line {number}", (*line[:at], "", *line[at + 1 : last]))
        if not (row[1] >= 1.0 and row[1] % 1.0 == 0.0):
            raise VoodooError(f"line {number}: person: expected an integer from 1, found {row[1]:g}")
    if not np.isfinite(table[:, 0]).all() or np.isinf(table).any():
        raise VoodooError("expected finite stamps, and finite numbers or empty cells, found others")
    limbs = [index for index in range(last, len(header)) if header[index].endswith(_STATUS)]
    words = np.array([[line[index] for index in (at, *limbs)] for line in lines], dtype=object)
    words = words.reshape(len(lines), 1 + len(limbs))
    stamps, persons = table[:, 0], table[:, 1].astype(np.int64)
    return {
        "stamps": stamps,
        "frame_stamps": np.unique(stamps) if len(np.unique(persons)) > 1 else stamps,
        "person": persons,
        "status": words[:, 0],
        "residual": table[:, 3],
        "joint_names": np.array(names, dtype=object),
        "joints": table[:, first:end].reshape(len(lines), len(names), 3),
        "limb_names": np.empty(0, dtype=object),
        "world_from_limb": np.empty((len(lines), 0, 4, 4)),
        "angle_names": np.array(angle_names, dtype=object),
        "angles": table[:, end:],
        "limb_status_names": np.array([header[index].removesuffix(_STATUS) for index in limbs], dtype=object),
        "limb_status": words[:, 1:],
    }


def _write_arrays(path: Path, parts: Callable[[], Iterator[Arrays]], fixed: Arrays) -> None:
    kinds: dict[str, tuple[int, tuple[int, ...], np.dtype[Any]]] = {}
    rest: dict[str, npt.NDArray[Any]] = {}
    for part in parts():
        for name in part:
            if name in _BY_ROW:
                array = part[name]
                count, row, kind = kinds.get(name, (0, array.shape[1:], array.dtype))
                # Without covariances, or without persons, there are no columns.
                kinds[name] = count + len(array), max(row, array.shape[1:]), np.result_type(kind, array.dtype)
            elif name not in (BODIES, BODY_OF) and not rest.get(name, np.empty(0)).size:
                rest[name] = part[name]
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        for name, array in {**rest, **fixed}.items():
            with file.open(f"{name}.npy", "w", force_zip64=True) as out:
                np.lib.format.write_array(out, array, allow_pickle=False)
        for name, (count, row, kind) in kinds.items():
            about = {"descr": np.lib.format.dtype_to_descr(kind), "fortran_order": False, "shape": (count, *row)}
            with file.open(f"{name}.npy", "w", force_zip64=True) as out:
                np.lib.format.write_array_header_1_0(out, about)
                for part in parts():
                    array = part[name]
                    filled = array if array.shape[1:] == row else np.full((len(array), *row), np.nan)
                    out.write(filled.astype(kind).tobytes())
