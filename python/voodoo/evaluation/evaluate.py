"""Evaluates the tracker on recordings with ground truth or a reference skeleton, in parallel processes."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from voodoo._core import Estimate
from voodoo.children import children
from voodoo.config import Config
from voodoo.errors import RecordingError, VoodooError
from voodoo.evaluation import metrics
from voodoo.evaluation.calibration import Deviations, sigma_of
from voodoo.evaluation.depth_agreement import WITHIN_M, Selection, witness
from voodoo.evaluation.metrics import BoolArray
from voodoo.evaluation.people import PeopleScore
from voodoo.evaluation.people_evaluate import evaluate_people, has_people
from voodoo.evaluation.score import LIMIT_EXACT_M, LIMIT_REFERENCE_M, FrameTable, Score
from voodoo.export.track import Track
from voodoo.measurements import FloatArray, usual_interval
from voodoo.names import SEARCHING, Automatic, HumanModel
from voodoo.pipeline.inputs import pictures_alone
from voodoo.pipeline.run import track
from voodoo.pipeline.start import start_tracker
from voodoo.recordings.loaders import open_recording
from voodoo.recordings.recording import Recording
from voodoo.sensors.settings import FrontEndSettings

_OF_TERMINALS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGHUP") if hasattr(signal, name))
"""Signals of Ctrl-C and of a terminal that is closed."""


CARRIER = {
    f"{side}_{joint}": f"{side}_{limb}"
    for side in ("l", "r")
    for joint, limb in (("elbow", "upperarm"), ("wrist", "forearm"), ("knee", "thigh"), ("ankle", "calf"))
}
"""The limb that ends at a joint."""

NOWHERE_M = 10.0
"""Error of a joint while no person is tracked, larger than every limit, for the tracking class."""
_SAME_TIME_S = 0.1
"""Greatest time between a frame and the true joints by which its points are selected."""
_SEGMENTED_LOADERS = ("utd-mhad",)


def evaluate(
    path: Path,
    *,
    config: Config | None = None,
    options: Mapping[str, Any] | None = None,
    model: HumanModel | None = None,
    use: Sequence[str] | None = None,
    init: Automatic | None = None,
) -> tuple[Score, FrameTable]:
    """Track a recording from its own start and evaluate the result.

    Args:
        path: of the recording.
        config: None means the defaults.
        options: see open_recording.
        model: see start_tracker.
        use: kinds of inputs; None: all.
        init: "auto" ignores the start of the recording and searches for a person, as for recordings without a start.

    Raises:
        VoodooError: it cannot be read, or a frame was refused.
    """
    how = dict(options or {})
    recording = open_recording(path, **how | pictures_alone(path, how.get("loader"), use))
    tracker = start_tracker(recording, init=init, config=config, model=model, use=use)
    selection = select_by(recording)
    reference, steps = recording.reference, []
    for frame in track(recording, tracker, settings=FrontEndSettings.of(recording, use=use)):
        estimate = frame.estimate
        truth = reference.at(estimate.stamp, reference.names, within=_SAME_TIME_S) if reference else {}
        joints = np.array([estimate.joints.get(name, np.full(3, np.nan)) for name in metrics.JOINTS], dtype=np.float64)
        observed = witness(frame.recorded, tracker, estimate, truth, selection)
        known = joints, called_measured(estimate), sigma_of(estimate)
        # The images of a whole recording would fill the memory.
        steps.append((float(estimate.stamp), str(estimate.status), frame.seconds, observed, *known))
    if not steps:
        raise RecordingError(f"{path}: expected at least one frame, found none")
    return _score(recording, path, selection, steps)


def compare(recording: Recording, result: Track, *, at_best_lag: bool = False) -> FloatArray:
    """Errors (F, 12) [m] of metrics.JOINTS against the recording's reference, at lag 0 or at the best one; NaN where it is
    missing."""
    return np.asarray(np.linalg.norm(differences(recording, result, at_best_lag=at_best_lag), axis=2))


def differences(recording: Recording, result: Track, *, at_best_lag: bool = False) -> FloatArray:
    """Errors by coordinate, (F, 12, 3): estimate minus reference."""
    positions = metrics.places_of(result.joint_names, result.joints)
    reference = reference_positions(recording, result.stamps)
    lag = metrics.best_lag(positions, reference) if at_best_lag else 0
    return np.asarray(positions - metrics.shifted(reference, lag))


def called_measured(estimate: Estimate) -> BoolArray:
    """For metrics.JOINTS (12,), whether the status of the limb that ends there is "measured"; False for joints of the trunk."""
    return np.array([estimate.limb_status.get(CARRIER.get(name, "")) == "measured" for name in metrics.JOINTS])


def limb_ends(errors: FloatArray, *, far: bool) -> BoolArray:
    """Masks (F, 12) of the joints at ends of limbs that are farther than LIMIT_EXACT_M from the truth, and of the nearer ones."""
    ends = np.array([name in CARRIER for name in metrics.JOINTS])
    return np.asarray(np.isfinite(errors) & ends & ((errors > LIMIT_EXACT_M) == far))


def select_by(recording: Recording) -> Selection:
    """How the person's points are segmented from the background in this recording, see depth_agreement."""
    if recording.info().loader in _SEGMENTED_LOADERS:
        return "segmented"
    return "truth" if recording.reference is not None and recording.reference.exact else "model"


