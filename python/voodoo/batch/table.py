"""The result of a recording as a Parquet table, with a row per frame and person."""

from __future__ import annotations

import io
import json
from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from voodoo.errors import installed
from voodoo.export.people import PeopleTrack
from voodoo.export.table import columns_of as columns_of_rows
from voodoo.export.track import Track

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


def stacked(parts: Sequence[Columns]) -> Columns:
    """Concatenates tables; a column that is missing in one of them is unknown there."""
    names = dict.fromkeys(name for part in sorted(parts, key=len, reverse=True) for name in part)
    found: Columns = {}
    for name in names:
        kind = next(part[name].dtype for part in parts if name in part)
        unknown = "" if kind.kind == "U" else np.nan
        found[name] = np.concatenate(
            [part[name] if name in part else np.full(len(part["stamp_s"]), unknown, kind) for part in parts]
        )
    return found


def encode(columns: Columns, note: Mapping[str, Any]) -> bytes:
    """The bytes of a Parquet file with a note in its footer.

    Raises:
        VoodooError: pyarrow is not installed.
    """
    pa, pq = _pyarrow(), _pyarrow("pyarrow.parquet")
    arrays = [
        pa.array([value or None for value in column.tolist()], pa.string())
        if column.dtype.kind == "U"
        else pa.array(column, from_pandas=True)
        for column in columns.values()
    ]
    table = pa.Table.from_arrays(arrays, names=list(columns)).replace_schema_metadata({NOTE: json.dumps(note).encode()})
    words = [name for name, column in columns.items() if column.dtype.kind == "U"]
    out = io.BytesIO()
    # Neighboring frames have equal high bytes: splitting the numbers by byte improves compression.
    split = {name: "BYTE_STREAM_SPLIT" for name, column in columns.items() if name not in (*words, "person")}
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
