"""Collects joint angles and covariances of estimates, frame by frame, as arrays."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from voodoo._core import Estimate
from voodoo.ik.angles import angle_names as angle_names_of
from voodoo.ik.angles import angles_of
from voodoo.ik.chain import Chain
from voodoo.model.body import Body
from voodoo.names import SEARCHING

FloatArray: TypeAlias = npt.NDArray[np.float64]


def angles_of_estimates(estimates: Sequence[Estimate], body: Body | None) -> tuple[tuple[str, ...], FloatArray]:
    """Names of the joint angles, and the angles (F, A) [rad], NaN while searching; none without a body."""
    if body is None:
        return (), np.empty((len(estimates), 0))
    chain, names = Chain(body), angle_names_of(body)
    unknown = np.full(len(names), np.nan)
    rows = [unknown if str(each.status) == SEARCHING else angles_of(chain, each) for each in estimates]
    return names, np.array(rows, dtype=np.float64)


def angle_sigmas_of(estimates: Sequence[Estimate], names: Sequence[str]) -> FloatArray:
    """Standard deviations (F, A) [rad] of the angles, of a joint with three angles the root mean square of all three; NaN where
    unknown, and (F, 0) if unknown in all frames."""
    joints = [name.rpartition("_")[0] for name in names]
    free = np.array([joints.count(joint) for joint in joints], dtype=np.float64)
    found = np.full((len(estimates), len(names)), np.nan)
    for index, estimate in enumerate(estimates):
        known = getattr(estimate, "angle_covariance", {})
        variances = {joint: float(known[joint].trace()) for joint in {*joints} & known.keys()}
        found[index] = [variances.get(joint, np.nan) for joint in joints]
    return np.sqrt(found / free) if np.isfinite(found).any() else np.empty((len(estimates), 0))


def covariances_of(
    estimates: Sequence[Estimate], joint_names: Sequence[str], limb_names: Sequence[str]
) -> tuple[FloatArray, FloatArray]:
    """Covariances (F, J, 3, 3) of the joints and (F, 6, 6) of the first limb's pose; NaN where unknown, and
    (F, 0, 3, 3) if unknown in all frames."""
    joints = np.full((len(estimates), len(joint_names), 3, 3), np.nan)
    root = np.full((len(estimates), 6, 6), np.nan)
    for index, estimate in enumerate(estimates):
        if len(estimate.joint_covariances) == len(joint_names):
            joints[index] = estimate.joint_covariances
        root[index] = estimate.root_covariance
    return (joints if np.isfinite(joints).any() else np.empty((len(estimates), 0, 3, 3))), root
