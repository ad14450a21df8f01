"""Pictures of an evaluation, by Matplotlib, which is optional."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from voodoo.errors import installed
from voodoo.evaluation.calibration import ARM, TRUNK, Deviations, together
from voodoo.evaluation.score import Score
from voodoo.evaluation.summary import CLASSES
from voodoo.whole import appearing_whole

_CLASS_COLORS = ("#c8553d", "#e8b04b", "#4c8c6b")


def new_figure(width: float, height: float) -> Any:  # noqa: ANN401 - of a library that may not be there
    """An empty figure of Matplotlib, which is optional; sizes in inches.

    Raises:
        VoodooError: Matplotlib is not installed; says how to install it.
    """
    missing = "pictures of an evaluation need Matplotlib: pip install 'voodoo-tracker[eval]'"
    figure = installed("matplotlib.figure", missing).Figure(figsize=(width, height), layout="constrained")
    installed("matplotlib.backends.backend_agg", missing).FigureCanvasAgg(figure)
    return figure


def save_figure(figure: Any, path: Path) -> None:  # noqa: ANN401
    """Write a figure, without the frames of its axes on top and on the right."""
    for axes in figure.axes:
        axes.spines[["top", "right"]].set_visible(False)
    with appearing_whole(path) as place:
        figure.savefig(place, dpi=130)


def plot_errors(path: Path, scores: Sequence[Score]) -> None:
    """Plot the error of each sequence, colored by class, and the number of sequences in each class."""
    figure = new_figure(11.0, 4.2)
    done = [score for score in scores if np.isfinite(score.error_m) and score.tracking_class is not None]
    left, right = figure.subplots(1, 2, width_ratios=(4, 1))
    colors = [_CLASS_COLORS[score.tracking_class or 0] for score in done]
    left.bar(range(len(done)), [100.0 * score.error_m for score in done], color=colors, width=0.9)
    left.set_ylabel("mean error of twelve joints [cm]")
    left.margins(x=0.01)
    if len(done) <= 40:
        left.set_xticks(range(len(done)), [score.name for score in done], rotation=30, ha="right", fontsize=8)
    else:
        left.set_xlabel("sequence, in the order of sequences.csv")
    if done:
        mean = float(np.mean([100.0 * score.error_m for score in done]))
        left.axhline(mean, color="#333333", linewidth=1.0, linestyle="--", label=f"mean {mean:.1f} cm")
        left.legend(frameon=False)
    counts = [sum(score.tracking_class == value for score in done) for value in CLASSES]
    bars = right.bar([str(value) for value in CLASSES], counts, color=_CLASS_COLORS)
    right.bar_label(bars)
    right.margins(y=0.12)
    right.set_xlabel("class (2: never lost, 0: lost at the end)", fontsize=8)
    right.set_ylabel("sequences")
    save_figure(figure, path)


def plot_calibration(path: Path, found: Sequence[Deviations]) -> None:
    """Plot the cumulative distribution of normalized errors, and error over standard deviation."""
    errors, sigma, measured, known = together(found)
    figure = new_figure(9.6, 4.2)
    left, right = figure.subplots(1, 2)
    steps = np.linspace(0.0, 4.0, 81)
    normal = [math.erf(step / math.sqrt(2.0)) for step in steps]
    left.plot(steps, normal, color="#333333", linestyle="--", linewidth=1.0, label="normal distribution")
    groups = (
        ("shoulders and hips", np.broadcast_to(TRUNK, known.shape), "#7a8ca3"),
        ("measured limbs", ~TRUNK & measured, "#4c8c6b"),
        ("other limbs", ~TRUNK & ~measured, "#c8553d"),
    )
    for name, chosen, color in groups:
        own = known & chosen
        if own.any():
            ratios = np.sort((np.abs(errors[own]) / sigma[own]).ravel())
            left.plot(steps, np.searchsorted(ratios, steps, side="right") / ratios.size, color=color, label=name)
    left.set_xlabel("standard deviations")
    left.set_ylabel("share of errors within")
    left.legend(frameon=False, fontsize=8)
    for name, chosen, color in (("arms", ARM, "#c87f3d"), ("legs", ~ARM, "#3d6fc8")):
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
