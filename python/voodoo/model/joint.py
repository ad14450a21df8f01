"""Joints of a body and their poses."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, Annotated, Any, TypeAlias

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator

from voodoo.errors import BodyError, VoodooError, shortened

FloatArray: TypeAlias = npt.NDArray[np.float64]
Number = Annotated[float, Field(allow_inf_nan=False)]
Vector = tuple[Number, Number, Number]
Range = tuple[Number, Number]
_ZERO = (0.0, 0.0, 0.0)
_FULL_TURN = 6.3
"""Radians, typed with two digits: no component of a rotation vector needs more, and most angles in degrees are more."""


def _radians(angles: Any) -> Any:  # noqa: ANN401 - numbers, nested as a field has them, or None
    for angle in [] if angles is None else np.ravel(angles).tolist():
        if abs(angle) > _FULL_TURN:
            turn = math.radians(angle)
            raise ValueError(
                f"expected radians, a full turn at most, found {angle:g}; {angle:g} degrees are {turn:.4g}"
            )
    return angles


@contextmanager
def valid(
    where: object,
    error: type[VoodooError],
    values: object = None,
    *,
    known: Collection[str] = (),
    most: int | None = None,
) -> Iterator[None]:
    """Problems that pydantic finds inside become an error.

    Args:
        where: begins the message.
        error: class of the error.
        values: what is checked; items of its lists that have a name are called by it.
        known: keys that an unknown one is compared with.
        most: number of problems that are named; None: all.
    """
    try:
        yield
    except ValidationError as cause:
        raise error(f"{where}: {'; '.join(_problems(values, cause, known)[:most])}") from None


class Strict(BaseModel):
    """Frozen, and without unknown entries."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class _Part(Strict):
    """Models constructed by callers, whose errors are BodyErrors."""

    if not TYPE_CHECKING:  # for type checkers, the fields are the arguments

        def __init__(self, **values: Any) -> None:  # noqa: ANN401 - checked here
            with valid(type(self).__name__, BodyError, values):
                super().__init__(**values)

        # Not called for nested models, whose errors name the full key.
        __init__.__pydantic_base_init__ = True


class Place(_Part):
    """Pose of a joint's ellipse on a limb: `position` [m] and `rotation`, a rotation vector [rad], in the limb's frame.

    Raises:
        BodyError: not three finite numbers each, or an angle of more than a full turn.
    """

    position: Vector = _ZERO
    rotation: Vector = _ZERO

    _in_radians = field_validator("rotation")(_radians)


class Joint(_Part):
    """An elastic-band joint of a limb to its parent (K07 section 4).

    Attributes:
        name: usually that of the site at its center.
        on_parent: the joint's ellipse in the parent's frame, e.g. `voodoo.Place(position=(0.0, 0.0, 0.2))`.
        on_limb: the same in the limb's own frame; with the joint at rest the two coincide.
        semi_axes: semi-axes of the ellipse along the joint frame's x and y [m]: (0, 0) universal, one positive: hinge
            about that axis, both positive: elliptic.
        weight: strength relative to the other joints of a limb.
        limits: least and greatest value of each component of the joint's rotation vector [rad]; None: free.
        motion: standard deviation of the joint's unexpected rotation in 1/30 s [rad].

    Raises:
        BodyError: an entry is missing, unknown or invalid.
    """

    name: str
    on_parent: Place = Place()
    on_limb: Place = Place()
    semi_axes: tuple[Number, Number] = (0.0, 0.0)
    weight: Number = 1.0
    limits: tuple[Range, Range, Range] | None = None
    motion: Number = 0.3

    _in_radians = field_validator("limits")(_radians)

    def parts(self) -> tuple[Any, ...]:
        """The joint in the format of the core."""
        places = [(place.position, place.rotation) for place in (self.on_parent, self.on_limb)]
        return (self.name, *places, self.semi_axes, self.weight, self.limits, self.motion)


def _problems(values: object, error: ValidationError, known: Collection[str]) -> list[str]:

    def key(location: tuple[str | int, ...]) -> str:
        parts: list[str] = []
        node: object = values
        for part in location:
            node = _child(node, part)
            name = node.get("name") if isinstance(part, int) and isinstance(node, dict) else None
            parts.append(str(name if isinstance(name, str) else part))
        return ".".join(parts)

    problems = []
    for item in error.errors(include_url=False):
        unknown = known and item["type"] == "extra_forbidden"
        words = f"unknown key; known are {', '.join(known)}" if unknown else expectation(item)
        problems.append(f"{key(item['loc'])}: {words}" if item["loc"] else words)
    return problems


