"""Where in space a hand can be: on its arm, on its own side, in pieces."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from voodoo.sensors.pixels import FloatArray
from voodoo.sensors.skin.tracks import Sight

BARE = ("head", "neck", "upperarm", "forearm", "hand")
"""Endings of the names of limbs that show skin."""
ON_LIMB_M, OFF_LIMB_M = 0.03, 0.06
"""What is no farther than this from a limb, and this much farther from another, is of the first."""
HAND_LENGTH_M, FINGERS_M = 0.18, 0.015
"""From the wrist to the fingertips; and how far the middle of all that is beyond the middle of the palm."""


def reach(side: str, predicted: Mapping[str, FloatArray]) -> float:
    """How far a hand can be from its shoulder [m], with room for a model that is not where the person is."""
    joints = [predicted.get(f"{side}_{name}") for name in ("shoulder", "elbow", "hand")]
    if any(joint is None for joint in joints):
        return math.inf
    shoulder, elbow, hand = (np.asarray(joint) for joint in joints)
    return 1.2 * (math.dist(elbow, shoulder) + math.dist(hand, elbow)) + 0.15


def elsewhere(
    sites: list[str],
    sights: list[Sight],
    limbs: Mapping[str, npt.NDArray[np.floating[Any]]],
    arm_lost: Collection[str],
) -> npt.NDArray[np.bool_]:
    """(S, B): whether a sight is the surface of a limb other than a hand's own forearm, of a bare one if that is lost."""
    result = np.zeros((len(sites), len(sights)), dtype=np.bool_)
    deep = np.array([sight.deep for sight in sights])
    away, names = np.array(list(limbs.values())), tuple(limbs)
    for row, site in enumerate(sites):
        own, rest = _own_and_others(names, site[0], site in arm_lost)
        if not own or site.startswith("head"):
            continue
        others = away[rest].min(axis=0, initial=np.inf)
        own_away = away[own].min(axis=0)
        result[row] = deep & (others < ON_LIMB_M) & (own_away > others + OFF_LIMB_M)
    return result


@lru_cache(maxsize=64)
def _own_and_others(limbs: tuple[str, ...], side: str, lost: bool) -> tuple[list[int], list[int]]:
    """Numbers of the limbs of a side's forearm, and of those that its hand cannot be on; of a lost arm only the bare ones."""
    own = [row for row, name in enumerate(limbs) if name.startswith(side) and name.endswith(("forearm", "hand"))]
    others = [row for row, name in enumerate(limbs) if row not in own and (not lost or name.endswith(BARE))]
    return own, others


def to_palm(site: str, predicted: Mapping[str, FloatArray]) -> FloatArray:
    """From the middle of a hand with its fingers to the hand's site (3,) [m]; zero for a head or without an elbow."""
    elbow = predicted.get(f"{site[0]}_elbow")
    if site.startswith("head") or elbow is None:
        return np.zeros(3)
    forearm = predicted[site] - elbow
    return np.asarray(-FINGERS_M * forearm / max(float(np.linalg.norm(forearm)), FINGERS_M))


def of_pieces(place: FloatArray, pieces: list[FloatArray], expected: FloatArray) -> FloatArray:
    """Where the middle of a hand is whose region is at `place` (3,) and which may be in pieces: something lies across it, or
    is behind it and of its colour. It is then anywhere between two pieces that are no farther apart than a hand is long: of
    those places, the one nearest to where it is expected."""
    nearest = place
    for piece in pieces:
        across = piece - place
        span = float(across @ across)
        if 0.0 < span < HAND_LENGTH_M**2:
            share = min(max(float((expected - place) @ across) / span, 0.0), 1.0)
            between = place + share * across
            if float(np.linalg.norm(between - expected)) < float(np.linalg.norm(nearest - expected)):
                nearest = between
    return nearest


def hand_ends(sights: list[Sight], to_hand: FloatArray | float, to_elbow: FloatArray) -> list[bool]:
    """False for those ends of a bare forearm that are nearer to its elbow than another end of the same region.

    Args:
        sights: candidates.
        to_hand, to_elbow: distances (N,) from where these are expected [m]; 0.0 where nothing speaks for a hand's place.
    """
    towards = (to_hand - to_elbow).tolist()
    least: dict[int, float] = {}
    for item, value in zip(sights, towards, strict=True):
        if item.hand:
            least[item.region] = min(value, least.get(item.region, math.inf))
    return [value <= least.get(item.region, math.inf) for item, value in zip(sights, towards, strict=True)]
