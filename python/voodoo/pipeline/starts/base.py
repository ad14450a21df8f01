"""Interface of a source of detections: it finds persons in measurements that belong to nobody who is tracked."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from voodoo.measurements import FloatArray, KeypointImage
from voodoo.model.at_rest import proportion
from voodoo.model.body import Body
from voodoo.recordings.keypoint_layouts import LIMBS, of_both_sides
from voodoo.sensors.keypoints.sites import SitePixel, site_pixels
from voodoo.sensors.settings import FrontEndSettings

TRUNK = ("l_shoulder", "r_shoulder", "l_hip", "r_hip", "vc7", "humanoid_root")
"""Sites of a person's trunk: three that are not collinear determine its position and orientation."""
BONES_M: dict[tuple[str, str], tuple[float, float]] = {
    ("l_shoulder", "r_shoulder"): (0.12, 0.60),
    ("l_hip", "r_hip"): (0.06, 0.45),
} | of_both_sides({
    ("shoulder", "hip"): (0.22, 0.85),
    ("shoulder", "elbow"): (0.12, 0.50),
    ("elbow", "wrist"): (0.10, 0.45),
    ("hip", "knee"): (0.18, 0.70),
    ("knee", "ankle"): (0.18, 0.65),
    ("wrist", "hand"): (0.01, 0.25),
    ("ankle", "toe"): (0.04, 0.35),
})  # fmt: skip
"""Smallest and largest distance [m] of two sites, from a child of 1 m to a man of 2.1 m, with 5 cm of error at either end;
parents first."""
TOGETHER_S = 0.05
"""Images within this time belong to one instant: a walking person's wrist moves 10 cm in it."""
LEAST_SITES = 6
"""Sites that are needed for a first pose from keypoints."""
_ON_A_LINE_M = 0.04


@dataclass(frozen=True, eq=False)
class StartFrame:
    """Input of a finder: one frame, before a person is tracked.

    Args:
        stamp: of the frame [s].
        measurements: those of the kinds in use that belong to nobody, without frozen sensors.
        body: the body to track.
        settings: settings of the front end.
    """

    stamp: float
    measurements: Sequence[Any]
    body: Body
    settings: FrontEndSettings


def visible_sites(item: KeypointImage, rows: FloatArray, frame: StartFrame) -> list[SitePixel]:
    """The sites of the body at the keypoints (K, 3) of one person; [] if they are too few for a first pose."""
    sites, _ = site_pixels(rows, layout=item.layout, min_confidence=frame.settings.min_confidence)
    sites = [site for site in sites if site.site in frame.body.site_names]
    return sites if len(sites) >= LEAST_SITES else []


@dataclass(frozen=True, eq=False)
class FoundStart:
    """A first pose.

    Args:
        joints: site name -> (3,) [m], root frame; they determine the pose of the body.
        sigma: site name -> standard deviation of its position [m].
        by: name of the finder.
        log_odds: ln(p / (1 - p)) that it is a person, where several persons are tracked.
    """

    joints: Mapping[str, FloatArray]
    sigma: Mapping[str, float]
    by: str
    log_odds: float = inf


class StartFinder(ABC):
    """Evaluates frames, one after the other, for persons.

    Attributes:
        name: name in messages.
        given: whether the user set the pose, so that an invalid pose is an error.
    """

    name: ClassVar[str]
    given: ClassVar[bool] = False

    @abstractmethod
    def find(self, frame: StartFrame) -> Sequence[FoundStart]:
        """The persons for whom this frame and the previous ones are sufficient, the one observed best first."""


def fixes_pose(joints: Mapping[str, npt.ArrayLike], body: Body) -> bool:
    """Whether three of the positions are not collinear; for a person, three positions of the trunk."""
    of_trunk = [name for name in TRUNK if name in body.site_names]
    names = [name for name in joints if name in body.site_names and (len(of_trunk) < 3 or name in of_trunk)]
    if len(names) < 3:
        return False
    places = np.array([joints[name] for name in names], dtype=np.float64)
    spread = np.linalg.svd(places - places.mean(axis=0), compute_uv=False)
    return bool(spread[1] > _ON_A_LINE_M)


def without_impossible(joints: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
    """The joints, without those that give a bone an implausible length, and without the descendants of these joints.

    For an implausible bone of an arm or leg the distal end is removed. If a bone of the trunk is implausible, the result is
    empty.
    """
    return _with_bones(joints, BONES_M)


def _with_bones(
    joints: Mapping[str, FloatArray], limits: Mapping[tuple[str, str], tuple[float, float]], unit: float = 1.0
) -> dict[str, FloatArray]:
    """See `without_impossible`; lengths are compared in multiples of `unit` [m]."""
    gone: set[str] = set()
    for (near, far), (least, most) in (dict.fromkeys(BONES_M, (0.0, inf)) | dict(limits)).items():
        known = near in joints and far in joints
        if near in gone or (known and not least <= float(np.linalg.norm(joints[near] - joints[far])) / unit <= most):
            if near in TRUNK and far in TRUNK:
                return {}
            gone.add(far)
    return {name: place for name, place in joints.items() if name not in gone}


def in_proportion(joints: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
    """The joints, without those that give a bone out of proportion to the trunk, and without the descendants of these joints.

    An occluded joint gets the depth of its occluder, which makes its bones too short or too long. For a trunk observed from
    the side, whose far half is occluded, the result is empty.
    """
    trunk = [
        np.linalg.norm(joints[f"{s}_shoulder"] - joints[f"{s}_hip"])
        for s in "lr"
        if {f"{s}_shoulder", f"{s}_hip"} <= joints.keys()
    ]
    if not trunk:
        return {}
    limits = {bone: (_SHORTER * proportion(*bone), _LONGER * proportion(*bone)) for bone in _IN_PROPORTION}
    return _with_bones(joints, limits, unit=float(np.mean(trunk)) / proportion("l_shoulder", "l_hip"))


_SHORTER, _LONGER = 0.6, 1.6
"""Tolerance: bones of persons differ from these proportions by 10 percent; further 4 cm of error are allowed at either end."""
_IN_PROPORTION = (
    ("l_shoulder", "r_shoulder"), ("l_hip", "r_hip"), *LIMBS,
    ("l_shoulder", "skullbase"), ("l_shoulder", "head_center"), ("l_shoulder", "skull_tip"),
)  # fmt: skip
