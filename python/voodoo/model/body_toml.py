"""Reads and writes bodies as TOML, exact to 1e-9 m."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field

import voodoo._core as _core
from voodoo._core import TaperedEllipticCylinder
from voodoo.errors import BodyError, naming
from voodoo.model.joint import Joint, Strict, Vector, valid
from voodoo.model.toml_io import parse_toml


class _ShapeSpec(Strict):
    length: Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
    a0: Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
    b0: Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
    a1: Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
    b1: Annotated[float, Field(ge=0.0, allow_inf_nan=False)]


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


def core_body(text: str, *, source: str) -> _core.Body:
    """The body of a TOML text.

    Raises:
        BodyError: names the key, what was expected and what was found.
    """
    values = parse_toml(text, source=source, error=BodyError)
    with valid(source, BodyError, values):
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
        return _core.Body(spec.name, limbs, sites)


def body_text(body: _core.Body) -> str:
    """A body as TOML; `core_body` reads it back unchanged up to rounding at 1e-9 m."""
    name, limbs, sites = body.parts()
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
