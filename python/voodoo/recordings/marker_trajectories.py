"""Markers and magnetic trackers: named 3-D points over time from .trc and .c3d files, on sites or with an offset on a
limb."""

from __future__ import annotations

import io
import math
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from voodoo.errors import RecordingError, reading, shortened
from voodoo.measurements import FloatArray
from voodoo.model.rotations import axes
from voodoo.stored import numbers_in, read_stored, read_stored_text

Z_UP_FROM_Y_UP = axes("z x y")
"""Rotation from OpenSim's axes (X forward, Y up, Z to the right) to REP-103's order of axes (Z up): (x, y, z) = (Z,
X, Y).

This is Pose2Sim's convention; it preserves handedness, but not the direction in which a person faces."""

Z_UP_FROM: dict[str, FloatArray] = {
    "+X": axes("y z x"),
    "+Y": Z_UP_FROM_Y_UP,
    "+Z": axes("x y z"),
    "-X": axes("y -z -x"),
    "-Y": axes("-z x -y"),
    "-Z": axes("x -y -z"),
}
"""Axis of a file that points up -> rotation to z up."""

_METERS = {"m": 1.0, "dm": 0.1, "cm": 0.01, "mm": 0.001}
_SPELLED = {"milli": "mm", "centi": "cm", "deci": "dm", "": "m"}


@dataclass(frozen=True, eq=False, repr=False)
class MarkerTrajectories:
    """Positions of M named points at F times.

    Args:
        stamps: (F,) [s].
        names: M names as in the file.
        positions: (F, M, 3) [m]; NaN = missing, as are empty cells and exact zeros of the file.
        rate_hz: nominal rate [Hz].
        up: the axis that points up, a key of Z_UP_FROM, if the file says so.
        right: the horizontal axis to the right of its screen, if the file says so.
        remarks: what is unusual about the file.
        first: number of the original data's frame, from 0, that is the first one here, if the file says so.
    """

    stamps: FloatArray
    names: tuple[str, ...]
    positions: FloatArray
    rate_hz: float
    up: str | None = None
    right: str | None = None
    remarks: tuple[str, ...] = ()
    first: int = 0

    def __repr__(self) -> str:
        """Counts and rate."""
        return f"MarkerTrajectories({len(self.stamps)} frames, {len(self.names)} markers, {self.rate_hz:g} Hz)"

    def of(self, names: Mapping[str, str]) -> tuple[tuple[str, ...], FloatArray]:
        """Select the markers that correspond to sites.

        Args:
            names: marker name -> site name.

        Returns:
            Names and positions (F, N, 3) of the sites whose markers are in the file.
        """
        kept = [(index, names[name]) for index, name in enumerate(self.names) if name in names]
        return tuple(site for _, site in kept), self.positions[:, [index for index, _ in kept]]


def read_markers(path: str | Path) -> MarkerTrajectories:
    """Read a .trc or .c3d file, selected by the suffix; see `read_trc` and `read_c3d`.

    Raises:
        RecordingError: another suffix, damage, or another format.
    """
    suffix, readers = Path(path).suffix.lower(), {".trc": read_trc, ".c3d": read_c3d}
    if suffix not in readers:
        raise RecordingError(f"{path}: expected a .trc or .c3d file, found {suffix or 'no suffix'!r}")
    return readers[suffix](path)


def read_trc(path: str | Path) -> MarkerTrajectories:
    """Read a .trc file (OpenSim, Motion Analysis).

    Args:
        path: the file: two header lines with values, two lines of column names, then frames, in columns that are separated by
            tabs, commas or spaces. Between tabs, numbers may have decimal commas.

    Raises:
        RecordingError: another format; names the line.
    """
    path = Path(path)
    lines = read_stored_text(path, "a .trc file").splitlines()
    if len(lines) < 6 or not lines[0].startswith("PathFileType"):
        raise RecordingError(f"{path}: expected a .trc file (PathFileType ... in the first line), found another")
    separator = next((mark for mark in ("\t", ",") if mark in lines[1]), None)

    def cells_of(line: str) -> list[str]:
        cells = [cell.strip() for cell in line.split(separator)]
        return [cell.replace(",", ".") for cell in cells] if separator == "\t" else cells

    header = dict(zip(cells_of(lines[1]), cells_of(lines[2]), strict=False))
    try:
        rate, frames, markers = float(header["DataRate"]), int(header["NumFrames"]), int(header["NumMarkers"])
        unit = _meters(header["Units"])
    except (KeyError, ValueError) as error:
        raise RecordingError(
            f"{path}, line 3: expected DataRate, NumFrames, NumMarkers and Units (m, cm, mm), found "
            f"{shortened(lines[2].strip())!r}"
        ) from error
    if not (rate > 0.0 and math.isfinite(rate)):
        raise RecordingError(f"{path}, line 3: expected a DataRate above zero, found {rate}")
    names = tuple(cell for cell in (cell.strip() for cell in lines[3].split(separator)[2:]) if cell)
    if len(names) != markers or len(set(names)) != markers:
        raise RecordingError(f"{path}, line 4: expected {markers} different marker names, found {len(set(names))}")
    rows = [(number, line) for number, line in enumerate(lines[5:], start=6) if line.strip()]
    if not rows:
        raise RecordingError(f"{path}: expected {frames} frames as its header says, found none")
    remarks = () if len(rows) == frames else (f"{path.name}: {len(rows)} frames, where its header says {frames}",)
    table = np.full((len(rows), 2 + 3 * markers), np.nan)
    for row, (number, line) in zip(table, rows, strict=True):
        cells = cells_of(line)
        while len(cells) > len(row) and not cells[-1]:
            cells.pop()
        # Between spaces, nothing tells which columns are empty.
        if len(cells) > len(row) or len(cells) < (2 if separator else len(row)):
            raise RecordingError(f"{path}, line {number}: expected {len(row)} columns, found {len(cells)}")
        row[: len(cells)] = numbers_in(f"{path}, line {number}", cells)
    stamps = table[:, 1].copy()
    if not np.isfinite(stamps).all() or (np.diff(stamps) <= 0.0).any():
        raise RecordingError(f"{path}: expected rising times in the second column, found others")
    positions = table[:, 2:].reshape(len(rows), markers, 3) * unit
    written = header.get("OrigDataStartFrame", "")
    # Some programs count from 1: then the first time is 0.
    first = int(written) if written.isdecimal() and len(written) < 10 and stamps[0] > 0.0 else 0
    return MarkerTrajectories(stamps, _without_subject(names), _observed(positions), rate, remarks=remarks, first=first)


