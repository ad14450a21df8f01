"""Numeric arrays of MATLAB files (level 5), read without a library.

SciPy's reader is compiled code that trusts the lengths in a file: damaged files have crashed the process. Recordings need only
numeric arrays, and here every length is checked against the size of the data. See MathWorks, "MAT-File Format".
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from voodoo.errors import RecordingError, reading
from voodoo.stored import read_stored
from voodoo.unpacking import Unpacking

_HEADER = 128
_MATRIX, _COMPRESSED = 14, 15
_NUMBERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
"""Storage types of numbers, by the type in their tag."""
_CLASSES = range(6, 16)
"""Classes of arrays that hold numbers."""
_COMPLEX = 0x08


def read_mat(path: Path) -> dict[str, npt.NDArray[Any]]:
    """The numeric arrays of a .mat file by name, in their storage type (integer-valued doubles are stored as integers); other
    variables (text, cells, structures) are left out.

    Raises:
        RecordingError: not a MATLAB file of level 5, damage, or arrays that unpack to too much; names the file.
    """
    data = read_stored(path, "a MATLAB file")
    if len(data) < _HEADER or data[126:128] not in (b"IM", b"MI"):
        other = "one of version 7.3, which is HDF5 (save it with -v7)" if b"HDF" in data[:_HEADER] else "another file"
        raise RecordingError(f"{path}: expected a MATLAB file of level 5, found {other}")
    order = "<" if data[126:128] == b"IM" else ">"
    found: dict[str, npt.NDArray[Any]] = {}
    unpacking = Unpacking()
    with reading(path, "a sound MATLAB file"):
        for kind, content in _elements(data[_HEADER:], order):
            packed = kind == _COMPRESSED
            inside = _elements(unpacking.unpack(content, "zlib"), order) if packed else [(kind, content)]
            for one, body in inside:
                if one == _MATRIX and body and (named := _matrix(body, order)) is not None:
                    found[named[0]] = named[1]
    return found


def _elements(data: bytes, order: str) -> Iterator[tuple[int, bytes]]:
    """(type, content) of the consecutive elements in `data`."""
    at = 0
    while at + 8 <= len(data):
        kind, length = struct.unpack_from(order + "II", data, at)
        if kind >> 16:  # up to four bytes are stored in the tag itself
            kind, length = kind & 0xFFFF, kind >> 16
            start, after = at + 4, at + 8
        else:
            start = at + 8
            # Compressed elements are not padded to eight bytes.
            after = start + (length if kind == _COMPRESSED else -(-length // 8) * 8)
        if start + length > len(data) or (start == at + 4 and length > 4):
            raise ValueError(f"expected {length} bytes of an element, found {len(data) - start}")
        yield kind, data[start : start + length]
        at = after


def _matrix(data: bytes, order: str) -> tuple[str, npt.NDArray[Any]] | None:
    """Name and numbers of an array; None if it is not numeric, or complex."""
    parts = _elements(data, order)
    (_, flags), (_, shape), (_, name) = next(parts), next(parts), next(parts)
    (word,) = struct.unpack_from(order + "I", flags)
    if word & 0xFF not in _CLASSES or (word >> 8) & _COMPLEX:
        return None
    sizes = [int(size) for size in np.frombuffer(shape, order + "i4")]
    kind, numbers = next(parts)
    if kind not in _NUMBERS:
        raise ValueError(f"expected numbers, found an element of type {kind}")
    values = np.frombuffer(numbers, np.dtype(order + _NUMBERS[kind]))
    if len(sizes) < 2 or min(sizes) < 0 or math.prod(sizes) != values.size:
        raise ValueError(f"expected an array of {sizes}, found {values.size} numbers")
    return name.decode("ascii"), values.astype(values.dtype.newbyteorder("=")).reshape(sizes, order="F")
