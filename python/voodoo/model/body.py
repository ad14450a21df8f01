"""The tracked body: a tree of limbs with elastic-band joints and named sites, described by a TOML file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, get_args

import numpy.typing as npt
from pydantic import AfterValidator, Field

import voodoo._core as _core
from voodoo._core import TaperedEllipticCylinder
from voodoo.errors import BodyError, naming
from voodoo.model.joint import Joint, Place, Strict, Vector, number_of, numbers_of, short, valid
from voodoo.model.toml_io import parse_toml, read_text
from voodoo.names import HumanModel

__all__ = ["STATURE_M", "Body", "Joint", "Limb", "Place", "checked_joints", "ordered_poses"]

STATURE_M = 1.75
"""Stature of the default human [m]."""


@dataclass(frozen=True)
class Limb:
    """One rigid part: name, name of the parent (None for the root) and shape [m].

    Its frame has z along the axis from the proximal end (z = 0) to the distal end (z = shape.length).
    """

    name: str
    parent: str | None
    shape: TaperedEllipticCylinder


_Names = tuple[str, tuple[str, ...], tuple[tuple[str, int | None], ...], tuple[str | None, ...], tuple[str, ...]]


def _names(core: _core.Body) -> _Names:
    name, limbs, sites = core.parts()
    names = tuple(limb[0] for limb in limbs)
    tree = tuple((limb, None if parent is None else names.index(parent)) for limb, parent, *_ in limbs)
    joints = tuple(limb[3] and limb[3][0] for limb in limbs)
    return name, names, tree, joints, tuple(site[0] for site in sites)


class Body:
    """A body to track. Immutable; made by `human`, `load` or `from_toml`.

    Attributes:
        name: its own name.
        limb_names: names of the limbs, parents first.
        limb_tree: of each limb the name, and the number of its parent; None for the root.
        limb_joints: of each limb the name of its joint to the parent; None for the root.
        site_names: names of the sites.
    """

    name: str
    limb_names: tuple[str, ...]
    limb_tree: tuple[tuple[str, int | None], ...]
    limb_joints: tuple[str | None, ...]
    site_names: tuple[str, ...]

    def __init__(self, core: _core.Body, *, same: Body | None = None) -> None:
        """Wrap a body of the core; use `human`, `load` or `from_toml` instead.

        Args:
            core: what it wraps.
            same: a body with the same names, in other sizes.
        """
        self.core = core
        self._names: _Names = _names(core) if same is None else same._names
        self.name, self.limb_names, self.limb_tree, self.limb_joints, self.site_names = self._names

    @cached_property
    def limbs(self) -> tuple[Limb, ...]:
        """The limbs, parents first."""
        return tuple(Limb(name, parent, shape) for name, parent, shape, _, _ in self.core.parts()[1])

    @classmethod
    def human(cls, height: float = STATURE_M, *, model: HumanModel = "measured") -> Body:
        """The default human.

        Args:
            height: stature [m], 0.3 to 3.0.
            model: "measured": eighteen limbs with the mean joints and girths of 120 bodies in clothes; "full": the same limbs
                around the lines between their joints, with the girths of an anthropometric survey; "papers": ten limbs and nine
                joints (K06 III-C).

        Raises:
            BodyError: the stature is out of range, or the model unknown.
        """
        height = number_of("height", height, "a stature in meters")
        if not isinstance(model, str):
            raise BodyError(f"model: expected one of {', '.join(get_args(HumanModel))}, found {short(model)}")
        return cls(_core.Body.human(height, model))

    @classmethod
    def from_toml(cls, text: str, *, source: str = "body") -> Body:
        """A body from TOML text; the format is that of `to_toml`, explained in docs/how-to/describe-a-body.md.

        Raises:
            BodyError: names the key, what was expected and what was found.
        """
        values = parse_toml(text, source=source, error=BodyError)
        with valid(source, BodyError, values, most=5):  # a wrong unit is wrong everywhere
            spec = _BodySpec.model_validate(values)
        limbs = []
        for limb in spec.limbs:
            shape = limb.shape
            with naming(f"{source}: limbs.{limb.name}.shape", BodyError):
                cylinder = TaperedEllipticCylinder(shape.length, shape.a0, shape.b0, shape.a1, shape.b1)
            joint = None if limb.joint is None else limb.joint.parts()
            limbs.append((limb.name, limb.parent, cylinder, joint, limb.match_caps))
        sites = [(site.name, site.limb, site.position) for site in spec.sites]
        with naming(source, BodyError):
            return cls(_core.Body(spec.name, limbs, sites))

    @classmethod
    def load(cls, path: str | Path) -> Body:
        """A body from a TOML file.

        Raises:
            BodyError: unreadable, or as `from_toml`; names the file.
        """
        return cls.from_toml(read_text(path, error=BodyError), source=str(path))

    def scaled(self, factor: float) -> Body:
        """The body with all lengths multiplied by a factor.

        Raises:
            BodyError: not a number, or the result is not a valid body.
        """
        return Body(self.core.scaled(number_of("factor", factor)), same=self)

    def to_toml(self) -> str:
        """The body as TOML; `from_toml` reads it back unchanged up to rounding at 1e-9 m."""
        name, limbs, sites = self.core.parts()
        lines = [f"name = {_text(name)}"]
        for limb, parent, shape, joint, match_caps in limbs:
            sizes = {key: getattr(shape, key) for key in ("length", "a0", "b0", "a1", "b1")}
            lines += _table("[limbs]", name=limb, parent=parent, shape=sizes, match_caps=match_caps)
            if joint is not None:
                own, *places, semi_axes, weight, limits, motion = joint
                on_parent, on_limb = ({"position": position, "rotation": rotation} for position, rotation in places)
                numbers = {"semi_axes": semi_axes, "weight": weight, "motion": motion, "limits": limits}
                lines += _table("limbs.joint", name=own, on_parent=on_parent, on_limb=on_limb, **numbers)
        for site, limb, position in sites:
            lines += _table("[sites]", name=site, limb=limb, position=position)
        return "\n".join(lines) + "\n"

    def __reduce__(self) -> tuple[type[Body], tuple[_core.Body]]:
        """Pickles and copies have the same bits."""
        return type(self), (self.core,)

    def __eq__(self, other: object) -> bool:
        """Equal if all limbs, joints and sites are equal."""
        return isinstance(other, Body) and bool(self.core == other.core)

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        """Name and counts."""
        return f"Body(name={self.name!r}, limbs={len(self.limbs)}, sites={len(self.site_names)})"


def checked_joints(
    joints: Mapping[str, Sequence[float]], *, what: str = "joints"
) -> list[tuple[str, tuple[float, float, float]]]:
    """Names and positions as plain numbers.

    Raises:
        BodyError: not a mapping, or an entry is not three finite numbers; names the entry.
    """
    if not isinstance(joints, Mapping):
        raise BodyError(f"{what}: expected a mapping of names to positions, found {type(joints).__name__}")
    checked = []
    for name, position in joints.items():
        x, y, z = numbers_of(f"{what}[{name}]", position, BodyError, "three finite meters", count=3).tolist()
        checked.append((name, (x, y, z)))
    return checked


def ordered_poses(body: Body, world_from_limb: Mapping[str, npt.ArrayLike]) -> list[npt.ArrayLike]:
    """Poses (4, 4) by name in the order of the body's limbs; the core checks that they are rigid.

    Raises:
        BodyError: not a mapping, or a limb is missing or unknown.
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
    return [world_from_limb[name] for name in names]


