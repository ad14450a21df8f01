"""Evaluates a result of several persons against the ground truth: CLEAR MOT, identities, false bodies, and joints.

A match is a root (humanoid_root) within MATCH_M of that of a person. Persons with at least the fraction IN_VIEW of their pixels
in view are expected; others may be tracked or not without effect. MOTA, IDF1 and switches of identity are those of py-motmetrics
(Bernardin and Stiefelhagen 2008; Ristani et al. 2016).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from itertools import groupby
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

import voodoo._core as _core
from voodoo.errors import VoodooError, installed
from voodoo.evaluation import metrics
from voodoo.export.table import Arrays
from voodoo.measurements import FloatArray, nearest_stamps
from voodoo.recordings.people_truth import PeopleTruth

MATCH_M = 0.5
"""Largest distance of matching roots [m]."""
IN_VIEW = 0.3
"""Persons with at least this fraction of their pixels in view are expected."""
JOINTS_IN_VIEW = 0.8
"""Joints are evaluated from this fraction on; a person who reaches it has arrived."""
ABSENT_S = 2.0
"""A person who was not in view for longer than this [s] has left."""
SAME_TIME_S = 0.01
"""Largest difference of the stamps of truth and result in one frame [s]."""
ROOT = "humanoid_root"
RULES = (
    f"A match is a root within {MATCH_M:g} m of a person with {IN_VIEW:g} or more of their pixels in view; who is less in view "
    f"may be followed or not. MOTA, IDF1 and switches are those of py-motmetrics. First pose: from {JOINTS_IN_VIEW:g} in view "
    f"on. Return: after more than {ABSENT_S:g} s out of view. A false body is a stretch of an id that matches nobody; one that "
    f"follows on a match of this id is left behind. Joints count from {JOINTS_IN_VIEW:g} in view on."
)
"""Explains a table of scores."""
_NEVER = 1e6
_LAST = 10.0


@dataclass(frozen=True)
class PeopleScore:
    """Evaluation of the persons of one or several recordings; meters, seconds, NaN if unknown.

    Args:
        name, path: of the recording.
        failure: why it could not be tracked or evaluated; "" if it was.
        seconds: duration.
        persons: number in the truth.
        ids: number in the result.
        expected: number of pairs of a person and a frame with enough pixels in view.
        missed, extra: number of these without a match, and of rows of the result without a match.
        switches: identity switches: a person is matched with another id than at the last match.
        id_true, id_false, id_missed: IDTP, IDFP and IDFN, see `idf1`.
        returns, returned: number of returns after leaving, and of those with the same id.
        visits, visits_matched: number of arrivals, and of those with a match.
        first_pose_s: time from JOINTS_IN_VIEW of a person to the first match, mean over the visits that had one.
        worst_first_pose_s: the longest of them.
        false_bodies: intervals of an id without a match that do not follow a match of this id.
        left_behind: those that follow a match: a body that stays or drifts away from its person.
        joint_error_m: mean over `joints` distances of metrics.JOINTS.
        joints: number of distances.
        step_s: mean time of a frame; NaN for a result from a file.
    """

    name: str
    path: Path
    failure: str = ""
    seconds: float = 0.0
    persons: int = 0
    ids: int = 0
    expected: int = 0
    missed: int = 0
    extra: int = 0
    switches: int = 0
    id_true: float = 0.0
    id_false: float = 0.0
    id_missed: float = 0.0
    returns: int = 0
    returned: int = 0
    visits: int = 0
    visits_matched: int = 0
    first_pose_s: float = np.nan
    worst_first_pose_s: float = np.nan
    false_bodies: int = 0
    left_behind: int = 0
    joint_error_m: float = np.nan
    joints: int = 0
    step_s: float = np.nan

    @property
    def nobody(self) -> bool:
        """Whether the result has no person."""
        return not self.ids

    @property
    def mota(self) -> float:
        """1 - (missed + extra + switches) / expected; NaN if no person is expected."""
        return 1.0 - (self.missed + self.extra + self.switches) / self.expected if self.expected else float("nan")

    @property
    def idf1(self) -> float:
        """2 IDTP / (2 IDTP + IDFP + IDFN) for the best assignment of ids to persons; NaN without persons."""
        total = 2.0 * self.id_true + self.id_false + self.id_missed
        return 2.0 * self.id_true / total if total else float("nan")

    @property
    def false_a_minute(self) -> float:
        """False bodies per minute."""
        return 60.0 * self.false_bodies / self.seconds if self.seconds else float("nan")


@dataclass(frozen=True, eq=False)
class Matches:
    """Matches of persons and ids in each of F frames, which are those of truth and result.

    Args:
        stamps: (F,) [s].
        truth: (F,) row of the truth, -1 without.
        rows: F lists of rows of the result.
        ids: I ids of the result, increasing.
        of_person: (F, P) index of the id matched with a person, -1 without.
        of_id: (F, I) index of the person, -1 without a match, -2 without a pose, -3 at a person who is not expected.
        counts: of py-motmetrics.
    """

    stamps: FloatArray
    truth: npt.NDArray[np.int64]
    rows: list[npt.NDArray[np.int64]]
    ids: npt.NDArray[np.int64]
    of_person: npt.NDArray[np.int64]
    of_id: npt.NDArray[np.int64]
    counts: dict[str, float]


NOBODY, NO_POSE, ASIDE = -1, -2, -3
"""See Matches."""


def score(
    name: str, path: Path, truth: PeopleTruth, rows: Arrays, *, seconds: float, step_s: float = np.nan
) -> PeopleScore:
    """Evaluate a result.

    Args:
        name, path: of the recording.
        truth: in the result's root frame.
        rows: the result: `stamps` (R,), `person` (R,), `joint_names` (J,) and `joints` (R, J, 3), NaN without a pose.
        seconds: duration of the recording.
        step_s: mean time of a frame.

    Raises:
        VoodooError: no stamp of the result is in the truth, or py-motmetrics is not installed.
    """
    found = match(truth, rows)
    waits, visits, returns, returned = _visits(truth, found)
    false_bodies, left_behind = _false_bodies(found)
    errors = _joint_errors(truth, rows, found)
    return PeopleScore(
        name,
        path,
        seconds=seconds,
        persons=len(truth.persons),
        ids=len(found.ids),
        expected=int(found.counts["num_objects"]),
        missed=int(found.counts["num_misses"]),
        extra=int(found.counts["num_false_positives"]),
        switches=int(found.counts["num_switches"]),
        id_true=found.counts["idtp"],
        id_false=found.counts["idfp"],
        id_missed=found.counts["idfn"],
        returns=returns,
        returned=returned,
        visits=visits,
        visits_matched=len(waits),
        first_pose_s=float(np.mean(waits)) if waits else np.nan,
        worst_first_pose_s=max(waits) if waits else np.nan,
        false_bodies=false_bodies,
        left_behind=left_behind,
        joint_error_m=metrics.mean_or_nan(errors),
        joints=int(np.isfinite(errors).sum()),
        step_s=step_s,
    )


_Indices: TypeAlias = npt.NDArray[np.int64]


def _frames(truth: PeopleTruth, rows: Arrays) -> tuple[FloatArray, _Indices, list[_Indices]]:
    """Stamps, the truth's row and the result's rows of each frame, see Matches."""
    own, row = np.unique(rows["stamps"], return_inverse=True)
    near = nearest_stamps(truth.stamps, own, within=SAME_TIME_S)
    same = near >= 0
    if len(own) and not same.any():
        raise VoodooError(
            f"result: expected stamps of the truth, {truth.stamps[0]:.6f} to {truth.stamps[-1]:.6f} s, found "
            f"{own[0]:.6f} to {own[-1]:.6f} s and none in common"
        )
    # Stamps of the result without persons in the truth are frames, too.
    stamps = np.concatenate([truth.stamps, own[~same]])
    of_truth = np.concatenate([np.arange(len(truth.stamps)), np.full(int((~same).sum()), -1)])
    frame_of = np.where(same, near, len(truth.stamps) - 1 + np.cumsum(~same))
    order = np.argsort(stamps, kind="stable")
    row_frame = np.argsort(order)[frame_of[row]]
    return stamps[order], of_truth[order], [np.flatnonzero(row_frame == index) for index in range(len(stamps))]


def match(truth: PeopleTruth, rows: Arrays) -> Matches:
    """Match persons and ids frame by frame, jointly for all persons and keeping the pairs of the previous frame."""
    mm, (stamps, of_truth, of_result) = motmetrics(), _frames(truth, rows)
    roots = truth.of(ROOT)
    own = metrics.places_of(rows["joint_names"].tolist(), rows["joints"], (ROOT,))[:, 0]
    posed = np.asarray(np.isfinite(own).all(axis=1))
    ids = np.unique(rows["person"][posed])
    of_person = np.full((len(stamps), len(truth.persons)), NOBODY, dtype=np.int64)
    of_id = np.full((len(stamps), len(ids)), NO_POSE, dtype=np.int64)
    judge = mm.MOTAccumulator()
    for index, (place, there) in enumerate(zip(of_truth, of_result, strict=True)):
        there = there[posed[there]]
        in_view = np.zeros(len(truth.persons)) if place < 0 else truth.in_view[place]
        away = np.full((len(truth.persons), len(there)), np.nan)
        if place >= 0:
            away = np.linalg.norm(roots[place][:, None] - own[there][None], axis=2)
        away[~(away <= MATCH_M)] = np.nan
        expected = np.flatnonzero(in_view >= IN_VIEW)
        aside = _at_others(away, in_view >= IN_VIEW)
        columns = np.searchsorted(ids, rows["person"][there])
        of_id[index, columns] = np.where(aside, ASIDE, NOBODY)
        judge.update(expected, columns[~aside], away[expected][:, ~aside], frameid=index)
    events = judge.mot_events
    pairs = events[events.Type.isin(("MATCH", "SWITCH"))]
    which = pairs.index.get_level_values("FrameId").to_numpy(dtype=np.int64)
    persons, columns = pairs.OId.to_numpy(dtype=np.int64), pairs.HId.to_numpy(dtype=np.int64)
    of_person[which, persons], of_id[which, columns] = columns, persons
    names = ["num_objects", "num_misses", "num_false_positives", "num_switches", "idtp", "idfp", "idfn"]
    found = mm.metrics.create().compute(judge, metrics=names, return_dataframe=False)
    counts = {name: 0.0 if np.isnan(found[name]) else float(found[name]) for name in names}
    return Matches(stamps, of_truth, of_result, ids, of_person, of_id, counts)


def _at_others(away: FloatArray, expected: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    """Which bodies (N,) are those of persons who are not expected, by distances (P, N) [m], NaN where too far."""
    cost = np.where(np.isnan(away), _NEVER, away + np.where(expected, 0.0, _LAST)[:, None])
    persons, columns = np.array(_core.linear_sum_assignment(cost), dtype=np.intp).reshape(-1, 2).T
    other = ~expected[persons] & (cost[persons, columns] < _NEVER)
    return np.isin(np.arange(away.shape[1]), columns[other])


def _visits(truth: PeopleTruth, found: Matches) -> tuple[list[float], int, int, int]:
    """Times [s] to the first match of visits with one; numbers of visits, returns, and returns with the same id."""
    place = np.searchsorted(found.stamps, truth.stamps)
    waits: list[float] = []
    visits = returns = returned = 0
    for column in range(len(truth.persons)):
        last: int | None = None
        there = np.flatnonzero(truth.in_view[:, column] > 0.0)
        parts = np.split(there, np.flatnonzero(np.diff(truth.stamps[there]) > ABSENT_S) + 1) if len(there) else []
        for part in parts:
            clear = part[truth.in_view[part, column] >= JOINTS_IN_VIEW]
            if not len(clear):
                continue
            visits += 1
            ids = found.of_person[place[part], column]
            if last is not None:
                returns += 1
            if (ids >= 0).any():
                first = truth.stamps[part[int((ids >= 0).argmax())]]
                waits.append(max(float(first - truth.stamps[clear[0]]), 0.0))
                most = int(np.bincount(ids[ids >= 0]).argmax())
                returned += last == most
                last = most if last is None else last
    return waits, visits, returns, returned


def _false_bodies(found: Matches) -> tuple[int, int]:
    """Numbers of intervals of ids without a match: those that begin so, and those that follow a match."""
    appeared = left = 0
    for column in range(len(found.ids)):
        before = NO_POSE
        for state, _ in groupby(found.of_id[:, column].tolist()):
            if state == NOBODY:
                appeared += before == NO_POSE
                left += before != NO_POSE
            before = state
    return appeared, left


def _joint_errors(truth: PeopleTruth, rows: Arrays, found: Matches) -> FloatArray:
    """Distances (N, 12) [m] of metrics.JOINTS in all matches of persons who are in view."""
    truth_positions = np.stack([truth.of(name) for name in metrics.JOINTS], axis=2)
    own = metrics.places_of(rows["joint_names"].tolist(), rows["joints"])
    pairs = []
    for index, person in np.argwhere(found.of_person >= 0):
        place = found.truth[index]
        if truth.in_view[place, person] >= JOINTS_IN_VIEW:
            there = found.rows[index]
            row = there[rows["person"][there] == found.ids[found.of_person[index, person]]][0]
            pairs.append(np.linalg.norm(own[row] - truth_positions[place, person], axis=1))
    return np.array(pairs) if pairs else np.empty((0, len(metrics.JOINTS)))


def motmetrics() -> Any:  # noqa: ANN401 - py-motmetrics has no types
    """py-motmetrics, which is optional.

    Raises:
        VoodooError: it is not installed; says how to install it.
    """
    return installed("motmetrics", "several people are judged by py-motmetrics: pip install 'voodoo-tracker[eval]'")


def together(scores: Sequence[PeopleScore]) -> PeopleScore:
    """Combines the scores without failure: sums of counts, and means weighted by their counts."""
    good = [one for one in scores if not one.failure]
    counted = [field.name for field in fields(PeopleScore) if field.default == 0]
    sums = {name: sum(getattr(one, name) for one in good) for name in counted}
    worst = [one.worst_first_pose_s for one in good if np.isfinite(one.worst_first_pose_s)]
    return PeopleScore(
        "together",
        Path(),
        **sums,
        first_pose_s=metrics.weighted(good, "first_pose_s", "visits_matched"),
        worst_first_pose_s=max(worst, default=np.nan),
        joint_error_m=metrics.weighted(good, "joint_error_m", "joints"),
        step_s=metrics.weighted(good, "step_s", "seconds"),
    )
