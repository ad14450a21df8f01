"""Compares errors with the estimated covariances: fractions within one and two standard deviations."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from voodoo._core import Estimate
from voodoo.evaluation import metrics
from voodoo.evaluation.metrics import BoolArray, mean_or_nan
from voodoo.measurements import FloatArray

DROPPED = 0.2
"""Fraction of the joints that are dropped for the sparsification: the most uncertain ones, or the worst."""
NORMAL = tuple(math.erf(number / math.sqrt(2.0)) for number in (1, 2))
"""Fractions within one and two standard deviations of a normal distribution."""

ARM = np.array([name.split("_")[1] in ("shoulder", "elbow", "wrist") for name in metrics.JOINTS])
_LIMBS = ("arms", "legs")
TRUNK = np.array([name.split("_")[1] in ("shoulder", "hip") for name in metrics.JOINTS])


@dataclass(frozen=True, eq=False, repr=False)
class Deviations:
    """Errors and standard deviations of metrics.JOINTS in F frames.

    Args:
        errors: (F, 12, 3) estimate less reference [m], NaN where there is none.
        sigma: (F, 12, 3) standard deviations [m].
        measured: (F, 12) whether the status of the limb that ends at the joint is "measured".
    """

    errors: FloatArray
    sigma: FloatArray
    measured: BoolArray


def sigma_of(estimate: Estimate) -> FloatArray:
    """Standard deviations (12, 3) [m] of metrics.JOINTS; NaN where unknown."""
    return np.array([estimate.joint_sigma.get(name, (np.nan,) * 3) for name in metrics.JOINTS], dtype=np.float64)


@dataclass(frozen=True)
class Coverage:
    """Errors of a group of joints compared with their standard deviations, by coordinate.

    Args:
        name: the group.
        coordinates: number of coordinates.
        error_m, sigma_m: root mean squares.
        within_one, within_two: fractions of the errors within one and two standard deviations.
    """

    name: str
    coordinates: int
    error_m: float
    sigma_m: float
    within_one: float
    within_two: float


@dataclass(frozen=True)
class UncertaintyCalibration:
    """Agreement of errors with their standard deviations.

    Args:
        coverages: of all joints, those of the trunk, and the ends of limbs with and without the status "measured".
        quartiles: of the joints of arms and of legs, divided into quarters by standard deviation, the smallest first.
        mean_m, kept_m, oracle_m: mean error of all joints, without the most uncertain fraction DROPPED, and without the worst.
    """

    coverages: tuple[Coverage, ...]
    quartiles: tuple[Coverage, ...]
    mean_m: float
    kept_m: float
    oracle_m: float

    @property
    def ratio(self) -> float:
        """Remaining error without the most uncertain joints, divided by that without the worst: at best 1."""
        return self.kept_m / self.oracle_m


def calibrate(found: Sequence[Deviations]) -> UncertaintyCalibration | None:
    """Compare errors with their standard deviations; None if no joint has both."""
    if not found:
        return None
    grouped = groups(found)
    size, total = (np.linalg.norm(values, axis=1) for values in grouped["all joints"])
    if not len(size):
        return None
    quarters = ("surest", "second", "third", "least sure")
    kept = len(size) - int(DROPPED * len(size))
    return UncertaintyCalibration(
        coverages=tuple(_coverage(name, *of_group) for name, of_group in grouped.items() if name not in _LIMBS),
        quartiles=tuple(
            _coverage(f"{limbs}, {word} quarter", *part)
            for limbs in _LIMBS
            for word, part in zip(quarters, by_sigma(*grouped[limbs], parts=4), strict=True)
        ),
        mean_m=float(size.mean()),
        kept_m=float(size[np.argsort(total, kind="stable")[:kept]].mean()),
        oracle_m=float(np.sort(size)[:kept].mean()),
    )


def groups(found: Sequence[Deviations]) -> dict[str, tuple[FloatArray, FloatArray]]:
    """Errors and standard deviations (N, 3) of groups of joints that have both."""
    errors, sigma, measured = (
        np.concatenate([getattr(each, name) for each in found]) for name in ("errors", "sigma", "measured")
    )
    known = np.isfinite(errors).all(axis=2) & np.isfinite(sigma).all(axis=2)
    ends = known & ~TRUNK
    chosen = {"all joints": known, "shoulders and hips": known & TRUNK, "ends of measured limbs": ends & measured}
    chosen |= {"ends of other limbs": ends & ~measured, "arms": known & ARM, "legs": known & ~ARM}
    return {name: (errors[own], sigma[own]) for name, own in chosen.items()}


def by_sigma(errors: FloatArray, sigma: FloatArray, *, parts: int) -> list[tuple[FloatArray, FloatArray]]:
    """Errors and standard deviations by coordinate in equal parts, those with the smallest standard deviations first."""
    order = np.argsort(sigma.ravel(), kind="stable")
    return [(errors.ravel()[part], sigma.ravel()[part]) for part in np.array_split(order, parts)]


def _coverage(name: str, errors: FloatArray, sigma: FloatArray) -> Coverage:
    off, width = np.abs(errors).ravel(), sigma.ravel()
    return Coverage(
        name=name,
        coordinates=off.size,
        error_m=float(np.sqrt(mean_or_nan(off**2))),
        sigma_m=float(np.sqrt(mean_or_nan(width**2))),
        within_one=mean_or_nan((off <= width).astype(np.float64)),
        within_two=mean_or_nan((off <= 2.0 * width).astype(np.float64)),
    )


def calibration_markdown(calibration: UncertaintyCalibration, against: str) -> str:
    """The table as Markdown; `against` names the ground truth or reference."""
    one, two = (f"{100 * fraction:.1f} %" for fraction in NORMAL)
    lines = [
        f"## Standard deviations against {against}\n",
        f"Errors by coordinate; of a normal distribution {one} would be within one standard deviation, {two} within two.\n",
        "| joints | coordinates | error | standard deviation | within one | within two |",
        "|---|---|---|---|---|---|",
    ]
    for fraction in (*calibration.coverages, *calibration.quartiles):
        if fraction.coordinates:
            lines.append(
                f"| {fraction.name} | {fraction.coordinates} | {100 * fraction.error_m:.1f} cm | {100 * fraction.sigma_m:.1f} cm "
                f"| {100 * fraction.within_one:.1f} % | {100 * fraction.within_two:.1f} % |"
            )
    lines.append(
        f"\nMean error {100 * calibration.mean_m:.2f} cm; without the {100 * DROPPED:.0f} % least sure joints "
        f"{100 * calibration.kept_m:.2f} cm, without the worst {100 * calibration.oracle_m:.2f} cm: "
        f"{calibration.ratio:.2f} times.\n"
    )
    return "\n".join(lines)
