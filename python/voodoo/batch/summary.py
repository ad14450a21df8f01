"""Summary row of a recording, and the table of all recordings."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Container, Iterable, Mapping
from dataclasses import dataclass, fields
from html import escape
from typing import Any
from urllib.parse import quote

from pydantic import TypeAdapter

from voodoo.errors import VoodooError
from voodoo.evaluation.summary import cell, table_text

DONE, FAILED = "done", "failed"
REPORTS = "reports"
"""Folder of the pages of recordings."""


@dataclass(frozen=True)
class Row:
    """Summary of one recording.

    Args:
        recording: its name in the data set.
        frames: number of frames with a row; 0 if it failed.
        seconds: wall-clock time, including reading and writing [s].
        status: "done" or "failed".
        error: why it failed, in one line; "" if it did not.
        recorded_s: its duration [s].
        persons: number of persons found.
        tracking_share: fraction of the rows with the status tracking or degraded.
        joint_error_m: mean error of the twelve joints if there is ground truth or a reference: see `voodoo eval` [m].
        left_out: number of unusable measurements.
        source: path or URL.
        doubts: what is unlikely in its stamps, calibration and poses; "" if nothing.
    """

    recording: str
    frames: int = 0
    seconds: float = math.nan
    status: str = DONE
    error: str = ""
    recorded_s: float = math.nan
    persons: int = 0
    tracking_share: float = math.nan
    joint_error_m: float = math.nan
    left_out: int = 0
    source: str = ""
    doubts: str = ""

    @classmethod
    def of(cls, values: Mapping[str, Any]) -> Row:
        """A row from a mapping of fields to text or numbers.

        Raises:
            ValueError: fields are missing or invalid.
        """
        return _ROW.validate_python({name: value for name, value in values.items() if value not in (None, "")})


_ROW = TypeAdapter(Row)
COLUMNS = tuple(field.name for field in fields(Row))


def write_table(rows: Iterable[Row]) -> str:
    """The text of summary.csv, sorted by name."""
    ordered = sorted(rows, key=lambda row: row.recording)
    return table_text(COLUMNS, ([getattr(row, name) for name in COLUMNS] for row in ordered))


def read_table(text: str, source: object) -> dict[str, Row]:
    """The rows of a summary.csv by name.

    Raises:
        VoodooError: another format.
    """
    try:
        header, *rows = list(csv.reader(io.StringIO(text)))
        found = [Row.of(dict(zip(header, row, strict=True))) for row in rows]
    except (ValueError, csv.Error) as error:
        raise VoodooError(f"{source}: expected a summary.csv of voodoo batch, found another file: {error}") from error
    if header[:5] != list(COLUMNS[:5]):
        raise VoodooError(f"{source}: expected the columns {', '.join(COLUMNS[:5])}, found {', '.join(header[:5])}")
    return {row.recording: row for row in found}


def write_index(rows: Iterable[Row], pages: Container[str]) -> str:
    """A web page with the table, and links to those `pages` (names of files in REPORTS) that there are."""
    columns = COLUMNS[:-1]
    lines = ["<!DOCTYPE html><html lang=en><meta charset=utf-8><title>recordings</title>"]
    lines += ["<body style='font:15px sans-serif;margin:1.5em'><table cellpadding=4>"]
    lines.append(f"<tr>{''.join(f'<th align=left>{name}' for name in columns)}")
    for row in sorted(rows, key=lambda row: row.recording):
        cells = [escape(cell(getattr(row, name))) for name in columns]
        if f"{row.recording}.html" in pages:
            cells[0] = f"<a href='{REPORTS}/{quote(row.recording)}.html'>{cells[0]}</a>"
        lines.append(f"<tr>{''.join(f'<td>{words}' for words in cells)}")
    return "\n".join([*lines, "</table></body></html>", ""])
