"""Bodies with wrong sizes."""

from __future__ import annotations

import voodoo._core as _core
from voodoo.measurements import FloatArray
from voodoo.model.body import Body


def grown(body: Body, *, thicker: float = 1.0, longer: float = 1.0, joints: bool = True) -> Body:
    """The body with thicker and longer limbs, to test a tracker with a wrong model.

    Args:
        body: the true one.
        thicker: factor of all semi-axes.
        longer: factor of all lengths.
        joints: move joints and sites with the ends of limbs; else only the surfaces change.

    Raises:
        BodyError: the result is not a valid body.
    """
    name, limbs, sites = body.core.parts()
    reach = longer if joints else 1.0

    def place(frame: tuple[FloatArray, FloatArray]) -> tuple[list[float], FloatArray]:
        return [reach * float(value) for value in frame[0]], frame[1]

    parts = []
    for limb, parent, shape, joint, caps in limbs:
        axes = (thicker * axis for axis in (shape.a0, shape.b0, shape.a1, shape.b1))
        joint = None if joint is None else (joint[0], place(joint[1]), place(joint[2]), *joint[3:])
        parts.append((limb, parent, _core.TaperedEllipticCylinder(longer * shape.length, *axes), joint, caps))
    places = [(site, limb, [reach * float(value) for value in position]) for site, limb, position in sites]
    return Body(_core.Body(name, parts, places))
