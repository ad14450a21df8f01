"""Where rays, each an origin and a unit direction, pass one another."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from voodoo.model.joint import FloatArray

PARALLEL = 1e-3
"""Rays whose directions differ by less than 2 degrees (sine squared) do not determine a position."""


def passing(
    a: FloatArray, along_a: FloatArray, b: FloatArray, along_b: FloatArray, *, parallel: float = PARALLEL
) -> tuple[FloatArray, FloatArray, npt.NDArray[np.bool_]]:
    """Of the pairs of rays that are not parallel: distances (M,) at which they pass, the points (M, 3) halfway between them, and
    whether these are ahead of both origins (M,). No ray reaches behind its origin.

    Args:
        a, b: origins (3,) or (N, 3).
        along_a, along_b: directions (N, 3); NaN where there is no ray.
        parallel: squared sine of the angle between two rays below which they are parallel.
    """
    base, cosine = b - a, (along_a * along_b).sum(axis=1)
    crossing = np.where(1.0 - cosine**2 < parallel, np.nan, 1.0 - cosine**2)
    to_a, to_b = (along_a * base).sum(axis=1), (along_b * base).sum(axis=1)
    on_a, on_b = (to_a - cosine * to_b) / crossing, (cosine * to_a - to_b) / crossing
    place_a, place_b = a + np.maximum(on_a, 0.0)[:, None] * along_a, b + np.maximum(on_b, 0.0)[:, None] * along_b
    away = np.linalg.norm(place_a - place_b, axis=1)
    known = np.isfinite(away)
    return away[known], ((place_a + place_b) / 2.0)[known], ((on_a > 0.0) & (on_b > 0.0))[known]
