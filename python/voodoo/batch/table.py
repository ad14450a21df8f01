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


def encode(parts: Sequence[Columns], note: Mapping[str, Any]) -> bytes:
    """The bytes of a Parquet file of consecutive rows, with a note in its footer; a column that a part lacks is unknown there.

    Raises:
        VoodooError: pyarrow is not installed.
    """
    pa, pq = _pyarrow(), _pyarrow("pyarrow.parquet")

    def array(column: npt.NDArray[Any]) -> Any:  # noqa: ANN401 - it has no types
        words = column.dtype.kind == "U"
        return (
            pa.array([value or None for value in column.tolist()], pa.string())
            if words
            else pa.array(column, from_pandas=True)
        )

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
