"""Reads and writes bodies as TOML, exact to 1e-9 m."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any

from pydantic import Field, ValidationError

import voodoo._core as _core
from voodoo._core import TaperedEllipticCylinder
from voodoo.errors import BodyError
from voodoo.model.joint import Joint, Strict, Vector, problems
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
    try:
        spec = _BodySpec.model_validate(values)
    except ValidationError as error:
        raise BodyError(f"{source}: {problems(values, error)}") from None
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
        return _core.Body(spec.name, limbs, sites)
    except BodyError as error:
        raise BodyError(f"{source}: {error}") from None


def body_text(body: _core.Body) -> str:
    """A body as TOML; `core_body` reads it back unchanged up to rounding at 1e-9 m."""
    import tomlkit

    name, limbs, sites = body.parts()
    document = tomlkit.document()
    document.add("name", tomlkit.item(name))
    limb_tables = tomlkit.aot()
    for limb, parent, shape, joint, match_caps in limbs:
        table = tomlkit.table()
        table.add("name", limb)
        if parent is not None:
            table.add("parent", parent)
        table.add("shape", _inline({key: _number(getattr(shape, key)) for key in ("length", "a0", "b0", "a1", "b1")}))
        table.add("match_caps", list(match_caps))
        if joint is not None:
            table.add("joint", _joint(joint))
        limb_tables.append(table)
    document.add("limbs", limb_tables)
    if sites:
        site_tables = tomlkit.aot()
        for site, limb, position in sites:
            table = tomlkit.table()
            table.add("name", site)
            table.add("limb", limb)
            table.add("position", _vector(position))
            site_tables.append(table)
        document.add("sites", site_tables)
    return tomlkit.dumps(document)


def _joint(parts: Sequence[Any]) -> Any:  # noqa: ANN401 - tomlkit's table
    import tomlkit

    name, on_parent, on_limb, semi_axes, weight, limits, motion = parts
    table = tomlkit.table()
    table.add("name", name)
    for key, (position, rotation) in (("on_parent", on_parent), ("on_limb", on_limb)):
        table.add(key, _inline({"position": _vector(position), "rotation": _vector(rotation)}))
    table.add("semi_axes", _vector(semi_axes))
    table.add("weight", _number(weight))
    table.add("motion", _number(motion))
    if limits is not None:
        table.add("limits", [_vector(pair) for pair in limits])
    return table


def _inline(values: dict[str, Any]) -> Any:  # noqa: ANN401 - tomlkit's table
    import tomlkit

    table = tomlkit.inline_table()
    table.update(values)
    return table


def _number(value: float) -> float:
    return round(float(value), 9) + 0.0


def _vector(values: Sequence[float]) -> list[float]:
    return [_number(value) for value in values]
