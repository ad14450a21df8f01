"""Agreement of a pose with depth images: distances of the person's points to the model, and overlap of the silhouettes.

The depth pixels of the person are selected without the tracker where possible, so that a lost track cannot select the
pixels that it is evaluated with:

* "segmented": the person is segmented in the recording (UTD-MHAD): every pixel with depth (chair and floor band included).
* "truth": exact joint positions are known: pixels within the capsules of CAPSULES around them.
* "model": neither: pixels within 10 cm of the box around the model (K06 IV-B 1). Such values are too good for a lost track.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from voodoo._core import Estimate
from voodoo.evaluation.metrics import BoolArray, fraction_within, mean_or_nan
from voodoo.measurements import DepthImage, FloatArray, PointCloud, RecordedFrame
from voodoo.model.body import Body
from voodoo.model.projection import CameraView, body_mask, limb_rings, transform
from voodoo.recordings.keypoint_layouts import of_both_sides
from voodoo.sensors.depth import depth_points
from voodoo.sensors.settings import within_boxes
from voodoo.tracker import Tracker

Selection: TypeAlias = Literal["segmented", "truth", "model"]

CAPSULES: dict[tuple[str, str], float] = {
    ("humanoid_root", "vc7"): 0.20,
    ("l_hip", "r_hip"): 0.19,
    ("l_shoulder", "r_shoulder"): 0.15,
    ("vc7", "skull_tip"): 0.15,
} | of_both_sides({
    ("shoulder", "elbow"): 0.11,
    ("elbow", "wrist"): 0.09,
    ("wrist", "hand"): 0.11,
    ("hip", "knee"): 0.16,
    ("knee", "ankle"): 0.11,
})  # fmt: skip
"""Segments between true joints and the radius [m] within which points belong to the person. Large enough for a heavy person
in clothes, small enough that at the ankles (8 cm above the floor) only a few square decimeters of floor are included."""

_BOX_MARGIN_M = 0.1
WITHIN_M = 0.05
"""Points this near to the model agree with it [m]."""


@dataclass(frozen=True, eq=False)
class FrameWitness:
    """Agreement in one frame: unsigned distances (N,) [m] of the person's points to the model, which of them (N,) are within
    CAPSULES around known joints (chair and floor mostly are not), and the overlap of the silhouettes (NaN without a depth image
    or without a person in it)."""

    distances: FloatArray
    about_joints: BoolArray
    iou: float

    @property
    def within(self) -> float:
        """Fraction of the points within 5 cm of the model."""
        return fraction_within(self.distances, WITHIN_M)


def witness(
    recorded: RecordedFrame,
    tracker: Tracker,
    estimate: Estimate,
    truth: Mapping[str, FloatArray],
    selection: Selection,
) -> FrameWitness:
    """Compare depth images and clouds of a frame with the current model.

    Args:
        recorded: the frame just tracked.
        tracker: provides the distance to its current model.
        estimate: of this frame.
        truth: true joint positions [m] in the root frame, or those of a reference; used for selection only with "truth".
        selection: see the module.

    Returns:
        Empty arrays for a searching frame, which has no model to compare with.
    """
    distances, about, overlaps = [np.empty(0)], [np.empty(0, dtype=bool)], [np.empty(0)]
    box = _box(tracker.body, estimate, truth, selection) if estimate.joints else None
    for item in recorded.measurements if estimate.joints else ():
        if isinstance(item, DepthImage):
            points, valid = depth_points(item, box=box)
        elif isinstance(item, PointCloud):
            points = transform(item.root_from_sensor, item.points)
            valid = np.ones(len(points), dtype=bool)
        else:
            continue
        near = near_joints(points, truth)
        inside = np.ones(len(points), dtype=bool) if box is None else within_boxes(points, [box])
        chosen = near if selection == "truth" else inside
        person = np.zeros(len(valid), dtype=bool)
        person[valid] = chosen
        if chosen.any():
            distances.append(np.abs(tracker.distance(points[chosen])).astype(np.float64))
            about.append(near[chosen])
        if isinstance(item, DepthImage):
            overlaps.append(np.array([_overlap(item, person, tracker.body, estimate)]))
    return FrameWitness(np.concatenate(distances), np.concatenate(about), mean_or_nan(np.concatenate(overlaps)))


def near_joints(points: FloatArray, joints: Mapping[str, FloatArray]) -> BoolArray:
    """Which points (N, 3) lie within a capsule of CAPSULES; segments without both joints are left out."""
    known = _capsules(joints)
    near = np.zeros(len(points), dtype=bool)
    if not known:
        return near
    inside = np.flatnonzero(within_boxes(points, [_around(known)]))  # most pixels are far from all persons
    about = np.asfortranarray(points[inside])
    for capsule in known:
        start, end, radius = capsule
        some = np.flatnonzero(within_boxes(about, [_around([capsule])]))  # of a person, most are far from a limb
        axis, (x, y, z) = end - start, about[some].T - start[:, None]
        t = np.clip((axis[0] * x + axis[1] * y + axis[2] * z) / max(float(axis @ axis), 1e-12), 0.0, 1.0)
        squares = (x - t * axis[0]) ** 2 + (y - t * axis[1]) ** 2 + (z - t * axis[2]) ** 2
        near[inside[some[squares <= radius**2]]] = True
    return near


def _capsules(joints: Mapping[str, FloatArray]) -> list[tuple[FloatArray, FloatArray, float]]:
    return [
        (joints[start], joints[end], radius)
        for (start, end), radius in CAPSULES.items()
        if start in joints and end in joints and np.isfinite([joints[start], joints[end]]).all()
    ]


def _around(capsules: Sequence[tuple[FloatArray, FloatArray, float]]) -> tuple[FloatArray, FloatArray]:
    low = np.min([np.minimum(a, b) - radius for a, b, radius in capsules], axis=0)
    high = np.max([np.maximum(a, b) + radius for a, b, radius in capsules], axis=0)
    return low, high


def _box(
    body: Body, estimate: Estimate, truth: Mapping[str, FloatArray], selection: Selection
) -> tuple[FloatArray, FloatArray] | None:
    """Low and high corner [m] of what holds everything that is selected; None: everything is."""
    if selection == "segmented":
        return None
    if selection == "truth":
        known = _capsules(truth)
        return _around(known) if known else (np.zeros(3), np.zeros(3))
    rings = [transform(estimate.world_from_limb[limb.name], limb_rings(limb.shape)) for limb in body.limbs]
    corners = np.concatenate(rings).reshape(-1, 3)
    return corners.min(axis=0) - _BOX_MARGIN_M, corners.max(axis=0) + _BOX_MARGIN_M


def _overlap(depth: DepthImage, person: BoolArray, body: Body, estimate: Estimate) -> float:
    """Intersection over union of the model's silhouette and the person's pixels; NaN when no pixel is the person's."""
    if not person.any():
        return float("nan")
    height, width = depth.image.shape
    view = CameraView(depth.camera, depth.root_from_sensor)
    model = body_mask(body, estimate, view, width=width, height=height)
    observed = person.reshape(height, width)
    return float((model & observed).sum() / (model | observed).sum())
