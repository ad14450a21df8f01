"""Which skin regions can be which site: what a body allows, whatever lies nearest."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from voodoo.sensors.pixels import FloatArray, lengths
from voodoo.sensors.skin.hands import BARE, hand_ends, reach
from voodoo.sensors.skin.tracks import Blob, Sight

Mask: TypeAlias = npt.NDArray[np.bool_]

BARE_M = 0.08
"""What is nearer to the bare limbs than this may be theirs."""
STANDS_OUT_M = 0.02
"""A hand before trunk or legs stands out from them by as much; a stripe of a shirt does not."""
NEAREST_HAND, FARTHEST_HAND_M = 0.6, 0.10
"""A hand is no nearer to an elbow that is seen than this share of its forearm, and not this much farther."""


def allowed_sites(
    sites: list[str],
    sights: list[Sight],
    inside: FloatArray,
    seen: list[Blob],
    predicted: Mapping[str, FloatArray],
    limbs: Mapping[str, npt.NDArray[np.floating[Any]]],
    *,
    arm_lost: Collection[str],
    upper_arm_visible: Collection[str],
    specks: Mask,
    unexplained: float,
) -> FloatArray:
    """(S, B): 0 the sight cannot be the site, 1 only near to where it is expected, 2 wherever it can reach.

    A site that was not seen is taken up far from where it is expected only in a region that no other site has, which
    is no speck, and which the body does not explain where it is thought to be. A hand whose
    forearm is lost may also hang before trunk or legs: those have no skin to show.
    """
    owned = {blob.sight.region for blob in seen if blob.label is not None}
    distances = np.array(list(limbs.values())) if limbs else np.zeros((1, len(sights)))
    away = distances.min(axis=0)
    outside = away > unexplained
    places = np.array([sight.place for sight in sights])
    deep, hand = (np.array([getattr(sight, name) for sight in sights]) for name in ("deep", "hand"))
    free = ~specks & deep & [sight.region not in owned for sight in sights]
    scene = np.array([sight.still for sight in sights]) & outside
    bare = [row for row, name in enumerate(limbs) if name.endswith(BARE)]
    dressed = ((distances[bare].min(axis=0) if bare else away) > BARE_M) & (away > STANDS_OUT_M)
    far = np.array([free & (outside | (dressed if site in arm_lost else False)) for site in sites])
    allowed = np.where(scene, 0.0, 1.0 + far)
    for row, site in enumerate(sites):
        side = site[0]
        shoulder = predicted.get(f"{side}_shoulder")
        if site.startswith("head"):
            continue
        allowed[row] *= hand
        if shoulder is not None:
            allowed[row] *= ~deep | (lengths(places - shoulder) < reach(side, predicted))
        elbow = predicted.get(f"{side}_elbow")
        if elbow is not None and site in upper_arm_visible:
            # What is much nearer is the forearm's middle, with the hand in the shade or cut off.
            apart = lengths(inside[row] - elbow)
            forearm = math.dist(predicted[site], elbow)
            least, most = NEAREST_HAND * forearm, math.inf if site in arm_lost else forearm + FARTHEST_HAND_M
            allowed[row] *= ~deep | ((least < apart) & (apart < most))
        if elbow is not None:
            to_elbow = lengths(places - elbow)
            ends = np.array(hand_ends(sights, lengths(places - predicted[site]), to_elbow))
            if site in arm_lost:
                # Nothing speaks for where the hand is expected, but it may be there all the same.
                ends |= hand_ends(sights, 0.0, to_elbow)
            allowed[row] *= ends
    return allowed