def _meters(unit: str) -> float:
    """Meters of a unit, as a symbol or spelled out, in any case.

    Raises:
        KeyError: an unknown unit.
    """
    word = unit.strip().lower()
    for ending in ("meters", "metres", "meter", "metre"):
        if word.endswith(ending):
            return _METERS[_SPELLED[word.removesuffix(ending)]]
    return _METERS[word]


def _one_unit(written: str) -> str:
    """The unit of all points, where it may be written once for each."""
    words = {word.lower() for word in written.split()}
    return words.pop() if len(words) == 1 else written.strip() or "mm"


def read_c3d(path: str | Path) -> MarkerTrajectories:
    """Read the points of a .c3d file with the library c3d, which is pure Python: damaged files have crashed compiled readers.

    Args:
        path: the file.

    Raises:
        RecordingError: damage, no points, or an unknown unit.
    """
    import c3d

    path = Path(path)
    content = read_stored(path, "a .c3d file")
    with reading(path, "a .c3d file"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        reader = c3d.Reader(io.BytesIO(content))
        frames = [points[:, :5].astype(np.float64) for _, points, _ in reader.read_frames(copy=False)]
        names = tuple(str(name).strip() for name in reader.point_labels)
        written = reader.get("POINT:UNITS")
        unit = "mm" if written is None else _one_unit(str(written.string_value))
        rate, first = float(reader.point_rate), int(reader.first_frame)
        right, up = (_axis(reader.get(f"POINT:{screen}_SCREEN")) for screen in "XY")
    count = len(frames[0]) if frames else 0
    names = names[:count]
    if not count or unit not in _METERS or not 0.0 < rate < math.inf or len(set(names)) != count:
        raise RecordingError(
            f"{path}: expected named points in m, cm or mm at a rate above zero, found {count} points with "
            f"{len(set(names))} names in {shortened(repr(unit))} at {rate} Hz"
        )
    table = np.array(frames)
    positions = table[:, :, :3] * _METERS[unit]
    positions[table[:, :, 3] < 0.0] = np.nan  # the format's mark of a point that was not observed
    stamps = (first + np.arange(len(table))) / rate
    remarks: tuple[str, ...] = ()
    if right and up and right[1] == up[1]:
        remarks = (f"{path.name}: X_SCREEN {right} and Y_SCREEN {up} are the same axis, and not used",)
        right = up = None
    return MarkerTrajectories(stamps, _without_subject(names), _observed(positions), rate, up, right, remarks)


def _axis(screen: Any) -> str | None:  # noqa: ANN401 - of a library without types
    """The axis of a parameter like Y_SCREEN, a key of Z_UP_FROM; None: not given, or no axis."""
    word = "" if screen is None else str(screen.string_value).strip().upper()
    word = word if word[:1] in ("+", "-") else f"+{word}"
    return word if word in Z_UP_FROM else None


def _observed(positions: FloatArray) -> FloatArray:
    """NaN for markers that were not seen, for which exporters write zeros: none lies exactly in the origin."""
    positions[~np.isfinite(positions).all(axis=2) | (positions == 0.0).all(axis=2)] = np.nan
    return positions


def _without_subject(names: tuple[str, ...]) -> tuple[str, ...]:
    """The names without the name of the subject before a colon, if all that have one have the same."""
    subjects = {name.rpartition(":")[0] for name in names if ":" in name}
    own = tuple(name.rpartition(":")[2] for name in names)
    return own if len(subjects) == 1 and len(set(own)) == len(own) else names