_EXPECTED = {
    "missing": "an entry",
    "json_invalid": "JSON",
    "finite_number": "a finite number",
    "greater_than": "a number above {gt:g}",
    "greater_than_equal": "a number from {ge:g}",
    "less_than": "a number below {lt:g}",
    "less_than_equal": "a number up to {le:g}",
    "too_short": "at least {min_length} entries",
    "too_long": "at most {max_length} entries",
    "string_too_short": "a word",
    "literal_error": "one of {expected}",
    "extra_forbidden": "a known key",
    "model": "an object",
    "float": "a number",
    "int": "a whole number",
    "bool": "true or false",
    "string": "a word",
    "dict": "a table of names",
    "list": "a list",
    "tuple": "a list of numbers",
}
"""What pydantic's types of errors expect; of a family of types by its first word."""


def expectation(problem: Mapping[str, Any]) -> str:
    """An error of pydantic as "expected ..., found ..."."""
    kind, context = str(problem["type"]), problem.get("ctx", {})
    if kind == "value_error":
        return str(context["error"])
    words = _EXPECTED.get(kind) or _EXPECTED.get(kind.split("_")[0], "another value")
    found = "none" if kind == "missing" else context["error"] if kind == "json_invalid" else short(problem["input"])
    return f"expected {words.format(**context)}, found {found}"


def _child(node: object, part: str | int) -> object:
    if isinstance(node, dict):
        return node.get(part)
    return node[part] if isinstance(node, list) and isinstance(part, int) and part < len(node) else None


def number_of(name: str, value: object, expected: str = "a number", *, error: type[VoodooError] = BodyError) -> float:
    """Check a number given by the caller.

    Raises:
        VoodooError: of the class `error`, if it is not a number; names the argument.
    """
    try:
        if isinstance(value, str):
            raise TypeError
        return float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        raise error(f"{name}: expected {expected}, found {short(value)}") from None


def as_numbers(values: npt.ArrayLike) -> FloatArray:
    """An array of real numbers.

    Raises:
        TypeError, ValueError, OverflowError: other values; NumPy would accept dates and truncate complex numbers.
    """
    found = np.asarray(values)
    if found.dtype.kind not in "biufO":
        raise TypeError(f"{found.dtype} is no real number")
    return found.astype(np.float64, copy=False)


def numbers_of(
    what: str,
    values: npt.ArrayLike,
    error: type[VoodooError],
    expected: str = "numbers",
    *,
    count: int | None = None,
) -> FloatArray:
    """An array of real numbers given by the caller; with a `count`, so many finite ones in a row.

    Raises:
        VoodooError: of the class `error`, for other values; names `what`.
    """
    try:
        found = as_numbers(values)
        if count is not None and not np.isfinite(found).all():
            raise ValueError("not finite")
        return found if count is None else found.reshape((count,))
    except (TypeError, ValueError, OverflowError):
        raise error(f"{what}: expected {expected}, found {short(values)}") from None


def numbers_or_nan(values: npt.ArrayLike) -> FloatArray:
    """An array of real numbers; of other values a single NaN, in one dimension."""
    try:
        return as_numbers(values)
    except (TypeError, ValueError, OverflowError):
        return np.array([np.nan])


def corners(what: str, box: object, error: type[VoodooError]) -> tuple[list[float], list[float]]:
    """The low and the high corner (3,) [m] of a box given by the caller.

    Raises:
        VoodooError: of the class `error`, for other values, or a box without inside; names `what`.
    """
    found = numbers_or_nan(box)  # type: ignore[arg-type]
    if found.shape != (2, 3) or not np.isfinite(found).all() or not (found[0] < found[1]).all():
        raise error(f"{what}: expected two corners of three meters, the lower one first, found {short(box)}")
    low, high = found.tolist()
    return low, high


def short(value: object) -> str:
    """A value as text for a message."""
    try:
        text = repr(value)
    except Exception:  # nested too deeply, or an object whose repr fails
        text = f"a {type(value).__name__} that cannot be shown"
    return shortened(text, most=80)
