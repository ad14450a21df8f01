"""Table that maps the keypoints of common networks to the sites of the body.

A layout has for each site {keypoint index: weight} and a spread [m]. A site is the weighted sum of its keypoints; the spread
is the distance between the network's definition of the joint and ours (a hip keypoint sits on the skin, a neck keypoint between
the shoulders, ears below the middle of the head).
Sites that only repeat other keypoints (a neck that a network computes from the two shoulders) are left out, because they
would count one error twice.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, TypeVar

from voodoo.errors import MeasurementError

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

T = TypeVar("T")

_SPREADS = {
    "shoulder": 0.03, "elbow": 0.02, "wrist": 0.02, "hip": 0.04, "knee": 0.02, "ankle": 0.02, "toe": 0.05, "hand": 0.02,
    "head_center": 0.06, "skullbase": 0.05, "skull_tip": 0.05, "vc7": 0.05, "humanoid_root": 0.04,
}  # fmt: skip
"""Spread of a site of either side, or of the middle [m]."""
_COMPUTED = {"head_center": {"l_ear": 0.5, "r_ear": 0.5}} | {
    f"{side}_hand": {f"{side}_wrist": 0.4, f"{side}_pinky": 0.3, f"{side}_index": 0.3} for side in "lr"
}
"""Sites between keypoints, with their weights: the midpoint of the ears is the center of the head from every direction, and the
palm's center lies between the wrist and the knuckles of the little finger and the index finger."""


@dataclass(frozen=True)
class SiteKeypoints:
    """A site and the keypoints it is computed from."""

    site: str
    weights: Mapping[int, float]
    spread: float


@dataclass(frozen=True)
class Layout:
    """The keypoints of a network: their number, the sites computed from them, and its midpoints.

    A midpoint is the index of a keypoint and of the two between which the network places it.
    """

    count: int
    parts: tuple[SiteKeypoints, ...]
    midpoints: tuple[tuple[int, int, int], ...] = ()


def _layout(words: str, **midpoints: str) -> Layout:
    """A layout by the names of its keypoints, in their order; those with the name of a site are measurements of it.

    A midpoint is given by the joint whose two sides it lies between.
    """
    names = words.split()
    sites = {name: {name: 1.0} for side in ("l_", "r_") for name in names if name.startswith(side)}
    sites |= {site: weights for site, weights in _COMPUTED.items() if weights.keys() <= set(names)}
    sites |= {name: {name: 1.0} for name in names if name not in sites}
    parts = [
        SiteKeypoints(site, {names.index(name): weight for name, weight in weights.items()}, _SPREADS[kind])
        for site, weights in sites.items()
        if (kind := site.removeprefix("l_").removeprefix("r_")) in _SPREADS
    ]
    middles = []
    for middle, joint in midpoints.items():
        one, other = sorted(names.index(f"{side}_{joint}") for side in "lr")
        middles.append((names.index(middle), one, other))
    return Layout(len(names), tuple(parts), tuple(middles))


_COCO = """nose l_eye r_eye l_ear r_ear l_shoulder r_shoulder l_elbow r_elbow l_wrist r_wrist l_hip r_hip l_knee r_knee l_ankle
    r_ankle """

