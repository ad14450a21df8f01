"""A body of two standing legs, which can be tracked with a laser at shin height."""

from __future__ import annotations

import math
from typing import Any

import voodoo._core as _core
from voodoo._core import TaperedEllipticCylinder
from voodoo.errors import BodyError, naming
from voodoo.model.body import Body, Joint, Place

HIP, LEG, HALF_WIDTH = 0.530, 0.491, 0.052
"""Height of the hips, length of a leg and half the distance of the hips, as fractions of the stature of the default human."""
_GIRTH = (0.075, 0.05)
"""Radii at hip and ankle [m], in trousers."""


def legs_body(height: float = 1.75) -> Body:
    """Two legs on a pelvis, without knees, as observed by a planar laser.

    Args:
        height: stature of the person [m].

    Raises:
        BodyError: the stature gives no valid body.
    """
    thick, thin = _GIRTH
    length = LEG * height
    with naming(f"legs of a stature of {height} m", BodyError):
        shape = TaperedEllipticCylinder(length, thick, thick, thin, thin)
    limbs: list[Any] = [("pelvis", None, TaperedEllipticCylinder(0.10, 0.03, 0.03, 0.03, 0.03), None, (False, False))]
    sites = []
    for side, y in (("l", HALF_WIDTH * height), ("r", -HALF_WIDTH * height)):
        hip = Joint(name=f"{side}_hip", on_parent=Place(position=(0.0, y, 0.0), rotation=(math.pi, 0.0, 0.0)))
        limbs.append((f"{side}_leg", "pelvis", shape, hip.parts(), (False, False)))
        sites += [(f"{side}_{name}", f"{side}_leg", (0.0, 0.0, z)) for name, z in (("hip", 0.0), ("ankle", length))]
    return Body(_core.Body("standing legs", limbs, sites))
