"""The errors this package raises on bad input; all are `VoodooError`, hence `ValueError`."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import wraps
from importlib import import_module
from os import PathLike, fspath
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any, TypeVar

T = TypeVar("T")


class VoodooError(ValueError):
    """Base class of every error raised on purpose by this package."""


class CameraError(VoodooError):
    """A camera model with implausible numbers: it names the field, what was expected and what was found."""


class BodyError(VoodooError):
    """A body that cannot be tracked: it names the key, what was expected and what was found."""


class ConfigError(VoodooError):
    """A configuration entry that is unknown or outside its range."""


class MeasurementError(VoodooError):
    """A measurement or an initial pose that the tracker rejects; the tracker is unchanged."""


class RecordingError(VoodooError):
    """A recording that cannot be read: it names the file, what was expected and what was found.

    Attributes:
        reason: the kind of damage in a few words, used to count left-out measurements.
        hint: helpful lines, e.g. a template of a missing file; "" if there are none.
    """

    def __init__(self, message: str, *, reason: str = "that cannot be read", hint: str = "") -> None:
        """Store the message, reason and hint."""
        super().__init__(message)
        self.reason, self.hint = reason, hint


class NoPoseError(VoodooError):
    """Nothing in a recording could be used, or nobody was found in it."""


class MissingPoseError(NoPoseError, KeyError):
    """A name was looked up in an estimate without a pose, whose mappings are empty: the tracker is searching."""

    __str__ = Exception.__str__  # a KeyError's is the quoted message


class _NoPose(dict[str, Any]):
    def __missing__(self, name: str) -> Any:  # noqa: ANN401 - nothing is returned
        raise MissingPoseError(
            f"{name!r}: expected an estimate with a pose, found one with the status 'searching': no person was found "
            "yet, or the person has left; check estimate.status first"
        )


NO_POSE = _NoPose()
"""What an estimate without a pose has by names of joints and limbs: nothing, and it says so."""


class DetectorWarning(UserWarning):
    """A detector failed, and the tracker's step continued without it. The warning names the exception."""


class UnitWarning(UserWarning):
    """The depths of a depth image are none that a camera measures. The warning names the source and the unit."""


def one_thread(kind: type[T]) -> type[T]:
    """A class whose methods raise a VoodooError when another thread is in one of them; without it, it is PyO3's RuntimeError."""
    for name, value in list(vars(kind).items()):
        if isinstance(value, property) and value.fget is not None:
            setattr(kind, name, property(_alone(value.fget), value.fset, value.fdel, value.__doc__))
        elif isinstance(value, FunctionType):
            setattr(kind, name, _alone(value))
    return kind


def _alone(function: Callable[..., Any]) -> Callable[..., Any]:
    @wraps(function)
    def alone(*args: Any, **options: Any) -> Any:  # noqa: ANN401
        try:
            return function(*args, **options)
        except RuntimeError as error:
            if str(error) not in ("Already borrowed", "Already mutably borrowed"):
                raise
            raise VoodooError(
                f"{function.__qualname__}: expected one thread at a time, found another one at work; each thread needs a "
                "tracker of its own, or a lock"
            ) from None

    return alone


@contextmanager
def reading(source: object, expected: str, *, error: type[VoodooError] = RecordingError) -> Iterator[None]:
    """Convert any exception that a parser raises inside the block to one error. All parsers use this function.

    Decoders of damaged files raise many kinds of exceptions (struct.error, KeyError, zlib.error, AssertionError,
    MemoryError...); the caller needs a single one. Errors of this package pass unchanged.

    Args:
        source: file, or file and topic, being read.
        expected: what should have been there, e.g. "a readable ROS 2 bag".
        error: class of the error to raise.

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


@contextmanager
def naming(where: object, of: type[VoodooError], *, error: type[VoodooError] | None = None) -> Iterator[None]:
    """Errors raised inside begin with where they occurred.

    Args:
        where: file, key or argument.
        of: class of these errors.
        error: class that they become; None: the same.
    """
    try:
        yield
    except of as cause:
        raise (error or of)(f"{where}: {cause}") from cause


def installed(library: str, missing: str, *, error: type[VoodooError] = VoodooError) -> ModuleType:
    """A library that is optional.

    Args:
        library: name of the module.
        missing: message of the error, which says how to install it.
        error: class of the error to raise.

    Raises:
        VoodooError: of the class `error`, if it is not installed.
    """
    try:
        return import_module(library)
    except ImportError:
        raise error(missing) from None


def of_kind(name: str, value: object, kind: type[T], error: type[VoodooError]) -> T:
    """An argument, of the class that it must have.

    Raises:
        VoodooError: of the class `error`, for another one; names the argument.
    """
    if isinstance(value, kind):
        return value
    expected = "a name" if kind is str else f"a voodoo.{kind.__name__}"
    raise error(f"{name}: expected {expected}, found {type(value).__name__}")


def reason(error: Exception) -> str:
    """An error as words, which name its file."""
    if isinstance(error, OSError) and error.filename and error.strerror:
        return f"{error.filename}: {error.strerror}"
    return str(error) if isinstance(error, VoodooError | OSError) else shortened(f"{type(error).__name__}: {error}")


def shortened(text: str, *, most: int = 300) -> str:
    """Shortened text for a message, since content of a file may have megabytes."""
    return text if len(text) <= most else text[: most - 3] + "..."


def columns_in(header: Sequence[str]) -> str:
    """The first names of a table's header, for a message."""
    return shortened(", ".join(header) or "none", most=60)


def a_path(path: object, *, error: type[VoodooError]) -> Path:
    """A path given by the caller, with `~` expanded.

    Args:
        path: what was given.
        error: what to raise.

    Raises:
        VoodooError: of the class `error`: not a path, the home of an unknown user, or a NUL inside.
    """
    if not isinstance(path, str | PathLike) or not isinstance(fspath(path), str):
        raise error(f"path: expected a file or folder, found {type(path).__name__}")
    text = fspath(path)
    if "\0" in text:
        raise error(f"path: expected a file or folder, found a name with a NUL: {text!r:.80}")
    try:
        return Path(text).expanduser()
    except RuntimeError:
        raise error(f"path: expected a file or folder, found the home of an unknown user: {text}") from None


def utf8_name(path: Path, *, error: type[VoodooError] = VoodooError) -> str:
    """The name of a file for OpenCV, which crashes on a name that is not UTF-8.

    Raises:
        VoodooError: of the class `error`, for such a name.
    """
    try:
        str(path).encode()
    except UnicodeEncodeError:
        raise error(f"{str(path)!r}: expected a name in UTF-8, found other bytes") from None
    return str(path)
