"""The tracked body: a tree of limbs with elastic-band joints and named sites; a TOML file describes it."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, ConfigDict, Field, ValidationError

import voodoo._core as _core
from voodoo._core import TaperedEllipticCylinder
from voodoo.errors import BodyError, MeasurementError
from voodoo.model.toml_io import parse_toml, read_text

_Number = Annotated[float, Field(allow_inf_nan=False)]
_Vector = tuple[_Number, _Number, _Number]
_Range = tuple[_Number, _Number]
_ZERO = (0.0, 0.0, 0.0)


class _Strict(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class _ShapeSpec(_Strict):
    length: Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
    a0: Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
    b0: Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
    a1: Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
    b1: Annotated[float, Field(ge=0.0, allow_inf_nan=False)]


class _Part(_Strict):
    """What callers make themselves: what is wrong with it is a BodyError."""

    if not TYPE_CHECKING:  # to type checkers the fields are the arguments

        def __init__(self, **values: Any) -> None:  # noqa: ANN401 - checked here
            try:
                super().__init__(**values)
            except ValidationError as error:
                raise BodyError(f"{type(self).__name__}: {_problems(values, error)}") from None

        # Not called for a part of a larger whole, whose error names the key from the top.
        __init__.__pydantic_base_init__ = True


class Place(_Part):
    """Where a joint's ellipse is on a limb: `position` [m] and `rotation`, a rotation vector [rad], in the limb's frame.

    Raises:
        BodyError: not three finite numbers each.
    """

    position: _Vector = _ZERO
    rotation: _Vector = _ZERO


class Joint(_Part):
    """An elastic-band joint of a limb to its parent (K07 section 4).

    Attributes:
        name: usually that of the site at its centre.
        on_parent: the joint's ellipse in the parent's frame, e.g. `voodoo.Place(position=(0.0, 0.0, 0.2))`.
        on_limb: the same in the limb's own frame; with the joint at rest the two coincide.
        semi_axes: semi-axes of the ellipse along the joint frame's x and y [m]: (0, 0) universal, one positive: hinge
            about that axis, both positive: elliptic.
        weight: strength relative to the other joints of a limb.
        limits: least and greatest value of each component of the joint's rotation vector [rad]; None: free.
        motion: standard deviation of the joint's unexpected turn in 1/30 s [rad].

    Raises:
        BodyError: an entry that is missing, unknown or no such number.
    """

    name: str
    on_parent: Place = Place()
    on_limb: Place = Place()
    semi_axes: tuple[_Number, _Number] = (0.0, 0.0)
    weight: _Number = 1.0
    limits: tuple[_Range, _Range, _Range] | None = None
    motion: _Number = 0.3

    def parts(self) -> tuple[Any, ...]:
        """The joint as the core takes it."""
        places = [(place.position, place.rotation) for place in (self.on_parent, self.on_limb)]
        return (self.name, *places, self.semi_axes, self.weight, self.limits, self.motion)


class _LimbSpec(_Strict):
    name: str
    parent: str | None = None
    shape: _ShapeSpec
    joint: Joint | None = None
    match_caps: tuple[bool, bool] = (False, True)


class _SiteSpec(_Strict):
    name: str
    limb: str
    position: _Vector


class _BodySpec(_Strict):
    name: str
    limbs: list[_LimbSpec]
    sites: list[_SiteSpec] = []


@dataclass(frozen=True)
class Limb:
    """One rigid part: name, name of the parent (None for the root) and shape [m].

    Its frame has z along the axis from the proximal end (z = 0) to the distal end (z = shape.length).
    """

    name: str
    parent: str | None
    shape: TaperedEllipticCylinder


class Body:
    """A body to track. Immutable; made by `human`, `load` or `from_toml`."""

    def __init__(self, core: _core.Body) -> None:
        """Wrap a body of the core; use `human`, `load` or `from_toml` instead."""
        self._core = core
        name, limbs, sites = core.parts()
        self.name: str = name
        self.limbs: tuple[Limb, ...] = tuple(Limb(name, parent, shape) for name, parent, shape, _, _ in limbs)
        self.site_names: tuple[str, ...] = tuple(site[0] for site in sites)

    @property
    def core(self) -> _core.Body:
        """The body of the compiled core."""
        return self._core

    @property
    def limb_names(self) -> tuple[str, ...]:
        """Names of the limbs, parents first."""
        return tuple(limb.name for limb in self.limbs)

    @classmethod
    def human(cls, height: float = 1.75, *, model: Literal["papers", "full"] = "full") -> Body:
        """The default human.

        Args:
            height: stature [m], 0.3 to 3.0.
            model: "papers": ten limbs and nine joints (K06 III-C); "full": eighteen, with waist, neck, clavicles, hands and feet.

        Raises:
            BodyError: the stature is out of range, or the model unknown.
        """
        return cls(_core.Body.human(height, model))

    @classmethod
    def from_toml(cls, text: str, *, source: str = "body") -> Body:
        """A body from TOML text; the format is that of `to_toml`, explained in docs/body.md.

        Raises:
            BodyError: it names the key, what was expected and what was found.
        """
        values = parse_toml(text, source=source, error=BodyError)
        try:
            spec = _BodySpec.model_validate(values)
        except ValidationError as error:
            raise BodyError(f"{source}: {_problems(values, error)}") from None
        limbs = []
        for limb in spec.limbs:
            shape = limb.shape
            try:
                cylinder = TaperedEllipticCylinder(shape.length, shape.a0, shape.b0, shape.a1, shape.b1)
            except BodyError as error:
                raise BodyError(f"{source}: limbs.{limb.name}.shape: {error}") from None
            joint = None if limb.joint is None else limb.joint.parts()
            limbs.append((limb.name, limb.parent, cylinder, joint, limb.match_caps))
        sites = [(site.name, site.limb, site.position) for site in spec.sites]
        try:
            return cls(_core.Body(spec.name, limbs, sites))
        except BodyError as error:
            raise BodyError(f"{source}: {error}") from None

    @classmethod
    def load(cls, path: str | Path) -> Body:
        """A body from a TOML file."""
        return cls.from_toml(read_text(path, error=BodyError), source=str(path))

    def scaled(self, factor: float) -> Body:
        """The body with all lengths multiplied by a factor."""
        return Body(self._core.scaled(factor))

    def to_toml(self) -> str:
        """The body as TOML; `from_toml` reads it back unchanged up to rounding at 1e-9 m."""
        name, limbs, sites = self._core.parts()
        lines = [f"name = {_text(name)}"]
        for limb, parent, shape, joint, match_caps in limbs:
            lines += ["", "[[limbs]]", f"name = {_text(limb)}"]
            lines += [f"parent = {_text(parent)}"] if parent is not None else []
            sizes = {key: getattr(shape, key) for key in ("length", "a0", "b0", "a1", "b1")}
            lines.append("shape = { " + ", ".join(f"{key} = {_number(value)}" for key, value in sizes.items()) + " }")
            lines.append(f"match_caps = [{', '.join(str(flag).lower() for flag in match_caps)}]")
            if joint is not None:
                joint_name, on_parent, on_limb, semi_axes, weight, limits, motion = joint
                lines += ["[limbs.joint]", f"name = {_text(joint_name)}", f"on_parent = {_place(on_parent)}"]
                lines += [f"on_limb = {_place(on_limb)}", f"semi_axes = {_vector(semi_axes)}"]
                lines += [f"weight = {_number(weight)}", f"motion = {_number(motion)}"]
                if limits is not None:
                    lines.append(f"limits = [{', '.join(_vector(pair) for pair in limits)}]")
        for site, limb, position in sites:
            lines += ["", "[[sites]]", f"name = {_text(site)}", f"limb = {_text(limb)}"]
            lines.append(f"position = {_vector(position)}")
        return "\n".join(lines) + "\n"

    def __reduce__(self) -> tuple[type[Body], tuple[_core.Body]]:
        """Pickles and copies have the same bits."""
        return type(self), (self._core,)

    def __eq__(self, other: object) -> bool:
        """Equal when every limb, joint and site is."""
        return isinstance(other, Body) and bool(self._core == other._core)

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        """Name and counts."""
        return f"Body(name={self.name!r}, limbs={len(self.limbs)}, sites={len(self.site_names)})"


def checked_joints(
    joints: Mapping[str, Sequence[float]], *, what: str = "joints"
) -> dict[str, tuple[float, float, float]]:
    """Positions by name as plain numbers.

    Raises:
        BodyError: no mapping, or an entry is not three finite numbers; it names the entry.
    """
    if not isinstance(joints, Mapping):
        raise BodyError(f"{what}: expected a mapping of names to positions, found {type(joints).__name__}")
    checked = {}
    for name, position in joints.items():
        try:
            x, y, z = (float(value) for value in np.asarray(position, dtype=np.float64).reshape(-1))
        except (TypeError, ValueError):
            raise BodyError(f"{what}[{name}]: expected three numbers in metres, found {position!r}") from None
        if not all(map(math.isfinite, (x, y, z))):
            raise BodyError(f"{what}[{name}]: expected finite metres, found {position!r}")
        checked[name] = (x, y, z)
    return checked


def ordered_poses(body: Body, world_from_limb: Mapping[str, npt.ArrayLike]) -> list[npt.NDArray[np.float64]]:
    """Poses (4, 4) by name in the order of the body's limbs; the core checks that they are rigid.

    Raises:
        BodyError: no mapping, or a limb is missing or unknown.
        MeasurementError: a pose that is no array of numbers; it names the limb.
    """
    if not isinstance(world_from_limb, Mapping):
        raise BodyError(
            f"world_from_limb: expected a mapping of limbs to poses, found {type(world_from_limb).__name__}"
        )
    names = body.limb_names
    if set(world_from_limb) != set(names):
        raise BodyError(
            f"world_from_limb: expected the limbs {', '.join(names)}, found {', '.join(map(str, world_from_limb))}"
        )
    poses = []
    for name in names:
        try:
            poses.append(np.asarray(world_from_limb[name], dtype=np.float64))
        except (TypeError, ValueError):
            found = _short(world_from_limb[name])
            raise MeasurementError(f"world_from_limb[{name}]: expected a rigid 4x4 transform, found {found}") from None
    return poses


def _problems(values: dict[str, Any], error: ValidationError) -> str:
    def key(location: tuple[str | int, ...]) -> str:
        parts: list[str] = []
        node: object = values
        for part in location:
            node = _child(node, part)
            name = node.get("name") if isinstance(part, int) and isinstance(node, dict) else None
            parts.append(str(name if isinstance(name, str) else part))
        return ".".join(parts)

    found = [f"{key(item['loc'])}: {item['msg'].lower()}, found {_short(item['input'])}" for item in error.errors()]
    return "; ".join(found)


def _child(node: object, part: str | int) -> object:
    if isinstance(node, dict):
        return node.get(part)
    return node[part] if isinstance(node, list) and isinstance(part, int) and part < len(node) else None


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) < 80 else text[:77] + "..."


def _text(value: str) -> str:
    """A TOML string; JSON's escapes are TOML's, but for DEL, which TOML wants escaped."""
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


def _number(value: float) -> str:
    return repr(round(value, 9) + 0.0)


def _vector(values: Sequence[float]) -> str:
    return "[" + ", ".join(_number(value) for value in values) + "]"


def _place(place: tuple[Sequence[float], Sequence[float]]) -> str:
    return f"{{ position = {_vector(place[0])}, rotation = {_vector(place[1])} }}"
