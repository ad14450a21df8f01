"""Writes the tables of an evaluation as CSV files."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from pathlib import Path

from voodoo.evaluation import metrics
from voodoo.evaluation.score import FrameTable, Score
from voodoo.evaluation.summary import MEANS, SUMMARY, TOGETHER, Summary
from voodoo.whole import appearing_whole


def write_sequences(path: Path, scores: Sequence[Score]) -> None:
    """A row for each recording."""
    header = ["name", "failure", "frames", "exact", "tracking_class", "best_lag", *MEANS, *TOGETHER.values()]
    header += [f"error_{name}_m" for name in metrics.JOINTS] + ["selection", "lost_joints", "path"]
    with appearing_whole(path) as part, part.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(header)
        for score in scores:
            row: list[object] = [score.name, score.failure, score.frames]
            row += [_cell(value) for value in (score.exact, score.tracking_class, score.best_lag)]
            row += [_cell(getattr(score, name)) for name in (*MEANS, *TOGETHER.values())]
            row += [_cell(score.joint_error_m.get(name)) for name in metrics.JOINTS]
            writer.writerow([*row, _cell(score.selection), " ".join(score.lost_joints), str(score.path)])


def write_summary(path: Path, summaries: Sequence[Summary]) -> None:
    """A row for each kind of comparison."""
    with appearing_whole(path) as part, part.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["kind", "sequences", "failures", "class_0", "class_1", "class_2", "class_average", *SUMMARY])
        for item in summaries:
            row = [item.kind, item.sequences, item.failures, *item.classes, _cell(item.class_average)]
            writer.writerow(row + [_cell(item.means[name]) for name in SUMMARY])


def write_frames(path: Path, table: FrameTable) -> None:
    """A row for each frame of a recording."""
    header = ["stamp_s", "status", "mean_error_m", *(f"{name}_error_m" for name in metrics.JOINTS)]
    header += ["lost_joints", "depth_within_5cm", "silhouette_iou", "step_s"]
    with appearing_whole(path) as part, part.open("w", newline="", encoding="utf-8") as file:
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
