"""Tables of an evaluation, for each sequence and over all of them, and figures, by Matplotlib, which is optional."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from voodoo.errors import installed
from voodoo.evaluation import metrics
from voodoo.evaluation.calibration import Deviations, by_sigma, calibrate, calibration_markdown, groups
from voodoo.evaluation.score import CM, LIMIT_EXACT_M, LIMIT_REFERENCE_M, PERCENT, RATIO, FrameTable, Score, written
from voodoo.evaluation.summary import ALL_ROWS, CLASSES, KINDS, Summary, summarize, table_head, table_row, write_tables
from voodoo.whole import appearing_whole, write_whole


def markdown(scores: Sequence[Score], tables: Sequence[FrameTable | None] = ()) -> str:
    """Tables over all sequences, over joints, and with a row per sequence, as Markdown; with `tables` (one per score) also a
    comparison of errors with their standard deviations."""
    text = []
    deviations = deviations_of(scores, tables)
    for summary in summarize(scores):
        text += _head(summary) if summary.sequences else ["## Not tracked\n"]
        if summary.sequences:
            text += [f"| class average | {written(summary.class_average, RATIO)} |"]
            text += _rows(summary, ALL_ROWS)
            lags = ", ".join(f"{lag:+d}: {count}" for lag, count in summary.lags) or "-"
            text += [f"| best lag in frames: sequences | {lags} |", ""]
            group = [s for s in scores if not s.failure and KINDS[s.exact] == summary.kind]
            text += _joint_table(group)
            calibration = calibrate(deviations.get(summary.kind, ()))
            if calibration is not None:
                text += [calibration_markdown(calibration, summary.kind)]
        if summary.failures:
            text += [f"{summary.failures} sequences could not be tracked to their end.\n"]
    text += [
        f"A joint is lost while it is farther than {100 * LIMIT_EXACT_M:.0f} cm from exact truth "
        f"({100 * LIMIT_REFERENCE_M:.0f} cm from a reference skeleton) for longer than {metrics.LOST_AFTER_S} s. "
        "Class 2: none was lost; 1: some, but all were back at the end; 0: some still lost at the end. Errors are at "
        "lag 0 against exact truth and at the best lag against a reference; a positive lag means that the estimate is "
        "late.\n"
    ]
    columns = "sequence, frames, class, error, best lag, within 10 cm, depth within 5 cm, IoU, lost joints"
    text += table_head(columns.split(", "))
    for score in scores:
        if score.failure:
            text.append(f"| {score.name} | - | - | failed, see below | | | | | |")
            continue
        cells = [
            score.name, str(score.frames), "-" if score.tracking_class is None else str(score.tracking_class),
            written(score.error_m, CM), "-" if score.best_lag is None else f"{score.best_lag:+d}",
            written(score.within_10cm, (100.0, ".0f", " %")), written(score.depth_within_5cm, PERCENT),
            written(score.silhouette_iou, RATIO), ", ".join(score.lost_joints) or "none",
        ]  # fmt: skip
        text.append(table_row(cells))
    return "\n".join([*text, *_failures(scores)]) + "\n"


_BRIEF = (
    "error_m", "first_pose_s", "within_10cm", "depth_within_5cm", "silhouette_iou", "angle_error_deg", "lost_share",
    "searching_share", "step_s",
)  # fmt: skip
"""What the first screen tells beside the classes."""


def _head(summary: Summary) -> list[str]:
    """The heading of a table, and its first row."""
    return [
        f"## Against {summary.kind}: {summary.sequences} sequence{'s' * (summary.sequences > 1)}\n",
        "| | |",
        "|---|---|",
        f"| class 0 / 1 / 2 (K06 Table I) | {' / '.join(map(str, summary.classes))} |",
    ]


def _rows(summary: Summary, names: Iterable[str]) -> list[str]:
    rows = [(ALL_ROWS[name], summary.means[name]) for name in names]
    return [f"| {words} | {written(mean, form)} |" for (words, form), mean in rows]


def brief(scores: Sequence[Score]) -> str:
    """The ten rows of `markdown` that tell most, for each kind of comparison, and the failures."""
    text = []
    for summary in summarize(scores):
        if summary.sequences:
            text += _head(summary)
            text += _rows(summary, _BRIEF)
    return "\n".join([*text, *_failures(scores)])


def _failures(scores: Sequence[Score]) -> list[str]:
    return [f"\n{score.name}: {' '.join(score.failure.split())}" for score in scores if score.failure]


def deviations_of(scores: Sequence[Score], tables: Sequence[FrameTable | None]) -> dict[str, list[Deviations]]:
    """Errors and standard deviations, grouped by kind of reference."""
    found: dict[str, list[Deviations]] = {}
    for score, table in zip(scores, tables, strict=False):
        if table is not None and table.deviations is not None:
            found.setdefault(KINDS[score.exact], []).append(table.deviations)
    return found


def write_reports(
    folder: Path, scores: Sequence[Score], tables: Sequence[FrameTable | None], *, picture: bool = True
) -> list[Path]:
    """Write sequences.csv, summary.csv, summary.md, with `picture` errors.png and calibration.png (the latter if joints were
    compared with a reference), and frames/NAME.csv (NAME~2.csv of the second recording with a name); returns all but the last.

    Raises:
        OSError: a file cannot be written.
    """
    files = [*write_tables(folder, scores, tables), folder / "summary.md"]
    write_whole(files[-1], markdown(scores, tables))
    if picture:
        files.append(folder / "errors.png")
        plot_errors(files[-1], scores)
        known = [each for group in deviations_of(scores, tables).values() for each in group]
        if calibrate(known) is not None:
            files.append(folder / "calibration.png")
            plot_calibration(files[-1], known)
    return files


def _joint_table(scores: Sequence[Score]) -> list[str]:
    lines = table_head(("mean error, cm", *metrics.LIMB_JOINTS))
    for side, word in (("l", "left"), ("r", "right")):
        joints = (f"{side}_{joint}" for joint in metrics.LIMB_JOINTS)
        errors = (np.array([score.joint_error_m[joint] for score in scores]) for joint in joints)
        lines.append(table_row((word, *(written(metrics.mean_or_nan(each), (100.0, ".1f", "")) for each in errors))))
    return [*lines, ""]


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
    grouped = groups(found)
    figure = new_figure(9.6, 4.2)
    left, right = figure.subplots(1, 2)
    steps = np.linspace(0.0, 4.0, 81)
    normal = [math.erf(step / math.sqrt(2.0)) for step in steps]
    left.plot(steps, normal, color="#333333", linestyle="--", linewidth=1.0, label="normal distribution")
    colors = {"shoulders and hips": "#7a8ca3", "ends of measured limbs": "#4c8c6b", "ends of other limbs": "#c8553d"}
    for name, color in colors.items():
        errors, sigma = grouped[name]
        if errors.size:
            ratios = np.sort((np.abs(errors) / sigma).ravel())
            left.plot(steps, np.searchsorted(ratios, steps, side="right") / ratios.size, color=color, label=name)
    left.set_xlabel("standard deviations")
    left.set_ylabel("share of errors within")
    left.legend(frameon=False, fontsize=8)
    for name, color in (("arms", "#c87f3d"), ("legs", "#3d6fc8")):
        bins = [part for part in by_sigma(*grouped[name], parts=20) if part[0].size]
        y, x = ([100 * float(np.sqrt(np.mean(part[each] ** 2))) for part in bins] for each in (0, 1))
        if bins:
            right.plot(x, y, "o-", color=color, label=name, markersize=4)
    reach = [0.5, 20.0]
    right.plot(reach, reach, color="#333333", linestyle="--", linewidth=1.0)
    right.set(xscale="log", yscale="log", xlabel="standard deviation [cm]", ylabel="root mean square error [cm]")
    right.legend(frameon=False, fontsize=8)
    save_figure(figure, path)
