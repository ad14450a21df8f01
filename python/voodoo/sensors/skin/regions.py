"""Where in a picture a head or a hand may be."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, eq=False)
class Candidate:
    """A place in the image where a head or hand may be.

    Args:
        pixel: (u, v).
        region: number of the region it is of.
        area: of that region [px].
        hand: False for the middle of a region that is longer than a hand: it may be a face, but not a hand.
    """

    pixel: tuple[float, float]
    region: int
    area: int
    hand: bool = True
