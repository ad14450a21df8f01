"""The errors this package raises on bad input; all are `VoodooError`, hence `ValueError`."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager


class VoodooError(ValueError):
    """Base class of every error raised on purpose by this package."""


class CameraError(VoodooError):
    """A camera model whose numbers cannot be meant: it names the field, what was expected and what was found."""


class BodyError(VoodooError):
    """A body that cannot be tracked: it names the key, what was expected and what was found."""


class ConfigError(VoodooError):
    """A configuration entry that is unknown or outside its range."""


class MeasurementError(VoodooError):
    """A measurement or an initial pose the tracker refuses; the tracker is unchanged."""


class RecordingError(VoodooError):
    """A recording that cannot be read: it names the file, what was expected and what was found."""


@contextmanager
def reading(source: object, expected: str) -> Iterator[None]:
    """Turn whatever a third-party reader throws inside the block into a RecordingError.

    Decoders of damaged files fail in many ways (struct.error, KeyError, zlib.error, AssertionError, MemoryError...);
    the caller needs one. Errors that are already clear pass unchanged.

    Args:
        source: file, or file and topic, being read.
        expected: what should have been there, e.g. "a readable ROS 2 bag".

    Raises:
        RecordingError: for any other Exception raised in the block.
    """
    try:
        yield
    except VoodooError:
        raise
    except FileNotFoundError:
        raise RecordingError(f"{source}: expected {expected}, found no such file") from None
    except Exception as error:
        found = str(error).strip() or "no further detail"
        raise RecordingError(f"{source}: expected {expected}, found damage: {type(error).__name__}: {found}") from error
