"""Tables and a picture of an evaluation: what was measured, sequence by sequence and over all of them."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from voodoo import metrics
from voodoo.evaluate import LIMIT_EXACT_M, LIMIT_REFERENCE_M, FrameTable, Score

CLASSES = (0, 1, 2)
_CLASS_COLORS = ("#c8553d", "#e8b04b", "#4c8c6b")


@dataclass(frozen=True)
class Summary:
    """Means over sequences of one kind, every sequence counting the same; metres and shares, NaN where unknown.

    Args:
        kind: "exact truth", "reference skeleton" or "no reference".
        sequences: how many were tracked to their end.
        failures: how many were not.
        classes: how many in class 0, 1 and 2 of K06 Table I.
        lags: (lag [frames], sequences) for each best lag that occurs.
        means: by the name of the Score field; with "_together" behind it, over the limbs of all sequences.
    """

    kind: str
    sequences: int
    failures: int
    classes: tuple[int, int, int]
    lags: tuple[tuple[int, int], ...]
    means: dict[str, float]

    @property
    def class_average(self) -> float:
        """Mean class; NaN when no sequence has one."""
        count = sum(self.classes)
        return (
            sum(value * number for value, number in zip(CLASSES, self.classes, strict=True)) / count
            if count
            else math.nan
        )


_MEANS = (
    "error_m", "error_lag0_m", "error_best_lag_m", "within_5cm", "within_10cm", "depth_within_5cm", "depth_median_m",
    "depth_p95_m", "person_within_5cm", "silhouette_iou", "jitter_m", "reference_jitter_m", "standing_jitter_m",
    "reference_standing_jitter_m", "degraded_share", "lost_share", "far_told", "near_doubted", "step_s",
)  # fmt: skip

_TOGETHER = {"far_told": "far_ends", "near_doubted": "near_ends"}
"""Shares that are also taken of all sequences together, because some have few such limbs, and what they are shares of."""

_SUMMARY = (*_MEANS, *(f"{name}_together" for name in _TOGETHER))

_LINES: tuple[tuple[str, str, Callable[[float], str]], ...] = (
    ("error_m", "mean joint error", lambda value: f"{100 * value:.1f} cm"),
    ("error_lag0_m", "... at lag 0", lambda value: f"{100 * value:.1f} cm"),
    ("error_best_lag_m", "... at the best lag", lambda value: f"{100 * value:.1f} cm"),
    ("within_5cm", "joints within 5 cm", lambda value: f"{100 * value:.1f} %"),
    ("within_10cm", "joints within 10 cm", lambda value: f"{100 * value:.1f} %"),
    ("depth_within_5cm", "depth within 5 cm of the model", lambda value: f"{100 * value:.1f} %"),
    ("depth_median_m", "depth to model, median", lambda value: f"{1000 * value:.1f} mm"),
    ("depth_p95_m", "depth to model, 95th percentile", lambda value: f"{1000 * value:.1f} mm"),
    ("person_within_5cm", "within 5 cm, of depth about the known joints", lambda value: f"{100 * value:.1f} %"),
    ("silhouette_iou", "silhouette IoU", lambda value: f"{value:.3f}"),
    ("jitter_m", "second difference of the joints", lambda value: f"{1000 * value:.1f} mm"),
    ("reference_jitter_m", "... of the reference", lambda value: f"{1000 * value:.1f} mm"),
    ("standing_jitter_m", "second difference where the reference stands still", lambda value: f"{1000 * value:.1f} mm"),
    ("reference_standing_jitter_m", "... of the reference itself there", lambda value: f"{1000 * value:.1f} mm"),
    ("degraded_share", "frames called degraded", lambda value: f"{100 * value:.1f} %"),
    ("lost_share", "frames called lost", lambda value: f"{100 * value:.1f} %"),
    ("far_told", "limbs off by 10 cm and not called measured", lambda value: f"{100 * value:.0f} %"),
    ("near_doubted", "nearer limbs not called measured", lambda value: f"{100 * value:.1f} %"),
    ("far_told_together", "limbs off by 10 cm, all sequences together", lambda value: f"{100 * value:.1f} %"),
    ("near_doubted_together", "nearer limbs, all sequences together", lambda value: f"{100 * value:.1f} %"),
    ("step_s", "time of a frame", lambda value: f"{1000 * value:.2f} ms"),
)


def summarize(scores: Sequence[Score]) -> list[Summary]:
    """One summary for each kind of comparison that occurs; failures are counted with the kind "no reference" unless
    something was known about them."""
    kinds = {True: "exact truth", False: "reference skeleton", None: "no reference"}
    summaries = []
    for exact, kind in kinds.items():
        group = [score for score in scores if score.exact is exact]
        done = [score for score in group if not score.failure]
        if group:
            lags = [score.best_lag for score in done if score.best_lag is not None]
            counts = [sum(score.tracking_class == value for score in done) for value in CLASSES]
            means = {
                name: metrics.mean_or_nan(np.array([getattr(s, name) for s in done] or [np.nan])) for name in _MEANS
            }
            means |= {f"{name}_together": _together(done, name, count) for name, count in _TOGETHER.items()}
            summaries.append(
                Summary(
                    kind=kind if done else "not tracked",
                    sequences=len(done),
                    failures=len(group) - len(done),
                    classes=(counts[0], counts[1], counts[2]),
                    lags=tuple((lag, lags.count(lag)) for lag in sorted(set(lags))),
                    means=means,
                )
            )
    return summaries


def markdown(scores: Sequence[Score]) -> str:
    """The table over all sequences, the joints, and a line for each sequence, as Markdown."""
    text = []
    for summary in summarize(scores):
        text += [
            f"## Against {summary.kind}: {summary.sequences} sequences\n" if summary.sequences else "## Not tracked\n"
        ]
        if summary.sequences:
            zero, one, two = summary.classes
            text += ["| | |", "|---|---|", f"| class 0 / 1 / 2 (K06 Table I) | {zero} / {one} / {two} |"]
            text += [f"| class average | {_word(summary.class_average, lambda value: f'{value:.2f}')} |"]
            text += [f"| {words} | {_word(summary.means[name], form)} |" for name, words, form in _LINES]
            lags = ", ".join(f"{lag:+d}: {count}" for lag, count in summary.lags) or "-"
            text += [f"| best lag in frames: sequences | {lags} |", ""]
            group = [s for s in scores if not s.failure and _kind(s) == summary.kind]
            text += _joint_table(group)
        if summary.failures:
            text += [f"{summary.failures} sequences could not be tracked to their end.\n"]
    text += [
        f"A joint is lost while it is farther than {100 * LIMIT_EXACT_M:.0f} cm from exact truth "
        f"({100 * LIMIT_REFERENCE_M:.0f} cm from a reference skeleton) for longer than {metrics.LOST_AFTER_S} s. "
        "Class 2: none was lost; 1: some, but all were back at the end; 0: some still lost at the end. Errors are at "
        "lag 0 against exact truth and at the best lag against a reference; a positive lag means that the estimate is "
        "late.\n"
    ]
    text += ["| sequence | frames | class | error | best lag | within 10 cm | depth within 5 cm | IoU | lost joints |"]
    text += ["|---|---|---|---|---|---|---|---|---|"]
    for score in scores:
        if score.failure:
            text.append(f"| {score.name} | - | - | {score.failure.replace('|', '/')} | | | | | |")
            continue
        cells = [
            score.name, str(score.frames), "-" if score.tracking_class is None else str(score.tracking_class),
            _word(score.error_m, lambda value: f"{100 * value:.1f} cm"),
            "-" if score.best_lag is None else f"{score.best_lag:+d}",
            _word(score.within_10cm, lambda value: f"{100 * value:.0f} %"),
            _word(score.depth_within_5cm, lambda value: f"{100 * value:.1f} %"),
            _word(score.silhouette_iou, lambda value: f"{value:.2f}"), ", ".join(score.lost_joints) or "none",
        ]  # fmt: skip
        text.append("| " + " | ".join(cells) + " |")
    return "\n".join(text) + "\n"


def write_reports(folder: Path, scores: Sequence[Score], tables: Sequence[FrameTable | None]) -> list[Path]:
    """Write sequences.csv, summary.csv, summary.md, errors.png and frames/NAME.csv; returns the first four.

    Raises:
        OSError: a file cannot be written.
    """
    (folder / "frames").mkdir(parents=True, exist_ok=True)
    for score, table in zip(scores, tables, strict=True):
        if table is not None:
            _write_frames(folder / "frames" / f"{score.name}.csv", table)
    sequences, summary, text, plot = (
        folder / name for name in ("sequences.csv", "summary.csv", "summary.md", "errors.png")
    )
    _write_sequences(sequences, scores)
    _write_summary(summary, summarize(scores))
    text.write_text(markdown(scores), encoding="utf-8")
    plot_errors(plot, scores)
    return [sequences, summary, text, plot]


def plot_errors(path: Path, scores: Sequence[Score]) -> None:
    """Error over the sequences, coloured by class, beside how many are in each class."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    done = [score for score in scores if np.isfinite(score.error_m) and score.tracking_class is not None]
    figure = Figure(figsize=(11.0, 4.2), layout="constrained")
    FigureCanvasAgg(figure)
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
    for axes in (left, right):
        axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(path, dpi=130)


