"""The errors this package raises on bad input; all are `VoodooError`, hence `ValueError`."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from os import PathLike, fspath
from pathlib import Path


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
    """A recording that cannot be read: it names the file, what was expected and what was found.

    Attributes:
        reason: the kind of damage in a few words, to count what is left out.
        hint: lines that help, e.g. a template of a missing file; "" without.
    """

    def __init__(self, message: str, *, reason: str = "that cannot be read", hint: str = "") -> None:
        """Keep the words."""
        super().__init__(message)
        self.reason, self.hint = reason, hint


class DetectorWarning(UserWarning):
    """A detector failed: the tracker's step went on without it. It names the exception."""


@contextmanager
def reading(source: object, expected: str, *, error: type[VoodooError] = RecordingError) -> Iterator[None]:
    """Turn whatever a parser throws inside the block into one error: the one place where that is done.

    Decoders of damaged files fail in many ways (struct.error, KeyError, zlib.error, AssertionError, MemoryError...);
    the caller needs one. Errors that are already clear pass unchanged.

    Args:
        source: file, or file and topic, being read.
        expected: what should have been there, e.g. "a readable ROS 2 bag".
        error: what to raise.

    Raises:
        VoodooError: of the class `error`, for any other Exception raised in the block.
    """
    try:
        yield
    except VoodooError:
        raise
    except FileNotFoundError:
        raise error(f"{source}: expected {expected}, found no such file") from None
    except OSError as cause:
        raise error(f"{source}: expected {expected}, found: {cause.strerror or cause}") from cause
    except Exception as cause:
        found = shortened(str(cause).strip() or "no further detail")
        raise error(f"{source}: expected {expected}, found damage: {type(cause).__name__}: {found}") from cause


def shortened(text: str, *, most: int = 300) -> str:
    """A text for a message: what a file holds may be megabytes."""
    return text if len(text) <= most else text[: most - 3] + "..."


def a_path(path: object, *, error: type[VoodooError], name: str = "path") -> Path:
    """A path that a caller gave, `~` expanded.

    Args:
        path: what was given.
        error: what to raise.
        name: of the argument.

    Raises:
        VoodooError: of the class `error`: no path, a home of nobody, or a NUL within; it names the argument.
    """
    if not isinstance(path, str | PathLike) or not isinstance(fspath(path), str):
        raise error(f"{name}: expected a file or folder, found {type(path).__name__}")
    text = fspath(path)
    if "\0" in text:
        raise error(f"{name}: expected a file or folder, found a name with a NUL: {text!r:.80}")
    try:
        return Path(text).expanduser()
    except RuntimeError:
        raise error(f"{name}: expected a file or folder, found the home of an unknown user: {text}") from None


def utf8_name(path: Path, *, error: type[VoodooError] = VoodooError) -> str:
    """The name of a file for OpenCV, which dies of one that is not UTF-8.

    Raises:
        VoodooError: of the class `error`, for such a name.
    """
    try:
        str(path).encode()
    except UnicodeEncodeError:
        raise error(f"{str(path)!r}: expected a name in UTF-8, found other bytes") from None
    return str(path)
