"""Messages of live poses, in which only numbers change: encoded once by their own library, then filled in one go."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

import voodoo._core as _core
from voodoo.measurements import FloatArray

STAMP_NS = 1_234_567_890_500_000_000
"""Time in a message that becomes a template."""
_FIRST = 1_000_000.0
"""Numbers in such messages count up from here: exact in single precision, and found in their bytes."""


def template(
    encode: Callable[[FloatArray], Sequence[bytes]], count: int, *, single: bool = False, stamp: bytes = b""
) -> _core.Template:
    """The template of the messages of an instant.

    Args:
        encode: makes the messages of some numbers at STAMP_NS.
        count: how many.
        single: they are stored in single precision, see _core.Template.
        stamp: how STAMP_NS is stored; b"" without stamps.
    """
    return _core.Template(encode(_FIRST + np.arange(count, dtype=np.float64)), _FIRST, count, single, stamp)
