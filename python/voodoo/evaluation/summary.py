"""Means over sequences of one kind."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from voodoo.evaluation import metrics
from voodoo.evaluation.score import PERCENT, Form, Score

CLASSES = (0, 1, 2)
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
            means |= {f"{name}_together": _together(done, name, count) for name, count in TOGETHER.items()}
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


def _together(scores: Sequence[Score], name: str, count: str) -> float:
    """Fraction over all sequences, weighted by their totals; NaN if these are zero."""
    counts = [(getattr(score, name), getattr(score, count)) for score in scores if getattr(score, count) > 0]
    total = sum(number for _, number in counts)
    return sum(fraction * number for fraction, number in counts) / total if total else math.nan
