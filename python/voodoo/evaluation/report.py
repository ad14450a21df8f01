"""Tables and figures of an evaluation, for each sequence and over all of them."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from voodoo.evaluation import metrics
from voodoo.evaluation.calibration import Deviations, calibrate, calibration_markdown, plot_calibration
from voodoo.evaluation.plot import plot_errors
from voodoo.evaluation.score import LIMIT_EXACT_M, LIMIT_REFERENCE_M, FrameTable, Score
from voodoo.evaluation.summary import KINDS, Summary, summarize
from voodoo.evaluation.tables import write_frames, write_sequences, write_summary
from voodoo.whole import write_whole

_LINES: tuple[tuple[str, str, Callable[[float], str]], ...] = (
    ("error_m", "mean joint error", lambda value: f"{100 * value:.1f} cm"),
    ("error_lag0_m", "... at lag 0", lambda value: f"{100 * value:.1f} cm"),
    ("error_best_lag_m", "... at the best lag", lambda value: f"{100 * value:.1f} cm"),
    ("error_without_offsets_m", "... each joint's constant offset removed", lambda value: f"{100 * value:.1f} cm"),
    ("class_without_offsets", "... class average of that error", lambda value: f"{value:.2f}"),
    ("lost_without_offsets", "... sequences that end with a joint lost by it", lambda value: f"{100 * value:.1f} %"),
    ("first_pose_s", "first pose after", lambda value: f"{value:.2f} s"),
    ("first_pose_error_m", "mean error in the first pose", lambda value: f"{100 * value:.1f} cm"),
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
    ("angle_error_deg", "error of the joint angles", lambda value: f"{value:.1f} deg"),
    ("angle_spread_deg", "... its standard deviation", lambda value: f"{value:.1f} deg"),
    ("degraded_share", "frames called degraded", lambda value: f"{100 * value:.1f} %"),
    ("lost_share", "frames called lost", lambda value: f"{100 * value:.1f} %"),
    ("searching_share", "frames without a pose", lambda value: f"{100 * value:.1f} %"),
    ("lost_recall", "limbs off by 10 cm and not called measured", lambda value: f"{100 * value:.0f} %"),
    ("false_alarm_rate", "nearer limbs not called measured", lambda value: f"{100 * value:.1f} %"),
    ("lost_recall_together", "limbs off by 10 cm, all sequences together", lambda value: f"{100 * value:.1f} %"),
    ("false_alarm_rate_together", "nearer limbs, all sequences together", lambda value: f"{100 * value:.1f} %"),
    ("left_out_share", "joints of the reference left out, their bones off", lambda value: f"{100 * value:.1f} %"),
    ("step_s", "time of a frame", lambda value: f"{1000 * value:.2f} ms"),
)


def markdown(scores: Sequence[Score], tables: Sequence[FrameTable | None] = ()) -> str:
    """Tables over all sequences, over joints, and with a row per sequence, as Markdown; with `tables` (one per score) also a
    comparison of errors with their standard deviations."""
    text = []
    deviations = deviations_of(scores, tables)
    for summary in summarize(scores):
        text += _head(summary) if summary.sequences else ["## Not tracked\n"]
        if summary.sequences:
            text += [f"| class average | {_word(summary.class_average, lambda value: f'{value:.2f}')} |"]
            text += [f"| {words} | {_word(summary.means[name], form)} |" for name, words, form in _LINES]
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
    text += ["| sequence | frames | class | error | best lag | within 10 cm | depth within 5 cm | IoU | lost joints |"]
    text += ["|---|---|---|---|---|---|---|---|---|"]
    for score in scores:
        if score.failure:
            text.append(f"| {score.name} | - | - | failed, see below | | | | | |")
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
    text += [f"\n{score.name}: {' '.join(score.failure.split())}" for score in scores if score.failure]
    return "\n".join(text) + "\n"


_BRIEF = (
    "error_m", "within_10cm", "depth_within_5cm", "silhouette_iou", "angle_error_deg", "first_pose_s", "lost_share",
    "searching_share", "step_s",
)  # fmt: skip
"""What the first screen tells beside the classes."""


def _head(summary: Summary) -> list[str]:
    """The heading of a table, and its first row."""
    zero, one, two = summary.classes
    return [
        f"## Against {summary.kind}: {summary.sequences} sequence{'s' * (summary.sequences > 1)}\n",
        "| | |",
        "|---|---|",
        f"| class 0 / 1 / 2 (K06 Table I) | {zero} / {one} / {two} |",
    ]


def brief(scores: Sequence[Score]) -> str:
    """The ten rows of `markdown` that tell most, for each kind of comparison, and the failures."""
    text = []
    for summary in summarize(scores):
        if summary.sequences:
            text += _head(summary)
            text += [
                f"| {words} | {_word(summary.means[name], form)} |" for name, words, form in _LINES if name in _BRIEF
            ]
    text += [f"\n{score.name}: {' '.join(score.failure.split())}" for score in scores if score.failure]
    return "\n".join(text)


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
    (folder / "frames").mkdir(parents=True, exist_ok=True)
    names: Counter[str] = Counter()
    for score, table in zip(scores, tables, strict=True):
        names[score.name] += 1
        again = f"~{names[score.name]}" if names[score.name] > 1 else ""
        if table is not None:
            write_frames(folder / "frames" / f"{score.name}{again}.csv", table)
    sequences, summary, text, plot = (
        folder / name for name in ("sequences.csv", "summary.csv", "summary.md", "errors.png")
    )
    write_sequences(sequences, scores)
    write_summary(summary, summarize(scores))
    write_whole(text, markdown(scores, tables))
    if not picture:
        return [sequences, summary, text]
    plot_errors(plot, scores)
    files = [sequences, summary, text, plot]
    known = [each for group in deviations_of(scores, tables).values() for each in group]
    if calibrate(known) is not None:
        plot_calibration(folder / "calibration.png", known)
        files.append(folder / "calibration.png")
    return files


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


def _word(value: float, form: Callable[[float], str]) -> str:
    return form(value) if math.isfinite(value) else "-"
