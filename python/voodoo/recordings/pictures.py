"""Decoding of stored images with detection of damage.

OpenCV silently fills unreadable parts with gray or black, so the container is checked first.
"""

from __future__ import annotations

import re
import struct
import zlib

import cv2
import numpy as np
import numpy.typing as npt

from voodoo.errors import RecordingError

_PNG_MAGIC = b"\x89PNG\r\n\x1a\n"
_JPEG_MAGIC = b"\xff\xd8\xff"
_PGM = re.compile(rb"P5\s(?:\s|#[^\n]*\n)*(\d{1,6})\s+(\d{1,6})\s+(\d{1,5})\s")
"""Header of a binary PGM: width, height, largest value."""
_JPEG_FRAMES = {*range(0xC0, 0xD0)} - {0xC4, 0xC8, 0xCC}
"""JPEG markers of segments that contain the image size."""


def check_png(data: bytes, source: object) -> None:
    """Check signature, chunk lengths and checksums of a PNG up to its end mark.

    Raises:
        RecordingError: names the first error.
    """
    if data[:8] != _PNG_MAGIC:
        raise RecordingError(f"{source}: expected a PNG, found bytes starting with {data[:8]!r}")
    position = 8
    while position + 12 <= len(data):
        (length,) = struct.unpack_from(">I", data, position)
        end = position + 8 + length
        if end + 4 > len(data):
            break
        kind = data[position + 4 : position + 8]
        if zlib.crc32(data[position + 4 : end]) != struct.unpack_from(">I", data, end)[0]:
            raise RecordingError(f"{source}: expected a sound PNG, found a wrong checksum in its chunk {kind!r}")
        if kind == b"IEND":
            return
        position = end + 4
    raise RecordingError(f"{source}: expected a complete PNG, found it cut off after {len(data)} bytes")


def picture_size(data: bytes, source: object) -> tuple[int, int]:
    """(width, height) in the header of a PNG, JPEG or PGM; nothing is decoded.

    Raises:
        RecordingError: none of these, or without a size.
    """
    if found := _PGM.match(data):
        return int(found[1]), int(found[2])
    if data[:8] == _PNG_MAGIC:
        if len(data) >= 24 and data[12:16] == b"IHDR":
            width, height = struct.unpack_from(">II", data, 16)
            return width, height
        raise RecordingError(f"{source}: expected a PNG with a header, found {len(data)} bytes without")
    if data[:3] != _JPEG_MAGIC:
        raise RecordingError(f"{source}: expected a JPEG or PNG, found bytes starting with {data[:8]!r}")
    at = 2
    while at + 9 <= len(data) and data[at] == 0xFF:
        mark = data[at + 1]
        if mark == 0xFF:  # padding
            at += 1
            continue
        if mark in _JPEG_FRAMES:
            height, width = struct.unpack_from(">HH", data, at + 5)
            return width, height
        (length,) = struct.unpack_from(">H", data, at + 2)
        at += 2 + length
    raise RecordingError(f"{source}: expected a JPEG with a size, found {len(data)} bytes without")


def check_size(found: tuple[int, ...], source: object, size: tuple[int, int]) -> None:
    """Check the size in the header of an image: a small file with 30,000 x 30,000 pixels would need gigabytes of memory.

    Raises:
        RecordingError: another size than expected, (width, height).
    """
    if found != size:
        raise RecordingError(
            f"{source}: expected {size[0]}x{size[1]} px as calibrated, found {'x'.join(map(str, found)) or 'nothing'}",
            reason="of another size than calibrated",
        )


def decode_depth_png(data: bytes, source: object, size: tuple[int, int]) -> npt.NDArray[np.uint16]:
    """Decode a 16-bit single-channel PNG or PGM to (H, W) uint16.

    Args:
        data: the file's bytes.
        source: name in errors.
        size: expected (width, height).

    Raises:
        RecordingError: damaged, not 16-bit gray, or of another size.
    """
    found = _PGM.match(data)
    if found is None:
        check_png(data, source)
    elif len(data) < found.end() + size[0] * size[1] * (2 if int(found[3]) > 255 else 1):
        raise RecordingError(f"{source}: expected a complete PGM, found it cut off after {len(data)} bytes")
    check_size(picture_size(data, source), source, size)
    image = _decode(data, cv2.IMREAD_UNCHANGED, source)
    if image.ndim != 2 or image.dtype != np.uint16:
        bits, channels = 8 * image.itemsize, 1 if image.ndim == 2 else image.shape[2]
        raise RecordingError(
            f"{source}: expected a 16-bit single-channel PNG, whose values are distances, found {bits} bits and {channels} "
            f"{'channel' if channels == 1 else 'channels'} with values from {image.min()} to {image.max()}, as for display",
            reason="that are no 16-bit depth",
        )
    return image.astype(np.uint16, copy=False)


def decode_color(data: bytes, source: object, size: tuple[int, int]) -> npt.NDArray[np.uint8]:
    """Decode a PNG or JPEG to (H, W, 3) BGR uint8.

    Args:
        data: the file's bytes.
        source: name in errors.
        size: expected (width, height).

    Raises:
        RecordingError: damaged, cut off, neither PNG nor JPEG, or of another size.
    """
    if data[:3] == _JPEG_MAGIC:
        if b"\xff\xd9" not in data[-1024:]:  # some cameras pad after the end mark
            raise RecordingError(f"{source}: expected a complete JPEG, found no end mark in {len(data)} bytes")
    elif data[:8] == _PNG_MAGIC:
        check_png(data, source)
    else:
        raise RecordingError(f"{source}: expected a JPEG or PNG, found bytes starting with {data[:8]!r}")
    check_size(picture_size(data, source), source, size)
    image = _decode(data, cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION, source)
    check_size((image.shape[1], image.shape[0]), source, size)
    return image.astype(np.uint8, copy=False)


def _decode(data: bytes, flags: int, source: object) -> npt.NDArray[np.generic]:
    try:
        image = cv2.imdecode(np.frombuffer(data, np.uint8), flags)
    except cv2.error as error:
        raise RecordingError(f"{source}: expected a picture, found damage: {error}") from error
    if image is None:
        raise RecordingError(f"{source}: expected a picture, found {len(data)} bytes that do not decode")
    return image