def _joint_table(scores: Sequence[Score]) -> list[str]:
    names = ("shoulder", "elbow", "wrist", "hip", "knee", "ankle")
    lines = ["| mean error, cm | " + " | ".join(names) + " |", "|---|" + "---|" * len(names)]
    for side, word in (("l", "left"), ("r", "right")):
        means = [
            metrics.mean_or_nan(np.array([score.joint_error_m[f"{side}_{name}"] for score in scores])) for name in names
        ]
        lines.append(
            f"| {word} | " + " | ".join(_word(mean, lambda value: f"{100 * value:.1f}") for mean in means) + " |"
        )
    return [*lines, ""]


def _together(scores: Sequence[Score], name: str, count: str) -> float:
    """Share over all sequences, each counted by how many there are of what it is a share of; NaN when there are none."""
    counts = [(getattr(score, name), getattr(score, count)) for score in scores if getattr(score, count) > 0]
    total = sum(number for _, number in counts)
    return sum(share * number for share, number in counts) / total if total else math.nan


def _kind(score: Score) -> str:
    return {True: "exact truth", False: "reference skeleton", None: "no reference"}[score.exact]


def _write_sequences(path: Path, scores: Sequence[Score]) -> None:
    header = ["name", "failure", "frames", "exact", "tracking_class", "best_lag", *_MEANS, *_TOGETHER.values()]
    header += [f"error_{name}_m" for name in metrics.JOINTS] + ["selection", "lost_joints", "path"]
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(header)
        for score in scores:
            row: list[object] = [score.name, score.failure, score.frames]
            row += [_cell(value) for value in (score.exact, score.tracking_class, score.best_lag)]
            row += [_cell(getattr(score, name)) for name in (*_MEANS, *_TOGETHER.values())]
            row += [_cell(score.joint_error_m.get(name)) for name in metrics.JOINTS]
            writer.writerow([*row, _cell(score.selection), " ".join(score.lost_joints), str(score.path)])


