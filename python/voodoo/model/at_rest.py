"""Bodies at rest, upright with hanging arms, in the standing frame: x forward, y left, z up, origin in the root limb's."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from itertools import pairwise

import numpy as np

from voodoo.model.body import STATURE_M, Body
from voodoo.model.joint import FloatArray


def limbs_at_rest(body: Body) -> tuple[FloatArray, FloatArray]:
    """Orientations standing_from_limb (L, 3, 3) and origins (L, 3) [m] of the limbs."""
    turns, places = body.core.at_rest()
    origins = np.zeros_like(places)
    for index, ((_, _, _, joint, _), (_, above)) in enumerate(zip(body.core.parts()[1], body.limb_tree, strict=True)):
        if joint is not None and above is not None:
            origins[index] = turns[above] @ np.asarray(joint[1][0]) + origins[above] - turns[index] @ places[index]
    return turns, origins


def sites_at_rest(body: Body) -> dict[str, FloatArray]:
    """Positions (3,) [m] of the sites."""
    turns, origins = limbs_at_rest(body)
    numbers = {limb: index for index, limb in enumerate(body.limb_names)}
    sites = body.core.parts()[2]
    return {site: turns[numbers[limb]] @ np.asarray(place) + origins[numbers[limb]] for site, limb, place in sites}


@lru_cache(maxsize=1)
def _human() -> Mapping[str, FloatArray]:
    """Sites (3,) [m] of the default human."""
    return sites_at_rest(Body.human(model="full"))


@lru_cache
def proportion(*sites: str) -> float:
    """Length of the way from site to site of the default human, as a fraction of the stature."""
    places = _human()
    return sum(float(np.linalg.norm(places[one] - places[other])) for one, other in pairwise(sites)) / STATURE_M
