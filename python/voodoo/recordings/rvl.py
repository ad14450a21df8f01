"""Depth images compressed by RVL, as written by compressed_depth_image_transport.

A. Wilson, "Fast Lossless Depth Image Compression", ISS 2017: alternating runs of zeros and of pixels, which are differences
to the previous pixel. A number is a sequence of groups of three bits, the lowest first; each group has a fourth, highest bit
that is set if more groups follow. Eight groups are one 32-bit word, with the first group in the highest bits.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from voodoo.errors import RecordingError
from voodoo.recordings.pictures import check_size

_MOST_GROUPS = 6
"""Largest number of groups: a difference of 16-bit pixels has 17 bits; a run has up to 25 bits, of which images use 24."""
_HEAD = 8


def decode_rvl(data: bytes, source: object, size: tuple[int, int]) -> npt.NDArray[np.uint16]:
    """Decode columns, rows (uint32 each) and RVL data to (H, W) uint16.

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
