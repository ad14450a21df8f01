"""Tables and figures of an evaluation, for each sequence and over all of them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from voodoo.evaluation import metrics
from voodoo.evaluation.calibration import Deviations, calibrate, calibration_markdown
from voodoo.evaluation.plot import plot_calibration, plot_errors
from voodoo.evaluation.score import CM, LIMIT_EXACT_M, LIMIT_REFERENCE_M, PERCENT, RATIO, FrameTable, Score, written
from voodoo.evaluation.summary import ALL_ROWS, KINDS, Summary, summarize, write_frames, write_sequences, write_summary
from voodoo.whole import write_whole


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
    text += ["| sequence | frames | class | error | best lag | within 10 cm | depth within 5 cm | IoU | lost joints |"]
    text += ["|---|---|---|---|---|---|---|---|---|"]
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
        text.append("| " + " | ".join(cells) + " |")
    text += [f"\n{score.name}: {' '.join(score.failure.split())}" for score in scores if score.failure]
    return "\n".join(text) + "\n"


_BRIEF = (
    "error_m", "first_pose_s", "within_10cm", "depth_within_5cm", "silhouette_iou", "angle_error_deg", "lost_share",
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
    files = [folder / name for name in ("sequences.csv", "summary.csv", "summary.md")]
    write_sequences(files[0], scores)
    write_summary(files[1], summarize(scores))
    write_whole(files[2], markdown(scores, tables))
    if picture:
        files.append(folder / "errors.png")
        plot_errors(files[-1], scores)
        known = [each for group in deviations_of(scores, tables).values() for each in group]
        if calibrate(known) is not None:
            files.append(folder / "calibration.png")
            plot_calibration(files[-1], known)
    return files


def _joint_table(scores: Sequence[Score]) -> list[str]:
    names = ("shoulder", "elbow", "wrist", "hip", "knee", "ankle")
    lines = ["| mean error, cm | " + " | ".join(names) + " |", "|---|" + "---|" * len(names)]
    for side, word in (("l", "left"), ("r", "right")):
        means = [
            metrics.mean_or_nan(np.array([score.joint_error_m[f"{side}_{name}"] for score in scores])) for name in names
        ]
        lines.append(f"| {word} | " + " | ".join(written(mean, (100.0, ".1f", "")) for mean in means) + " |")
    return [*lines, ""]
