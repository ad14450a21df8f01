"""Writes the tables of an evaluation as CSV files."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from voodoo.evaluation import metrics
from voodoo.evaluation.score import FrameTable, Score
from voodoo.evaluation.summary import ALL_ROWS, ROWS, TOGETHER, Summary
from voodoo.whole import appearing_whole


def write_table(path: Path, header: Sequence[str], rows: Iterable[Iterable[object]]) -> None:
    """Write rows of values; unknown ones are empty cells."""
    with appearing_whole(path) as part, part.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(header)
        writer.writerows(map(cell, row) for row in rows)


def cell(value: object) -> str:
    """A value as text; "" if it is not known."""
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return ""
    return f"{value:.6f}" if isinstance(value, float) else str(value)


def write_sequences(path: Path, scores: Sequence[Score]) -> None:
    """A row for each recording."""
    own = ("name", "failure", "frames", "exact", "tracking_class", "best_lag", *ROWS, *TOGETHER.values())
    header = [*own, *(f"error_{name}_m" for name in metrics.JOINTS), "selection", "lost_joints", "path"]
    rows = (
        [getattr(score, name) for name in own]
        + [score.joint_error_m.get(name) for name in metrics.JOINTS]
        + [score.selection, " ".join(score.lost_joints), score.path]
        for score in scores
    )
    write_table(path, header, rows)


def write_summary(path: Path, summaries: Sequence[Summary]) -> None:
    """A row for each kind of comparison."""
    own = ("kind", "sequences", "failures", "class_0", "class_1", "class_2", "class_average")
    rows = (
        [
            one.kind,
            one.sequences,
            one.failures,
            *one.classes,
            one.class_average,
            *(one.means[name] for name in ALL_ROWS),
        ]
        for one in summaries
    )
    write_table(path, [*own, *ALL_ROWS], rows)


def write_frames(path: Path, table: FrameTable) -> None:
    """A row for each frame of a recording."""
    header = ["stamp_s", "status", "mean_error_m", *(f"{name}_error_m" for name in metrics.JOINTS)]
    header += ["lost_joints", "depth_within_5cm", "silhouette_iou", "step_s"]
    lost = [" ".join(np.array(metrics.JOINTS)[flags]) for flags in table.lost]
    columns = (
        table.stamps,
        table.status,
        table.errors,
        lost,
        table.depth_within_5cm,
        table.silhouette_iou,
        table.step_s,
    )
    rows = (
        [repr(float(stamp)), status, metrics.mean_or_nan(errors), *errors, *last]
        for stamp, status, errors, *last in zip(*columns, strict=True)
    )
    write_table(path, header, rows)
