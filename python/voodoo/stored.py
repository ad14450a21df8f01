"""Reading the files of others: only regular files of plausible size."""

from __future__ import annotations

import codecs
import os
import stat
from collections.abc import Iterable
from pathlib import Path

from voodoo.errors import RecordingError, VoodooError, reading

MOST_BYTES = 2**28
"""Largest size of an image or a file of numbers [bytes]: a quarter of a gigabyte, more than any sensor writes into one file."""
MOST_TEXT = 2**26
"""Largest size of a table or list as text [bytes]: each of its characters may become an entry of eight bytes."""
MOST_METADATA = 2**20
"""Largest size of a configuration, a calibration, a pose, or what a bag says of itself [bytes]."""
MOST_RECORDED = 2**40
"""Largest size of a recording, or of the result of one [bytes]."""


def check_stored(
    path: Path, expected: str, *, most: int = MOST_BYTES, error: type[VoodooError] = RecordingError
) -> None:
    """Reject files that are not regular (a FIFO blocks, a device has no end) or too large.

    Args:
        path: the file.
        expected: what it should be, e.g. "a readable picture".
        most: largest size [bytes].
        error: class of the error to raise.

    Raises:
        VoodooError: of the class `error`; names the file.
    """
    with reading(path, expected, error=error):
        found = path.stat()
        if not stat.S_ISREG(found.st_mode):
            raise error(f"{path}: expected {expected}, found no regular file")
        if found.st_size > most:
            raise error(f"{path}: expected {expected}, {most} bytes at most, found {found.st_size} bytes")


def read_stored(
    path: Path, expected: str, *, most: int = MOST_BYTES, error: type[VoodooError] = RecordingError
) -> bytes:
    """The bytes of a file, see `check_stored`."""
    check_stored(path, expected, most=most, error=error)
    with reading(path, expected, error=error):
        # Should the name have become a FIFO since, opening it does not wait.
        descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
        with open(descriptor, "rb") as file:  # noqa: PTH123 - a descriptor
            return file.read(most)


def read_stored_text(
    path: Path, expected: str, *, most: int = MOST_TEXT, error: type[VoodooError] = RecordingError
) -> str:
    """The text of a file, see `check_stored` and `text_of`."""
    content = read_stored(path, expected, most=most, error=error)
    with reading(path, expected, error=error):
        return text_of(content)


def numbers_in(where: object, cells: Iterable[str]) -> list[float]:
    """The numbers in cells of a table; NaN for empty ones.

    Raises:
        RecordingError: other text; `where` begins the message.
    """
    try:
        return [float(cell or "nan") for cell in cells]
    except ValueError as error:
        raise RecordingError(f"{where}: expected numbers, found {error}") from error


def text_of(content: bytes) -> str:
    """Text in UTF-8 or UTF-16 with or without a byte order mark; else in Windows' Western code page.

    Raises:
        UnicodeDecodeError: it is no text.
    """
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return content.decode("utf-16")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        if b"\0" in content:
            raise
        return content.decode("cp1252")
