"""Compares errors with the estimated covariances: fractions within one and two standard deviations."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from voodoo._core import Estimate
from voodoo.evaluation import metrics
from voodoo.evaluation.figure import new_figure, save_figure
from voodoo.evaluation.metrics import BoolArray, FloatArray, mean_or_nan

DROPPED = 0.2
"""Fraction of the joints that are dropped for the sparsification: the most uncertain ones, or the worst."""
NORMAL = (0.683, 0.954)
"""Fractions within one and two standard deviations of a normal distribution."""

_ARM = np.array([name.split("_")[1] in ("shoulder", "elbow", "wrist") for name in metrics.JOINTS])
_TRUNK = np.array([name.split("_")[1] in ("shoulder", "hip") for name in metrics.JOINTS])


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
    unknown = np.full(3, np.nan)
    return np.array([estimate.joint_sigma.get(name, unknown) for name in metrics.JOINTS], dtype=np.float64)


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
    errors, sigma, measured, known = _together(found)
    if not known.any():
        return None
    coverages = [
        _coverage(name, errors[chosen & known], sigma[chosen & known])
        for name, chosen in (
            ("all joints", np.ones_like(known)),
            ("shoulders and hips", np.broadcast_to(_TRUNK, known.shape)),
            ("ends of measured limbs", ~_TRUNK & measured),
            ("ends of other limbs", ~_TRUNK & ~measured),
        )
    ]
    quartiles = []
    for limbs, chosen in (("arms", _ARM), ("legs", ~_ARM)):
        own = known & chosen
        order = np.argsort(sigma[own].ravel(), kind="stable")
        parts = zip(("surest", "second", "third", "least sure"), np.array_split(order, 4), strict=True)
        quartiles += [
            _coverage(f"{limbs}, {word} quarter", errors[own].ravel()[part], sigma[own].ravel()[part])
            for word, part in parts
        ]
    size, total = (np.linalg.norm(values[known], axis=1) for values in (errors, sigma))
    kept = len(size) - int(DROPPED * len(size))
    return UncertaintyCalibration(
        coverages=tuple(coverages),
        quartiles=tuple(quartiles),
        mean_m=float(size.mean()),
        kept_m=float(size[np.argsort(total, kind="stable")[:kept]].mean()),
        oracle_m=float(np.sort(size)[:kept].mean()),
    )


def _together(found: Sequence[Deviations]) -> tuple[FloatArray, FloatArray, BoolArray, BoolArray]:
    """Errors, standard deviations, whether the limb is measured, and which joints (F, 12) have both."""
    errors, sigma = (np.concatenate([getattr(each, name) for each in found]) for name in ("errors", "sigma"))
    known = np.isfinite(errors).all(axis=2) & np.isfinite(sigma).all(axis=2)
    return errors, sigma, np.concatenate([each.measured for each in found]), known


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


def plot_calibration(path: Path, found: Sequence[Deviations]) -> None:
    """Plot the cumulative distribution of normalized errors, and error over standard deviation."""
    errors, sigma, measured, known = _together(found)
    figure = new_figure(9.6, 4.2)
    left, right = figure.subplots(1, 2)
    steps = np.linspace(0.0, 4.0, 81)
    normal = [math.erf(step / math.sqrt(2.0)) for step in steps]
    left.plot(steps, normal, color="#333333", linestyle="--", linewidth=1.0, label="normal distribution")
    groups = (
        ("shoulders and hips", np.broadcast_to(_TRUNK, known.shape), "#7a8ca3"),
        ("measured limbs", ~_TRUNK & measured, "#4c8c6b"),
        ("other limbs", ~_TRUNK & ~measured, "#c8553d"),
    )
    for name, chosen, color in groups:
        own = known & chosen
        if own.any():
            ratios = np.sort((np.abs(errors[own]) / sigma[own]).ravel())
            left.plot(steps, np.searchsorted(ratios, steps, side="right") / ratios.size, color=color, label=name)
    left.set_xlabel("standard deviations")
    left.set_ylabel("share of errors within")
    left.legend(frameon=False, fontsize=8)
    for name, chosen, color in (("arms", _ARM, "#c87f3d"), ("legs", ~_ARM, "#3d6fc8")):
        own = known & chosen
        if own.any():
            order = np.argsort(sigma[own].ravel(), kind="stable")
            bins = np.array_split(order, 20)
            x = [100 * float(np.sqrt(np.mean(sigma[own].ravel()[part] ** 2))) for part in bins if part.size]
            y = [100 * float(np.sqrt(np.mean(errors[own].ravel()[part] ** 2))) for part in bins if part.size]
            right.plot(x, y, "o-", color=color, label=name, markersize=4)
    reach = [0.5, 20.0]
    right.plot(reach, reach, color="#333333", linestyle="--", linewidth=1.0)
    right.set(xscale="log", yscale="log", xlabel="standard deviation [cm]", ylabel="root mean square error [cm]")
    right.legend(frameon=False, fontsize=8)
    save_figure(figure, path)
