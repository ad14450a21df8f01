"""A body of two standing legs, which can be tracked with a laser at shin height."""

from __future__ import annotations

from voodoo.model.body import Body

HIP, LEG, HALF_WIDTH = 0.530, 0.491, 0.052
"""Height of the hips, length of a leg and half the distance of the hips, as fractions of the stature of the default human."""
_GIRTH = (0.075, 0.05)
"""Radii at hip and ankle [m], in trousers."""

_PELVIS = """
name = "standing legs"
[[limbs]]
name = "pelvis"
match_caps = [false, false]
shape = { length = 0.10, a0 = 0.03, b0 = 0.03, a1 = 0.03, b1 = 0.03 }
"""
_LEG = """
[[limbs]]
name = "{s}_leg"
parent = "pelvis"
shape = {{ length = {length}, a0 = {thick}, b0 = {thick}, a1 = {thin}, b1 = {thin} }}
match_caps = [false, false]
[limbs.joint]
name = "{s}_hip"
on_parent = {{ position = [0.0, {y}, 0.0], rotation = [3.141592653589793, 0.0, 0.0] }}
"""
_SITE = """
[[sites]]
name = "{s}_{name}"
limb = "{s}_leg"
position = [0.0, 0.0, {z}]
"""


def legs_body(height: float = 1.75) -> Body:
    """Two legs on a pelvis, without knees, as observed by a planar laser.

    Args:
        height: stature of the person [m].

    Raises:
        BodyError: the stature gives no valid body.
    """
    thick, thin = _GIRTH
    sides = (("l", HALF_WIDTH * height), ("r", -HALF_WIDTH * height))
    length = LEG * height
    text = _PELVIS + "".join(_LEG.format(s=s, y=y, length=length, thick=thick, thin=thin) for s, y in sides)
    ends = (("hip", 0.0), ("ankle", length))
    text += "".join(_SITE.format(s=s, name=name, z=z) for s, _ in sides for name, z in ends)
    return Body.from_toml(text, source="legs")
