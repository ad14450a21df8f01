"""Measures of a trajectory against a reference: pure functions on arrays.

F is the number of frames, J the number of joints; distances are in meters, NaN is unknown.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from voodoo.measurements import ROUNDED_S, FloatArray, nearest_stamps, usual_interval
from voodoo.recordings.keypoint_layouts import LIMBS

BoolArray: TypeAlias = npt.NDArray[np.bool_]

LIMB_JOINTS = ("shoulder", "elbow", "wrist", "hip", "knee", "ankle")
JOINTS = tuple(f"{side}_{joint}" for joint in LIMB_JOINTS for side in ("l", "r"))
"""The twelve joints that errors are averaged over."""

LOST_AFTER_S = 0.3
"""A joint is lost when it is too far from the reference for longer than this [s]."""

MAX_LAG = 5
"""Lags from -MAX_LAG to MAX_LAG frames are tried."""

STILL_M, STILL_S = 0.02, 0.2
"""A joint of the reference stands still in a frame if it stays within this distance [m] for this time [s] before and after."""

BONE_OFF = 0.25
"""Tolerated relative change of the length of a reference's bone: twice the variation of Kinect's skeleton."""

_BONES = tuple(limb for limb in LIMBS if not limb[1].endswith("_hip"))


def places_of(names: Sequence[str], positions: FloatArray, chosen_names: Sequence[str] = JOINTS) -> FloatArray:
    """Of positions (F, J, 3) those of the wanted joints; NaN where one is missing."""
    chosen = np.full((len(positions), len(chosen_names), 3), np.nan)
    for index, name in enumerate(chosen_names):
        if name in names:
            chosen[:, index] = positions[:, names.index(name)]
    return chosen


def match_reference(
    stamps: FloatArray, reference_stamps: FloatArray, positions: FloatArray, *, tolerance: float
) -> FloatArray:
    """Reference positions (F, J, 3) at `stamps` (F,), those of the nearest stamp; NaN if none is within `tolerance` [s].

    They are not interpolated, because a reference with the frames' rate has one value for every frame.
    """
    index = nearest_stamps(reference_stamps, stamps, within=tolerance)
    matched = positions[index].astype(np.float64)
    matched[index < 0] = np.nan
    return matched


def joint_errors(estimated: FloatArray, reference: FloatArray, *, lag: int = 0) -> FloatArray:
    """Distances (F, J) of estimated to reference positions, both (F, J, 3).

    Args:
        estimated: one position for each frame.
        reference: the same frames.
        lag: frame i of the estimate is compared with frame i - lag of the reference: positive means that the estimate
            is late. Frames whose counterpart is outside are NaN.
    """
    return np.asarray(np.linalg.norm(estimated - shifted(reference, lag), axis=2))


def without_offsets(estimated: FloatArray, reference: FloatArray) -> FloatArray:
    """Distances (F, J) of estimated to reference positions of JOINTS, each joint's constant offset removed.

    Trackers define joints at different positions on the body, with a constant offset: the median over the frames of each
    joint's difference in the axes of the reference's trunk (from right to left shoulder, from the hips up) is removed.

    Args:
        estimated, reference: (F, 12, 3) [m], frame by frame.
    """
    column = {name: index for index, name in enumerate(JOINTS)}
    sides = [[reference[:, column[f"{side}_{joint}"]] for side in "lr"] for joint in ("shoulder", "hip")]
    up = np.mean(sides[0], axis=0) - np.mean(sides[1], axis=0)
    left = sides[0][0] - sides[0][1]
    ahead = np.cross(left, up)
    axes = np.stack([ahead, np.cross(up, ahead), up], axis=1)
    axes /= np.linalg.norm(axes, axis=2, keepdims=True)
    differences = np.einsum("fij,fkj->fki", axes, estimated - reference)
    known = np.isfinite(differences).all(axis=2)
    for joint in range(differences.shape[1]):
        if known[:, joint].any():
            differences[:, joint] -= np.median(differences[known[:, joint], joint], axis=0)
    return np.asarray(np.linalg.norm(differences, axis=2))


def without_contradictions(reference: FloatArray) -> FloatArray:
    """A reference skeleton (F, 12, 3) without implausible joints: NaN at the distal end of a bone whose length deviates by
    BONE_OFF from its median over the frames.

    The skeleton of another tracker has lost joints, too: in lunges Kinect puts a hidden ankle into the knee. The estimate is not
    used.
    """
    column = {name: index for index, name in enumerate(JOINTS)}
    judged = reference.copy()
    for start, end in _BONES:
        lengths = np.linalg.norm(reference[:, column[end]] - reference[:, column[start]], axis=1)
        known = np.isfinite(lengths)
        if known.any():
            judged[np.abs(lengths / np.median(lengths[known]) - 1.0) > BONE_OFF, column[end]] = np.nan
    return judged


def joint_angles(positions: FloatArray) -> FloatArray:
    """Angles (F, 8) [rad] of a skeleton of JOINTS (F, 12, 3): flexion of elbows and knees, upper arms and thighs against the
    trunk, left and right; the trunk's axis goes from between the hips to between the shoulders. Zero is a hanging, straight
    limb."""
    at = {name: positions[:, index] for index, name in enumerate(JOINTS)}
    down = (at["l_hip"] + at["r_hip"] - at["l_shoulder"] - at["r_shoulder"]) / 2.0
    angles = []
    for side in ("l", "r"):
        shoulder, elbow, wrist, hip, knee, ankle = (at[f"{side}_{joint}"] for joint in LIMB_JOINTS)
        angles += [_between(elbow - shoulder, wrist - elbow), _between(knee - hip, ankle - knee)]
        angles += [_between(down, elbow - shoulder), _between(down, knee - hip)]
    return np.column_stack(angles)


def _between(first: FloatArray, second: FloatArray) -> FloatArray:
    """Angles (F,) [rad] between vectors (F, 3)."""
    across = np.linalg.norm(np.cross(first, second), axis=1)
    return np.asarray(np.arctan2(across, np.einsum("fi,fi->f", first, second)))


def angle_error(estimated: FloatArray, reference: FloatArray) -> tuple[float, float]:
    """Mean absolute error of the joint angles of two skeletons (F, 12, 3), and the standard deviation of the signed error about
    each angle's mean, averaged over the angles [deg]; NaN where nothing is known."""
    errors = np.degrees(joint_angles(estimated) - joint_angles(reference))
    spreads = [column[np.isfinite(column)].std() for column in errors.T if np.isfinite(column).any()]
    return mean_or_nan(np.abs(errors)), float(np.mean(spreads)) if spreads else float("nan")