def evaluate_all(
    paths: Sequence[Path],
    *,
    jobs: int = 1,
    **how: Any,  # noqa: ANN401 - of evaluate
) -> Iterator[tuple[int, Score | PeopleScore, FrameTable | None]]:
    """Evaluate recordings in parallel processes; yields (index in `paths`, score, frames) in the order of completion.

    One with the truth of several persons yields their score, and no frames. A recording that fails yields a score with `failure`
    set and no frames. jobs=1 stays in this process.

    Args:
        paths: of the recordings.
        jobs: number of processes.
        **how: other options of `evaluate`.
    """
    task = partial(_task, how)
    if jobs == 1 or len(paths) == 1:
        for index, path in enumerate(paths):
            yield index, *task(path)
        return
    others = set(multiprocessing.active_children())
    with children():  # starts a helper process of multiprocessing
        pool = ProcessPoolExecutor(
            min(jobs, len(paths)), mp_context=multiprocessing.get_context("spawn"), initializer=use_one_thread
        )
    done = False
    try:
        with children(), _deaf_children():
            futures = {pool.submit(task, path): index for index, path in enumerate(paths)}
        for future in as_completed(futures):
            yield futures[future], *future.result()
        done = True
    except BrokenProcessPool as error:
        raise VoodooError(f"evaluation: a worker process died ({error}); try fewer --jobs") from error
    finally:
        if not done:
            # A worker finishes its recording before it takes another task; after Ctrl-C it is terminated.
            for worker in set(multiprocessing.active_children()) - others:
                worker.kill()
        pool.shutdown(wait=done, cancel_futures=True)