def _write_summary(path: Path, summaries: Sequence[Summary]) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["kind", "sequences", "failures", "class_0", "class_1", "class_2", "class_average", *_SUMMARY])
        for item in summaries:
            row = [item.kind, item.sequences, item.failures, *item.classes, _cell(item.class_average)]
            writer.writerow(row + [_cell(item.means[name]) for name in _SUMMARY])


def _write_frames(path: Path, table: FrameTable) -> None:
    header = ["stamp_s", "status", "mean_error_m", *(f"{name}_error_m" for name in metrics.JOINTS)]
    header += ["lost_joints", "depth_within_5cm", "silhouette_iou", "step_s"]
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(header)
        for index, stamp in enumerate(table.stamps):
            errors = table.errors[index]
            lost = " ".join(name for name, flag in zip(metrics.JOINTS, table.lost[index], strict=True) if flag)
            row = [repr(float(stamp)), table.status[index], _cell(metrics.mean_or_nan(errors))]
            row += [_cell(float(error)) for error in errors]
            last = (table.depth_within_5cm[index], table.silhouette_iou[index], table.step_s[index])
            writer.writerow([*row, lost, *(_cell(float(value)) for value in last)])


def _cell(value: object) -> str:
    """Text of a table cell; unknown values are empty."""
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return ""
    return f"{value:.6f}" if isinstance(value, float) else str(value)


def _word(value: float, form: Callable[[float], str]) -> str:
    return form(value) if math.isfinite(value) else "-"
