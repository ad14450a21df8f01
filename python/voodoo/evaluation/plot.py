"""Plots the errors of all sequences."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from voodoo.evaluation.figure import new_figure, save_figure
from voodoo.evaluation.score import Score
from voodoo.evaluation.summary import CLASSES

_CLASS_COLORS = ("#c8553d", "#e8b04b", "#4c8c6b")


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