@contextmanager
def _deaf_children() -> Iterator[None]:
    """Processes started inside ignore what a terminal sends to all processes; this process terminates them."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    received = {number: signal.signal(number, signal.SIG_IGN) for number in _OF_TERMINALS}
    try:
        yield
    finally:
        for number, handler in received.items():
            signal.signal(number, handler)


def use_one_thread() -> None:
    """Initialize a worker: one thread each, because the processes run in parallel."""
    os.environ.setdefault("RAYON_NUM_THREADS", "1")
    cv2.setNumThreads(1)


def _task(how: Mapping[str, Any], path: Path) -> tuple[Score | PeopleScore, FrameTable | None]:
    several = has_people(path)
    try:
        return evaluate_people(path, **how) if several else evaluate(path, **how)
    except (VoodooError, OSError) as error:
        return (PeopleScore if several else Score)(path.name, path, failure=str(error)), None


def _score(
    recording: Recording, path: Path, selection: Selection, steps: Sequence[tuple[Any, ...]]
) -> tuple[Score, FrameTable]:
    stamp, status, time, agreements, joints, known, spread = zip(*steps, strict=True)
    stamps, seconds, positions, measured, sigma = map(np.array, (stamp, time, joints, known, spread))
    overlaps, within = (np.array([getattr(one, name) for one in agreements]) for name in ("iou", "within"))
    whole = reference_positions(recording, stamps)
    exact = None if recording.reference is None else recording.reference.exact
    reference = metrics.without_contradictions(whole) if exact is False else whole
    lag = metrics.best_lag(positions, reference)
    errors0 = metrics.joint_errors(positions, reference)
    errors_best = metrics.joint_errors(positions, reference, lag=lag)
    errors = errors_best if exact is False else errors0
    limit = LIMIT_EXACT_M if exact else LIMIT_REFERENCE_M
    searching = np.array([word == SEARCHING for word in status])
    # A person who is present but not found counts as lost, like one tracked at a wrong position.
    missed = searching[:, None] & np.isfinite(whole).all(axis=2)
    class_, lost = metrics.tracking_class(np.where(missed, NOWHERE_M, errors), stamps, limit=limit)
    compared = metrics.shifted(reference, 0 if exact else lag)
    without = metrics.without_offsets(positions, compared)
    class_without, _ = metrics.tracking_class(np.where(missed, NOWHERE_M, without), stamps, limit=limit)
    still = metrics.standing_still(reference, stamps)
    distances, about = (
        np.concatenate([getattr(one, name) for one in agreements]) for name in ("distances", "about_joints")
    )
    left_out = float(1.0 - np.isfinite(reference).sum() / np.isfinite(whole).sum()) if exact is False else np.nan
    angle_error, angle_spread = metrics.angle_error(positions, compared)
    first_wait, first_error = _first_pose(stamps, status, whole, errors0)
    far, near = (limb_ends(errors, far=which) for which in (True, False))
    score = Score(
        name=recording.name,
        path=path,
        frames=len(steps),
        exact=exact,
        error_m=metrics.mean_or_nan(errors),
        error_lag0_m=metrics.mean_or_nan(errors0),
        error_best_lag_m=metrics.mean_or_nan(errors_best),
        best_lag=None if class_ is None else lag,
        error_without_offsets_m=metrics.mean_or_nan(without),
        class_without_offsets=np.nan if class_without is None else float(class_without),
        lost_without_offsets=np.nan if class_without is None else float(class_without == 0),
        first_pose_s=first_wait,
        first_pose_error_m=first_error,
        within_5cm=metrics.fraction_within(errors, 0.05),
        within_10cm=metrics.fraction_within(errors, 0.10),
        joint_error_m={name: metrics.mean_or_nan(errors[:, index]) for index, name in enumerate(metrics.JOINTS)},
        tracking_class=class_,
        lost_joints=tuple(name for index, name in enumerate(metrics.JOINTS) if lost[:, index].any()),
        selection=selection if distances.size else None,
        depth_within_5cm=metrics.fraction_within(distances, WITHIN_M),
        depth_median_m=float(np.median(distances)) if distances.size else np.nan,
        depth_p95_m=float(np.percentile(distances, 95.0)) if distances.size else np.nan,
        person_within_5cm=metrics.fraction_within(distances[about], WITHIN_M),
        silhouette_iou=metrics.mean_or_nan(overlaps),
        jitter_m=metrics.jitter(positions),
        reference_jitter_m=metrics.jitter(reference),
        standing_jitter_m=metrics.jitter(positions, still, lag=lag if exact is False else 0),
        reference_standing_jitter_m=metrics.jitter(reference, still),
        degraded_share=float(np.mean([word == "degraded" for word in status])),
        lost_share=float(np.mean([word == "lost" for word in status])),
        searching_share=float(searching.mean()),
        lost_recall=metrics.mean_or_nan((~measured[far]).astype(np.float64)),
        false_alarm_rate=metrics.mean_or_nan((~measured[near]).astype(np.float64)),
        far_ends=int(far.sum()),
        near_ends=int(near.sum()),
        step_s=float(seconds.mean()),
        angle_error_deg=angle_error,
        angle_spread_deg=angle_spread,
        left_out_share=left_out,
    )
    deviations = None if exact is None else Deviations(positions - compared, sigma, measured)
    return score, FrameTable(stamps, status, errors, lost, within, overlaps, seconds, deviations)


def _first_pose(
    stamps: FloatArray, status: Sequence[str], reference: FloatArray, errors: FloatArray
) -> tuple[float, float]:
    """Time from the first frame of the reference to the first pose [s], and its mean error [m]; NaN without either."""
    found = [index for index, word in enumerate(status) if word != SEARCHING]
    known = np.flatnonzero(np.isfinite(reference).all(axis=(1, 2)))
    if not found or not len(known):
        return float("nan"), float("nan")
    return max(float(stamps[found[0]] - stamps[known[0]]), 0.0), metrics.mean_or_nan(errors[found[0]])


def reference_positions(recording: Recording, stamps: FloatArray) -> FloatArray:
    """Reference of the twelve joints at the stamps, (F, 12, 3); NaN where there is none."""
    reference = recording.reference
    if reference is None:
        return np.full((len(stamps), len(metrics.JOINTS), 3), np.nan)
    table = metrics.places_of(reference.names, reference.positions)
    return metrics.match_reference(stamps, reference.stamps, table, tolerance=0.5 * usual_interval(reference.stamps))
