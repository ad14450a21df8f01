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
        turned = ", as of images or a calibration turned by 90 degrees" if found == size[::-1] else ""
        what = f"{'x'.join(map(str, found)) or 'nothing'}{turned}"
        raise RecordingError(
            f"{source}: expected {size[0]}x{size[1]} px as calibrated, found {what}",
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


_MOST_GROUPS = 6
"""Largest number of groups: a difference of 16-bit pixels has 17 bits; a run has up to 25 bits, of which images use 24."""
_HEAD = 8


def decode_rvl(data: bytes, source: object, size: tuple[int, int]) -> npt.NDArray[np.uint16]:
    """Decode columns, rows (uint32 each) and RVL data to (H, W) uint16, as compressed_depth_image_transport writes them.

    A. Wilson, "Fast Lossless Depth Image Compression", ISS 2017: alternating runs of zeros and of pixels, which are differences
    to the previous pixel. A number is a sequence of groups of three bits, the lowest first; each group has a fourth, highest bit
    that is set if more groups follow. Eight groups are one 32-bit word, with the first group in the highest bits.

    Args:
        data: the data after the 12-byte header of compressed depth.
        source: name in errors.
        size: expected (width, height).

    Raises:
        RecordingError: damage, or another size.
    """
    found = tuple(int(number) for number in np.frombuffer(data[:_HEAD], "<u4")) if len(data) >= _HEAD else ()
    check_size(found, source, size)
    numbers = _numbers(data[_HEAD:])
    image = np.zeros(size[0] * size[1], dtype=np.int64)
    at, pixel = 0, 0
    taken, places = [], []
    while pixel < image.size:
        if at + 2 > len(numbers):
            raise RecordingError(f"{source}: expected RVL data for {image.size} pixels, found {pixel}")
        zeros, count = int(numbers[at]), int(numbers[at + 1])
        at, pixel = at + 2, pixel + zeros
        if pixel + count > image.size or at + count > len(numbers) or zeros + count == 0:
            raise RecordingError(f"{source}: expected RVL data for {image.size} pixels, found damage at pixel {pixel}")
        taken.append(numbers[at : at + count])
        places.append(np.arange(pixel, pixel + count))
        at, pixel = at + count, pixel + count
    folded = np.concatenate(taken)
    values = np.cumsum((folded >> 1) ^ -(folded & 1))
    if values.size and not (0 <= values.min() and values.max() <= 0xFFFF):
        raise RecordingError(f"{source}: expected depths of 16 bits, found {values.min()} to {values.max()}")
    image[np.concatenate(places)] = values
    return image.astype(np.uint16).reshape(size[1], size[0])


def _numbers(data: bytes) -> npt.NDArray[np.int64]:
    """The numbers in RVL data; the unused rest of the last word may add zeros."""
    words = np.frombuffer(data[: len(data) // 4 * 4], "<u4")
    nibbles = (words[:, None] >> np.arange(28, -4, -4, dtype=np.uint32)) & 0xF
    groups = nibbles.ravel().astype(np.int64)
    ends = np.flatnonzero(groups < 8)
    if not ends.size:
        return np.empty(0, dtype=np.int64)
    groups = groups[: ends[-1] + 1]
    starts = np.concatenate([[0], ends[:-1] + 1])
    order = np.arange(groups.size) - np.repeat(starts, ends - starts + 1)
    # A number with too many groups is damage; its value is rejected as too long a run.
    values = (groups & 7) << (3 * np.minimum(order, 2 * _MOST_GROUPS))
    return np.asarray(np.add.reduceat(values, starts), dtype=np.int64)
