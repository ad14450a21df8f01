"""One-to-one assignment of unlabelled candidates to predicted sites."""

from __future__ import annotations

import numpy as np
from scipy.optimize import linear_sum_assignment

from voodoo.sensors.pixels import FloatArray


def assign(cost: FloatArray, *, gate: float, none: float | None = None) -> list[tuple[int, int]]:
    """Pairs (site, candidate), each used once at most, that lie within the gate.

    As many pairs as possible within the gate, and of those the ones with the least sum of squared distances; a
    candidate or site without a partner stays alone.

    Args:
        cost: (S, C) distances [m]; infinite or NaN = impossible.
        gate: [m].
        none: squared distance at which a site is rather left alone; None: as many pairs as possible.
    """
    if cost.size == 0:
        return []
    squared = np.where(np.isfinite(cost) & (cost <= gate), cost, np.inf) ** 2
    if none is not None:
        alone = np.full((len(squared), len(squared)), none)
        large = gate**2 + none * (len(squared) + 1.0)
        padded = np.hstack([np.where(np.isfinite(squared), squared, large), alone])
        rows, columns = linear_sum_assignment(padded)
        return [
            (int(row), int(column))
            for row, column in zip(rows, columns, strict=True)
            if column < squared.shape[1] and np.isfinite(squared[row, column])
        ]
    # Beyond the gate a pair is as good as none; the price of none is one no sum within the gate can reach.
    none = gate**2 * (min(cost.shape) + 1.0)
    rows, columns = linear_sum_assignment(np.where(np.isfinite(squared), squared, none))
    return [
        (int(row), int(column)) for row, column in zip(rows, columns, strict=True) if np.isfinite(squared[row, column])
    ]
