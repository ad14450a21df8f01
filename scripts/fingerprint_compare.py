"""Comparing the results of two builds, bit by bit."""

from __future__ import annotations

import gzip
import pickle
from array import array
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

PARTS = ("call", "poses", "sites", "status", "residuals")


@dataclass(frozen=True)
class Difference:
    """How the results of one case differ.

    Args:
        frames: results compared.
        what: the parts that differ; empty: the same.
        first: number of the first result that differs.
        pose_mm: greatest difference of a limb's place along an axis [mm]; 0 where only its direction differs.
    """

    frames: int
    what: tuple[str, ...]
    first: int | None = None
    pose_mm: float = 0.0


def load(path: Path) -> dict[str, Any]:
    """The results of a case as the worker wrote them."""
    with gzip.open(path, "rb") as file:
        return pickle.load(file)


def place_difference(old: bytes, new: bytes, call: str) -> float:
    """Greatest difference of a coordinate of a place [m] in two lists of poses; infinite if they are not of the same limbs."""
    if len(old) != len(new):
        return float("inf")
    # Of a pose (4, 4), row by row, the last column is a place; many postures are kept as places alone.
    pairs = enumerate(zip(array("d", old), array("d", new), strict=True))
    places = (pair for index, pair in pairs if call == "postures" or index % 16 in (3, 7, 11))
    return max((abs(a - b) if a == a and b == b else float("inf") for a, b in places if a != b), default=0.0)


def compare(old: Mapping[str, Any], new: Mapping[str, Any]) -> Difference:
    """All results of one case by two builds."""
    frames: tuple[Sequence[Mapping[str, Any]], ...] = (old["records"], new["records"])
    what, first, furthest = set[str](), None, 0.0
    for index, (before, after) in enumerate(zip(*frames, strict=False)):
        wrong = [part for part in PARTS if before[part] != after[part]]
        if wrong:
            what.update(wrong)
            first = index if first is None else first
            furthest = max(furthest, place_difference(before["poses"], after["poses"], before["call"]))
    counts = [len(records) for records in frames]
    if counts[0] != counts[1]:
        what.add(f"{counts[0]} and {counts[1]} results")
        first = min(counts) if first is None else first
    what.update(name for name in ("printed", "files") if old[name] != new[name])
    return Difference(min(counts), tuple(sorted(what)), first, 1000.0 * furthest)
