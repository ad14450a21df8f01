"""Reading the files of a recording: only regular files of plausible size."""

from __future__ import annotations

import stat
from pathlib import Path

from voodoo.errors import RecordingError, reading

MOST_BYTES = 2**28
"""Largest size of an image, table or list [bytes]: a quarter of a gigabyte, more than any sensor writes into one file."""


def check_stored(path: Path, expected: str, *, most: int = MOST_BYTES) -> None:
    """Reject files that are not regular (a FIFO blocks, a device has no end) or too large.

    Args:
        path: the file.
        expected: what it should be, e.g. "a readable picture".
        most: largest size [bytes].

    Raises:
        RecordingError: names the file.
    """
    with reading(path, expected):
        found = path.stat()
        if not stat.S_ISREG(found.st_mode):
            raise RecordingError(f"{path}: expected {expected}, found no regular file")
        if found.st_size > most:
            raise RecordingError(f"{path}: expected {expected}, {most} bytes at most, found {found.st_size}")


def read_stored(path: Path, expected: str) -> bytes:
    """The bytes of a file, see `check_stored`."""
    check_stored(path, expected)
    with reading(path, expected):
        return path.read_bytes()


def read_stored_text(path: Path, expected: str) -> str:
    """The text (UTF-8) of a file, see `check_stored`."""
    content = read_stored(path, expected)
    with reading(path, expected):
        return content.decode("utf-8")