def shifted(reference: FloatArray | BoolArray, lag: int) -> FloatArray:
    """The reference (F, ...) shifted for an estimate that is `lag` frames late; NaN outside."""
    moved = np.full(reference.shape, np.nan)
    source = np.arange(len(reference)) - lag
    inside = (source >= 0) & (source < len(reference))
    moved[inside] = reference[source[inside]]
    return moved


def best_lag(estimated: FloatArray, reference: FloatArray) -> int:
    """The constant lag [frames] in [-MAX_LAG, MAX_LAG] with the least mean joint error.

    All lags are compared on the same frames, those with a counterpart at every lag; for a short recording the range is reduced
    so that half of the frames remain. Of equal errors the smaller absolute lag is taken, then the positive one.
    """
    reach = min(MAX_LAG, len(estimated) // 4)
    inner = slice(reach, len(estimated) - reach)
    errors = {
        lag: mean_or_nan(joint_errors(estimated, reference, lag=lag)[inner])
        for lag in sorted(range(-reach, reach + 1), key=lambda lag: (abs(lag), -lag))
    }
    known = {lag: error for lag, error in errors.items() if np.isfinite(error)}
    return min(known, key=known.__getitem__) if known else 0


def lost_frames(far: BoolArray, known: BoolArray, stamps: FloatArray) -> BoolArray:
    """Frames (F,) in which one joint counts as lost: runs of `far` that last longer than LOST_AFTER_S.

    A run lasts from its first to its last frame plus one frame period (the median of the stamps' differences), so ten
    frames of a 30 Hz recording last 1/3 s. Frames without a reference neither end nor lengthen a run.
    """
    lost = np.zeros(len(far), dtype=bool)
    observed = np.flatnonzero(known)
    if len(observed) == 0:
        return lost
    period = usual_interval(stamps)
    flags = np.concatenate([[False], far[observed], [False]])
    edges = np.flatnonzero(flags[1:] != flags[:-1])
    for first, end in zip(edges[::2], edges[1::2], strict=True):
        run = observed[first:end]
        if stamps[run[-1]] - stamps[run[0]] + period > LOST_AFTER_S + ROUNDED_S:
            lost[run] = True
    return lost


def tracking_class(errors: FloatArray, stamps: FloatArray, *, limit: float) -> tuple[int | None, BoolArray]:
    """The class of a sequence as in K06 Table I, computed automatically.

    A joint is lost while it is farther than `limit` from the reference for longer than LOST_AFTER_S.

    Args:
        errors: (F, J) distances; NaN where the reference is missing.
        stamps: (F,) [s].
        limit: [m].

    Returns:
        2 if no joint was lost, 1 if some were but none in its last known frame, 0 if a joint is lost in its last known
        frame, None if nothing is known; and a mask (F, J) of lost joints.
    """
    known = np.isfinite(errors)
    lost = np.column_stack(
        [lost_frames(*of_joint, stamps) for of_joint in zip((errors > limit).T, known.T, strict=True)]
    )
    if not known.any():
        return None, lost
    at_end = any(gone[is_known][-1] for gone, is_known in zip(lost.T, known.T, strict=True) if is_known.any())
    return (0 if at_end else 1 if lost.any() else 2), lost


def jitter(positions: FloatArray, still: BoolArray | None = None, *, lag: int = 0) -> float:
    """Mean norm [m] of the second difference of joint positions (F, J, 3) over time; NaN for fewer than three frames.

    It is zero for a body that stands still or moves uniformly. Since it includes real acceleration, compare it with that of
    the reference.

    Args:
        positions: of the estimate, or of the reference itself.
        still: (F, J) where joints should stand still, see standing_still; None: everywhere, also where they move.
        lag: frame i is compared with frame i - lag of `still`: positive if the estimate is late.
    """
    if len(positions) < 3:
        return float("nan")
    second = np.full(positions.shape[:2], np.nan)
    second[1:-1] = np.linalg.norm(np.diff(positions, n=2, axis=0), axis=2)
    return mean_or_nan(second if still is None else second[shifted(still, lag) == 1.0])


def standing_still(reference: FloatArray, stamps: FloatArray) -> BoolArray:
    """Where each joint of the reference (F, J, 3) stands still, (F, J).

    It does in a frame in which it is known, if it stays within STILL_M of its position there from STILL_S before to STILL_S
    after. The noise of a reference is less than that; a motion slower than 0.1 m/s counts as standing. The first and last
    frames, which lack neighbors, do not count.
    """
    frames = len(reference)
    still = np.zeros(reference.shape[:2], dtype=bool)
    period = usual_interval(stamps)
    reach = max(round(STILL_S / period), 1) if period > 0.0 else frames
    if frames <= 2 * reach:
        return still
    middle = reference[reach : frames - reach]
    quiet = np.isfinite(middle).all(axis=2)
    for shift in range(-reach, reach + 1):
        away = np.linalg.norm(reference[reach + shift : frames - reach + shift] - middle, axis=2)
        quiet &= away <= STILL_M
    still[reach : frames - reach] = quiet
    return still


def fraction_within(distances: FloatArray, limit: float) -> float:
    """Fraction of the known distances that are at most `limit`; NaN if none is known."""
    return mean_or_nan((distances[np.isfinite(distances)] <= limit).astype(np.float64))


def mean_or_nan(values: FloatArray) -> float:
    """Mean of the known values; NaN if none is known."""
    known = values[np.isfinite(values)]
    return float(known.mean()) if known.size else float("nan")


def weighted(scores: Sequence[object], name: str, weight: str) -> float:
    """Mean of an attribute of scores where it is known, by another attribute as its weight; NaN without weight."""
    parts = [(getattr(one, name), getattr(one, weight)) for one in scores if np.isfinite(getattr(one, name))]
    total = sum(part[1] for part in parts)
    return float(sum(value * number for value, number in parts) / total) if total else float("nan")
