"""Table that maps the keypoints of common networks to the sites of the body.

Each row has a site, {keypoint index: weight} and a spread [m]. A site is the weighted sum of its keypoints; the spread is the
distance between the network's definition of the joint and ours (a hip keypoint sits on the skin, a neck keypoint between
the shoulders, ears below the middle of the head).
Sites that only repeat other keypoints (a neck that a network computes from the two shoulders) are left out, because they
would count one error twice.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, TypeVar

from voodoo.errors import MeasurementError

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

T = TypeVar("T")

_SPREADS = {
    "shoulder": 0.03, "elbow": 0.02, "wrist": 0.02, "hip": 0.04, "knee": 0.02, "ankle": 0.02, "toe": 0.05,
    "head_center": 0.06, "skullbase": 0.05, "skull_tip": 0.05, "vc7": 0.05, "humanoid_root": 0.04, "l_hand": 0.02, "r_hand": 0.02,
}  # fmt: skip
"""Spread of a site [m]; the joints of both sides come first, in the order in which most networks have them."""


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


def _layout(
    count: int,
    *pairs: tuple[int, int],
    names: Iterable[str] = _SPREADS,
    midpoints: tuple[tuple[int, int, int], ...] = (),
    **others: Mapping[int, float],
) -> Layout:
    """A layout, by the keypoints of each joint on the left and on the right, and those of other sites with their weights.

    There may be more names than joints.
    """
    joints = [
        SiteKeypoints(prefix + name, {pair[side]: 1.0}, _SPREADS[name])
        for side, prefix in enumerate(("l_", "r_"))
        for name, pair in zip(names, pairs, strict=False)
    ]
    sites = [SiteKeypoints(site, weights, _SPREADS[site]) for site, weights in others.items()]
    return Layout(count, (*joints, *sites), midpoints)


_LEGS_FIRST = ("hip", "knee", "ankle", "shoulder", "elbow", "wrist")
_COCO = ((5, 6), (7, 8), (9, 10), (11, 12), (13, 14), (15, 16))
_COCO_EARS = {3: 0.5, 4: 0.5}
"""The midpoint of the ears is the center of the head from every direction."""

LAYOUTS: dict[str, Layout] = {
    # nose, eyes, ears (3, 4), then pairs from the shoulders to the ankles
    "coco17": _layout(17, *_COCO, head_center=_COCO_EARS),
    # OpenPose: its neck (1) and mid-hip (8) are computed from the shoulders and hips
    "body25": _layout(
        25, (5, 2), (6, 3), (7, 4), (12, 9), (13, 10), (14, 11), (19, 22),
        head_center={18: 0.5, 17: 0.5}, midpoints=((1, 2, 5), (8, 9, 12)),
    ),
    # OpenPose BODY_25B: COCO, then upper neck (17) and head top (18) of MPII, then feet
    "body25b": _layout(25, *_COCO, (19, 22), head_center=_COCO_EARS, skullbase={17: 1.0}, skull_tip={18: 1.0}),
    # MediaPipe: 33 landmarks; ears 7 and 8; the palm's center lies between the wrist and the knuckles of the little finger
    # (17, 18) and the index finger (19, 20)
    "blazepose33": _layout(
        33, (11, 12), (13, 14), (15, 16), (23, 24), (25, 26), (27, 28), (31, 32), head_center={7: 0.5, 8: 0.5},
        l_hand={15: 0.4, 17: 0.3, 19: 0.3}, r_hand={16: 0.4, 18: 0.3, 20: 0.3},
    ),
    # COCO, then top of the head (17), neck (18), hip (19), and feet in pairs from the big toes (20, 21)
    "halpe26": _layout(26, *_COCO, (20, 21), head_center=_COCO_EARS, skull_tip={17: 1.0}, vc7={18: 1.0}),
    # pelvis, right leg, left leg, spine, thorax (8), nose (9), top of the head (10), left arm, right arm
    "h36m17": _layout(
        17, (4, 1), (5, 2), (6, 3), (11, 14), (12, 15), (13, 16), names=_LEGS_FIRST,
        humanoid_root={0: 1.0}, vc7={8: 1.0}, skull_tip={10: 1.0}, midpoints=((0, 1, 4), (8, 11, 14)),
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
