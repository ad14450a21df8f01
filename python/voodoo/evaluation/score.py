"""Scores of a tracked recording."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeAlias

import numpy as np

from voodoo.evaluation.calibration import Deviations
from voodoo.evaluation.depth_agreement import Selection
from voodoo.evaluation.metrics import BoolArray
from voodoo.measurements import FloatArray

LIMIT_EXACT_M, LIMIT_REFERENCE_M = 0.10, 0.15
"""Distances from exact truth, and from another tracker's skeleton, beyond which a joint is lost [m]."""

Form: TypeAlias = tuple[float, str, str]
"""How a number is written: factor, digits and unit."""
CM, MM, PERCENT = (100.0, ".1f", " cm"), (1000.0, ".1f", " mm"), (100.0, ".1f", " %")
SECONDS, DEGREES, RATIO = (1.0, ".2f", " s"), (1.0, ".1f", " deg"), (1.0, ".2f", "")


def written(value: float, form: Form) -> str:
    """A number as text; "-" if it is not known."""
    factor, digits, unit = form
    return f"{factor * value:{digits}}{unit}" if math.isfinite(value) else "-"


def _measure(words: str, form: Form) -> float:
    """An unknown number, and its row in a report."""
    unknown: float = field(default=np.nan, metadata={"row": (words, form)})
    return unknown


@dataclass(frozen=True)
class Score:
    """Evaluation of one recording; meters, seconds and fractions in [0, 1], NaN if unknown.

    Args:
        name: of the recording.
        path: of the recording.
        failure: why it could not be tracked to its end, with all numbers NaN; "" if it was.
        frames: number of tracked frames.
        exact: compared with exact truth (else with another tracker's skeleton), None without any reference.
        error_m: mean error of the twelve joints: at lag 0 against exact truth, at the best lag against a reference.
        error_lag0_m, error_best_lag_m: both.
        best_lag: constant lag [frames] with the least error; positive: the estimate is late.
        error_without_offsets_m: the same error without each joint's constant offset, see metrics.without_offsets.
        first_pose_s: time from the first frame with a reference to the first with a pose.
        first_pose_error_m: mean error in that frame, at lag 0.
        within_5cm, within_10cm: fraction of joint errors, at the same lag as `error_m`.
        joint_error_m: mean error of each of the twelve joints, at the same lag.
        class_without_offsets, lost_without_offsets: the class, and whether a joint is lost at the end (0 or 1), of that error.
        tracking_class: 2, 1 or 0 as in K06 Table I, see metrics.tracking_class, at the same lag.
        lost_joints: the joints that were ever lost.
        selection: how the person's depth points were selected, see witness.
        depth_within_5cm, depth_median_m, depth_p95_m: of their distances to the model.
        person_within_5cm: fraction within 5 cm of the points near the joints of truth or reference, see FrameWitness.
        silhouette_iou: mean over the frames.
        jitter_m, reference_jitter_m: mean norm of the second difference of the twelve joints, over all frames.
        standing_jitter_m, reference_standing_jitter_m: the same over the joints and frames in which the reference stands
            still, see metrics.standing_still.
        degraded_share, lost_share, searching_share: fractions of frames with this status. A searching frame has no errors;
            in the class it counts as lost if the reference has the person.
        lost_recall, false_alarm_rate: of the elbows, wrists, knees and ankles farther than 10 cm from the truth the fraction
            whose limb does not have the status "measured"; and of the nearer ones.
        far_ends, near_ends: numbers of such joints, over all frames.
        step_s: mean time of a frame from measurements to estimate.
        angle_error_deg, angle_spread_deg: of eight joint angles at the same lag, see metrics.angle_error [deg].
        left_out_share: fraction of the joints of a reference skeleton that are not used, see metrics.without_contradictions.
    """

    name: str
    path: Path
    failure: str = ""
    frames: int = 0
    exact: bool | None = None
    error_m: float = _measure("mean joint error", CM)
    error_lag0_m: float = _measure("... at lag 0", CM)
    error_best_lag_m: float = _measure("... at the best lag", CM)
    best_lag: int | None = None
    error_without_offsets_m: float = _measure("... each joint's constant offset removed", CM)
    class_without_offsets: float = _measure("... class average of that error", RATIO)
    lost_without_offsets: float = _measure("... sequences that end with a joint lost by it", PERCENT)
    first_pose_s: float = _measure("first pose after", SECONDS)
    first_pose_error_m: float = _measure("mean error in the first pose", CM)
    within_5cm: float = _measure("joints within 5 cm", PERCENT)
    within_10cm: float = _measure("joints within 10 cm", PERCENT)
    joint_error_m: dict[str, float] = field(default_factory=dict)
    tracking_class: int | None = None
    lost_joints: tuple[str, ...] = ()
    selection: Selection | None = None
    depth_within_5cm: float = _measure("depth within 5 cm of the model", PERCENT)
    depth_median_m: float = _measure("depth to model, median", MM)
    depth_p95_m: float = _measure("depth to model, 95th percentile", MM)
    person_within_5cm: float = _measure("within 5 cm, of depth about the known joints", PERCENT)
    silhouette_iou: float = _measure("silhouette IoU", (1.0, ".3f", ""))
    jitter_m: float = _measure("second difference of the joints", MM)
    reference_jitter_m: float = _measure("... of the reference", MM)
    standing_jitter_m: float = _measure("second difference where the reference stands still", MM)
    reference_standing_jitter_m: float = _measure("... of the reference itself there", MM)
    degraded_share: float = _measure("frames called degraded", PERCENT)
    lost_share: float = _measure("frames called lost", PERCENT)
    searching_share: float = _measure("frames without a pose", PERCENT)
    lost_recall: float = _measure("limbs off by 10 cm and not called measured", (100.0, ".0f", " %"))
    false_alarm_rate: float = _measure("nearer limbs not called measured", PERCENT)
    far_ends: int = 0
    near_ends: int = 0
    step_s: float = _measure("time of a frame", (1000.0, ".2f", " ms"))
    angle_error_deg: float = _measure("error of the joint angles", DEGREES)
    angle_spread_deg: float = _measure("... its standard deviation", DEGREES)
    left_out_share: float = _measure("joints of the reference left out, their bones off", PERCENT)

    @property
    def nobody(self) -> bool:
        """Whether no frame has a person."""
        return self.searching_share == 1.0


@dataclass(frozen=True, eq=False, repr=False)
class FrameTable:
    """Evaluation of each frame.

    Args:
        stamps: (F,) [s].
        status: F words of the tracker.
        errors: (F, 12) of metrics.JOINTS [m] at the lag of the score.
        lost: (F, 12).
        depth_within_5cm, silhouette_iou, step_s: (F,).
        deviations: errors by coordinate and their standard deviations; None without a reference.
    """

    stamps: FloatArray
    status: tuple[str, ...]
    errors: FloatArray
    lost: BoolArray
    depth_within_5cm: FloatArray
    silhouette_iou: FloatArray
    step_s: FloatArray
    deviations: Deviations | None = None
