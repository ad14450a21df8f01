"""Joint angles of a pose: names, axes and order.

Angles are radians, in the order of the body's limbs. The joint to a limb's parent has either

* one angle `JOINT_flexion` (hinge): about the hinge's axis; for the default human flexion is positive, or
* three, `JOINT_rx`, `JOINT_ry`, `JOINT_rz`: the components of the rotation vector (axis times angle, at most pi long) that
  turns the joint frame on the parent into the joint frame on the limb, in the axes of that frame.

The default human's joint frames: x is the axis of flexion (it points to the person's right at shoulder, elbow, hip and ankle, to
the left at knee and spine, so that flexion is positive everywhere), z runs along the limb towards its far end, y completes them.
Every angle is zero when the person stands upright with hanging arms. A rotation vector has no order of axes and no gimbal lock;
for Euler angles after the ISB's recommendations turn it into a matrix first (scipy's Rotation.from_rotvec).
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from voodoo._core import Estimate
from voodoo.ik.chain import Chain
from voodoo.measurements import FloatArray
from voodoo.model.body import Body

_ROOT = 6
_CLOSED_M = 1e-6


def angle_names(body: Body) -> tuple[str, ...]:
    """Names of all joint angles of a body, in order."""
    return Chain(body).angle_names[_ROOT:]


def joint_angles(body: Body, estimate: Estimate) -> Mapping[str, float]:
    """Angle [rad] of every joint: name -> angle.

    Args:
        body: the tracked body, `tracker.body`.
        estimate: of that body. If its joints are open (limbwise solver), the angles are those of the closed chain nearest to
            it in the least-squares sense.

    Raises:
        MeasurementError: the estimate is of another body.
    """
    chain = Chain(body)
    return MappingProxyType(dict(zip(chain.angle_names[_ROOT:], angles_of(chain, estimate).tolist(), strict=True)))


def angles_of(chain: Chain, estimate: Estimate) -> FloatArray:
    """Joint angles as an array (A,), for a chain with a free root that the caller creates once: `Chain(body)`."""
    apart = max(estimate.joint_gaps.values(), default=0.0) > _CLOSED_M
    return chain.project(estimate.world_from_limb, closest=apart)[_ROOT:]
