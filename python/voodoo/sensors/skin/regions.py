"""Candidates for heads and hands in an image."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, eq=False)
class Candidate:
    """A pixel where a head or hand may be.

    Args:
        pixel: (u, v).
        region: label of its region.
        area: of that region [px].
        hand: False for the center of a region longer than a hand, which may be a face but not a hand.
    """

    pixel: tuple[float, float]
    region: int
    area: int
    hand: bool = True