_LONGEST_M = 100.0
"""A longer limb is out of the range of cameras and most lasers; one of 10 cm in millimeters is as long."""


def _meters(size: float) -> float:
    if size > _LONGEST_M:
        raise ValueError(
            f"expected meters, {_LONGEST_M:g} at most, found {size:g}; {size:g} millimeters are {size / 1000:g}"
        )
    return size


_Size = Annotated[float, Field(ge=0.0, allow_inf_nan=False), AfterValidator(_meters)]
_Length = Annotated[float, Field(gt=0.0, allow_inf_nan=False), AfterValidator(_meters)]


class _ShapeSpec(Strict):
    length: _Length
    a0: _Size
    b0: _Size
    a1: _Size
    b1: _Size


class _LimbSpec(Strict):
    name: str
    parent: str | None = None
    shape: _ShapeSpec
    joint: Joint | None = None
    match_caps: tuple[bool, bool] = (False, True)


class _SiteSpec(Strict):
    name: str
    limb: str
    position: Vector


class _BodySpec(Strict):
    name: str
    limbs: list[_LimbSpec]
    sites: list[_SiteSpec] = Field(default_factory=list)


def _table(heading: str, **entries: object) -> list[str]:
    """Lines of a table; entries that are None are left out."""
    return ["", f"[{heading}]", *(f"{key} = {_text(value)}" for key, value in entries.items() if value is not None)]


def _text(value: Any) -> str:  # noqa: ANN401 - what a body has
    """A value in TOML; tables are inline."""
    if isinstance(value, str | bool):
        import tomlkit

        return tomlkit.item(value).as_string()
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key} = {_text(entry)}" for key, entry in value.items()) + "}"
    return f"[{', '.join(map(_text, value))}]" if hasattr(value, "__len__") else str(round(float(value), 9) + 0.0)
