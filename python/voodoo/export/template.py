"""Messages of live poses, in which only numbers change: encoded once by their own library, then filled in one go."""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

STAMP_NS = 1_234_567_890_500_000_000
"""Time in a message that becomes a template."""
_FIRST = 1_000_000.0
"""Numbers in such a message count up from here: exact in single precision, and found in its bytes."""


class Template:
    """The bytes of a message, with places for its numbers.

    Args:
        encode: makes the message of some numbers, each of which is in it once, at STAMP_NS.
        count: how many.
        kind: how they are stored, e.g. "<f8".
        stamp: how STAMP_NS is stored; b"" without stamps.
    """

    def __init__(self, encode: Callable[[list[float]], bytes], count: int, *, kind: str, stamp: bytes = b"") -> None:
        """Encode the message."""
        numbers = _FIRST + np.arange(count)
        message = encode(numbers.tolist())
        self._bytes = np.frombuffer(bytearray(message), dtype=np.uint8)
        stored = numbers.astype(kind)[:, None].view(np.uint8)
        self._places = np.array([message.index(number.tobytes()) for number in stored], dtype=np.intp)
        # Every byte may begin a number, aligned or not.
        room = max(len(message) - np.dtype(kind).itemsize + 1, 0)
        self._numbers: npt.NDArray[np.float64] = np.ndarray(room, kind, self._bytes, strides=(1,))
        starts = [found.start() for found in re.finditer(re.escape(stamp), message)] if stamp else []
        self._stamps = np.array(starts, dtype=np.intp)[:, None] + np.arange(len(stamp))

    def filled(self, numbers: npt.NDArray[np.float64], stamp: bytes = b"") -> bytes:
        """The message with other numbers, and another stamp that takes as many bytes."""
        self._numbers[self._places] = numbers
        self._bytes[self._stamps] = np.frombuffer(stamp, dtype=np.uint8)
        return self._bytes.tobytes()
