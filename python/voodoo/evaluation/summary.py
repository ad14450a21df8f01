"""Means over sequences of one kind, and the tables of an evaluation as CSV files."""

from __future__ import annotations

import csv
import io
import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from voodoo.evaluation import metrics
from voodoo.evaluation.score import PERCENT, Form, FrameTable, Score
from voodoo.whole import write_whole

CLASSES = range(3)
KINDS = {True: "exact truth", False: "reference skeleton", None: "no reference"}
"""What a sequence is compared with, by `Score.exact`."""


@dataclass(frozen=True)
class Summary:
    """Means over sequences of one kind, with equal weights; meters and fractions, NaN if unknown.

    Args:
        kind: "exact truth", "reference skeleton" or "no reference".
        sequences: number tracked to their end.
        failures: number of the others.
        classes: numbers in class 0, 1 and 2 of K06 Table I.
        lags: (lag [frames], sequences) for each best lag that occurs.
        means: by the name of the Score field; with the suffix "_together" over the limbs of all sequences.
    """

    kind: str
    sequences: int
    failures: int
    classes: tuple[int, int, int]
    lags: tuple[tuple[int, int], ...]
    means: dict[str, float]

    @property
    def class_average(self) -> float:
        """Mean class; NaN if no sequence has one."""
        return metrics.mean_or_nan(np.repeat(np.array(CLASSES, dtype=np.float64), self.classes))


ROWS: dict[str, tuple[str, Form]] = {item.name: item.metadata["row"] for item in fields(Score) if item.metadata}
"""Means, by the name of the field of Score: words and form of their rows."""
TOGETHER = {"lost_recall": "far_ends", "false_alarm_rate": "near_ends"}
"""Fractions that are also computed over all sequences together, because some have few such limbs, and their totals."""
ALL_ROWS = ROWS | {
    "lost_recall_together": ("limbs off by 10 cm, all sequences together", PERCENT),
    "false_alarm_rate_together": ("nearer limbs, all sequences together", PERCENT),
}


def summarize(scores: Sequence[Score]) -> list[Summary]:
    """One summary for each kind of comparison; failures have the kind "no reference", unless their kind is known."""
    summaries = []
    for exact, kind in KINDS.items():
        group = [score for score in scores if score.exact is exact]
        done = [score for score in group if not score.failure]
        if group:
            lags = [score.best_lag for score in done if score.best_lag is not None]
            counts = [sum(score.tracking_class == value for score in done) for value in CLASSES]
            means = {name: metrics.mean_or_nan(np.array([getattr(s, name) for s in done] or [np.nan])) for name in ROWS}
            means |= {f"{name}_together": metrics.weighted(done, name, count) for name, count in TOGETHER.items()}
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


def table_text(header: Sequence[str], rows: Iterable[Iterable[object]]) -> str:
    """Rows of values as CSV; unknown ones are empty cells."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    writer.writerows(map(cell, row) for row in rows)
    return text.getvalue()


def table_row(cells: Iterable[str]) -> str:
    """A row of a table in Markdown."""
    return f"| {' | '.join(cells)} |"


def table_head(names: Iterable[str]) -> list[str]:
    """The first two rows of a table in Markdown."""
    row = table_row(names)
    return [row, "|" + "---|" * (row.count("|") - 1)]


def cell(value: object) -> str:
    """A value as text; "" if it is not known."""
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return ""
    return f"{value:.6f}" if isinstance(value, float) else str(value)


def write_tables(folder: Path, scores: Sequence[Score], tables: Sequence[FrameTable | None]) -> list[Path]:
    """Write sequences.csv and summary.csv, which are returned, and frames/NAME.csv, see `voodoo.evaluation.report.write_reports`.

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
    files = [folder / "sequences.csv", folder / "summary.csv"]
    write_sequences(files[0], scores)
    write_summary(files[1], summarize(scores))
    return files


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
    write_whole(path, table_text(header, rows))


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
    write_whole(path, table_text([*own, *ALL_ROWS], rows))


def write_frames(path: Path, table: FrameTable) -> None:
    """A row for each frame of a recording."""
    header = ["stamp_s", "status", "mean_error_m", *(f"{name}_error_m" for name in metrics.JOINTS)]
    numbers = ("depth_within_5cm", "silhouette_iou", "step_s")
    lost = [" ".join(np.array(metrics.JOINTS)[flags]) for flags in table.lost]
    columns = (table.stamps, table.status, table.errors, lost, *(getattr(table, name) for name in numbers))
    rows = (
        [repr(float(stamp)), status, metrics.mean_or_nan(errors), *errors, *last]
        for stamp, status, errors, *last in zip(*columns, strict=True)
    )
    write_whole(path, table_text([*header, "lost_joints", *numbers], rows))
