"""Unpacking compressed data of others, up to a limit."""

from __future__ import annotations

import sys
import zipfile
import zlib
from bz2 import BZ2Decompressor
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from voodoo.errors import reading
from voodoo.stored import MOST_RECORDED, check_stored

if TYPE_CHECKING:
    import numpy.typing as npt

MOST_UNPACKED = 2_000_000_000
"""What compressed data may become [bytes]."""
_LITTLE, _MOST_GAIN = 2**26, 200
"""Anything may unpack to 64 MB, and to 200 times its own size beyond. Bags compress to a tenth at best, static scenes to a
fiftieth, and archives made to fill disks to a thousandth."""
_GAIN_OF_POSES = 10
"""Arrays that unpack to less have no limit: poses do to twice their size, and a result of hours must be readable."""
_PIECE = 2**24


class Unpacking:
    """Limits what compressed data becomes, in total and relative to its size.

    Args:
        most: largest size of what is in memory, or on a disk, at once [bytes]; None: 2 GB, and 200 times the size of what
            it is unpacked from.
        kept: everything that is unpacked stays there; otherwise only one piece at a time.
        advice: how to allow more.
    """

    def __init__(self, most: int | None = None, *, kept: bool = True, advice: str = "") -> None:
        """Start with nothing unpacked."""
        self._most, self._related = (MOST_UNPACKED, True) if most is None else (most, False)
        self._kept, self._advice = kept, advice
        self._packed = self._unpacked = 0

    def room(self, packed: int) -> int:
        """What `packed` bytes more may become."""
        left = self._most - self._unpacked if self._kept else self._most
        if self._related:
            left = min(left, _LITTLE + _MOST_GAIN * (self._packed + packed) - self._unpacked)
        return max(0, left)

    def error(self, packed: int, unpacked: object) -> ValueError:
        """The error for data that becomes too large."""
        return ValueError(
            f"expected {packed} bytes that unpack to at most {self.room(packed)}, found {unpacked}{self._advice}"
        )

    def check(self, packed: int, unpacked: int) -> None:
        """Count data of a declared size.

        Raises:
            ValueError: it is too large.
        """
        if packed > self._most or unpacked > self.room(packed):
            raise self.error(packed, unpacked)
        self._packed += packed
        self._unpacked += unpacked

    def unpack(self, data: bytes, kind: str, *, declared: int | None = None) -> bytes:
        """Decompress data.

        Args:
            data: what to decompress.
            kind: "zstd", "lz4", "bz2" or "zlib".
            declared: the size that the file says.

        Raises:
            ValueError: damage, another size than declared, or too large.
        """
        most = self.room(len(data))
        if declared is not None and declared > most:
            raise self.error(len(data), declared)
        parts = iter((data,))
        content = b"".join(
            _pieces(lambda: next(parts, b""), _decompressor(kind), most if declared is None else declared)
        )
        size = len(content)
        if declared is not None and size != declared:
            raise ValueError(f"expected {declared} bytes as declared, found {'more' if size > declared else size}")
        if size > most:
            raise self.error(len(data), "more")
        self.check(len(data), size)
        return content


def _decompressor(kind: str) -> Callable[[], Any]:
    if kind == "bz2":
        return BZ2Decompressor
    if kind == "zlib":
        return zlib.decompressobj
    if kind == "lz4":
        import lz4.frame

        return lz4.frame.LZ4FrameDecompressor
    if kind == "zstd":
        if sys.version_info >= (3, 14):
            from compression import zstd
        else:
            from backports import zstd
        return zstd.ZstdDecompressor
    raise ValueError(f"expected a known compression, found {kind!r}")


def _pieces(read: Callable[[], bytes], decompressor: Callable[[], Any], most: int) -> Iterator[bytes]:
    """The content of consecutive compressed streams, which are read part by part; ends one byte above the limit."""
    size, data = 0, read()
    while data:
        one = decompressor()
        while not one.eof:
            piece = one.decompress(data, min(_PIECE, most - size + 1))
            size += len(piece)
            yield piece
            if size > most:
                return
            data = getattr(one, "unconsumed_tail", b"")  # only zlib gives back what it did not use
            if not piece and not data and not one.eof and not (data := read()):
                raise ValueError("expected complete compressed data, found it cut off")
        # Later streams belong to the data; zlib has one, after which there may be padding.
        data = b"" if decompressor is zlib.decompressobj else one.unused_data or read()


def count_zstd(path: Path, unpacking: Unpacking) -> None:
    """Check what a file of zstd becomes, without keeping it.

    Raises:
        ValueError: it is too large, or damaged.
    """
    packed = path.stat().st_size
    if not packed:
        raise ValueError("expected compressed data, found none")
    most = unpacking.room(packed)
    with path.open("rb") as file:
        size = sum(map(len, _pieces(lambda: file.read(_PIECE), _decompressor("zstd"), most)))
    if size > most:
        raise unpacking.error(packed, "more")
    unpacking.check(packed, size)


@contextmanager
def stored_arrays(path: Path, expected: str) -> Iterator[Mapping[str, npt.NDArray[Any]]]:
    """The arrays of an .npz file, each read when it is asked for.

    Raises:
        RecordingError: damage, or arrays that unpack to too much; names the file.
    """
    check_stored(path, expected, most=MOST_RECORDED)
    with reading(path, expected):
        with zipfile.ZipFile(path) as archive:
            packed, unpacked = path.stat().st_size, sum(member.file_size for member in archive.infolist())
            if unpacked > _GAIN_OF_POSES * packed:
                Unpacking().check(packed, unpacked)
        import numpy as np

        with np.load(path, allow_pickle=False) as content:
            yield content