LAYOUTS: dict[str, Layout] = {
    "coco17": _layout(_COCO),
    # OpenPose
    "body25": _layout(
        """nose neck r_shoulder r_elbow r_wrist l_shoulder l_elbow l_wrist mid_hip r_hip r_knee r_ankle l_hip l_knee l_ankle
        r_eye l_eye r_ear l_ear l_toe l_small_toe l_heel r_toe r_small_toe r_heel""",
        neck="shoulder", mid_hip="hip",
    ),
    # OpenPose BODY_25B: after COCO the upper neck and the head top of MPII
    "body25b": _layout(_COCO + "skullbase skull_tip l_toe l_small_toe l_heel r_toe r_small_toe r_heel"),
    # MediaPipe
    "blazepose33": _layout(
        """nose l_inner_eye l_eye l_outer_eye r_inner_eye r_eye r_outer_eye l_ear r_ear l_mouth r_mouth l_shoulder r_shoulder
        l_elbow r_elbow l_wrist r_wrist l_pinky r_pinky l_index r_index l_thumb r_thumb l_hip r_hip l_knee r_knee
        l_ankle r_ankle l_heel r_heel l_toe r_toe"""
    ),
    "halpe26": _layout(_COCO + "skull_tip vc7 mid_hip l_toe r_toe l_small_toe r_small_toe l_heel r_heel"),
    # Human3.6M
    "h36m17": _layout(
        """humanoid_root r_hip r_knee r_ankle l_hip l_knee l_ankle spine vc7 nose skull_tip l_shoulder l_elbow l_wrist
        r_shoulder r_elbow r_wrist""",
        humanoid_root="hip", vc7="shoulder",
    ),
}  # fmt: skip
"""Layout by name."""


def of_both_sides(table: Mapping[tuple[str, str], T]) -> dict[tuple[str, str], T]:
    """A table of pairs of sites, for the left side and then for the right one."""
    return {(f"{side}_{one}", f"{side}_{other}"): value for side in "lr" for (one, other), value in table.items()}


_CHAINS = (("shoulder", "elbow", "wrist"), ("shoulder", "hip", "knee", "ankle"))
LIMBS = tuple(of_both_sides({pair: None for chain in _CHAINS for pair in pairwise(chain)}))
"""Sites at the ends of limbs, and of the sides of the trunk; every layout has them."""


def layout_of(name: str) -> Layout:
    """The layout called `name`, see LAYOUTS.

    Raises:
        MeasurementError: the name is unknown; lists the known ones.
    """
    if name not in LAYOUTS:
        raise MeasurementError(f"layout {name!r}: expected one of {', '.join(LAYOUTS)}")
    return LAYOUTS[name]


_MIDDLE, _UNCERTAIN = 0.045, 0.01
"""Distance of a keypoint from the middle of two others, by the size of the person, below which it is that middle. It is 0.02 and
less for the midpoints of a network, 0.06 and more for other joints; the second number is the range in which both are possible."""


def layout_by_shape(people: Sequence[npt.NDArray[np.float64]]) -> tuple[str | None, bool]:
    """The likeliest layout of keypoints (K, 3), and whether it is certain.

    It is told by the number of keypoints and, of two layouts with the same number, by whether the midpoints of one of them are
    in the middle. None: no layout has this number.
    """
    import numpy as np  # not for the names of the layouts, which are in the help of every command

    people = [rows for rows in people if len(rows) == len(people[0])]
    names = [name for name, layout in LAYOUTS.items() if people and layout.count == len(people[0])]
    if len(names) < 2:
        return next(iter(names), None), True
    first, second = sorted(names, key=lambda name: not LAYOUTS[name].midpoints)
    away = [value for rows in people if np.isfinite(value := _off_middle(rows, LAYOUTS[first].midpoints))]
    if not away:
        return second, False
    middle = float(np.median(away))
    return first if middle < _MIDDLE else second, abs(middle - _MIDDLE) > _UNCERTAIN


def _off_middle(rows: npt.NDArray[np.float64], midpoints: Sequence[tuple[int, int, int]]) -> float:
    """Greatest distance of the midpoints from the middle of their two keypoints, by the size of the person; NaN: not seen."""
    import numpy as np

    visible = rows[:, 2] > 0.0
    used = np.array([each for each in midpoints if visible[list(each)].all()])
    if not len(used):
        return np.nan
    middle, a, b = (rows[used[:, column], :2] for column in range(3))
    size = float(np.linalg.norm(np.ptp(rows[visible, :2], axis=0)))
    return float(np.linalg.norm(middle - (a + b) / 2.0, axis=1).max()) / size if size > 0.0 else np.nan
