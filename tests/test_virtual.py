"""Sequences of our own body: their truth, what the tracker makes of them, and R07's stress."""

import itertools

import numpy as np
import pytest

import voodoo
from disturbance import Disturbance, disturbed
from synthetic.grown import grown
from synthetic.sequence import VirtualSequence
from voodoo.evaluation import metrics
from voodoo.ik import Chain
from voodoo.ik.angles import angles_of

SMALL = voodoo.Camera(320, 240, 275.0, 275.0, 159.5, 119.5)


@pytest.fixture(scope="module")
def body():
    return voodoo.Body.human(height=1.78, model="papers")


def sequence(body, **how):
    return VirtualSequence(body=body, **({"camera": SMALL, "frames": 60} | how))


def joints_of(places):
    return np.array([places[name] for name in metrics.JOINTS])


def follow(frames, sequence, tracker):
    """Errors (F, 12) [m], joint angles (F, A) and their truth of the frames that were taken, and how many were not."""
    chain, rows, refused = Chain(tracker.body), [], 0
    for frame in frames:
        if not rows:
            tracker.reset_pose(frame.world_from_limb)
        try:
            estimate = tracker.step(sequence.measurement(frame))
        except voodoo.MeasurementError as error:
            assert "expected a time after" in str(error)
            refused += 1
            continue
        error = np.linalg.norm(joints_of(estimate.joints) - joints_of(frame.joints), axis=1)
        rows.append((error, angles_of(chain, estimate), frame.angles[6:]))
    return *(np.array(column) for column in zip(*rows, strict=True)), refused


def test_truth_and_images_belong_together(body):
    frames = list(sequence(body, speed=3.0, frames=4, noise_m=0.0))
    assert len(sequence(body).angle_names) >= 25
    assert [frame.stamp for frame in frames] == pytest.approx([0.0, 1 / 30, 2 / 30, 3 / 30])
    moved = np.abs(frames[3].angles - frames[0].angles)
    assert (moved > 1e-4).all(), "every freedom moves"
    for frame in frames:
        tracker = voodoo.Tracker(body)
        estimate = tracker.reset_pose(frame.world_from_limb)
        assert joints_of(estimate.joints) == pytest.approx(joints_of(frame.joints), abs=1e-9)
        depth = frame.image * 0.001
        rays = np.dstack([SMALL.rays(), np.ones(depth.shape)]) * depth[..., None]
        pose = sequence(body).world_from_sensor
        points = rays[depth < 3.5].astype(np.float64) @ pose[:3, :3].T + pose[:3, 3]
        assert len(points) > 3000
        assert np.abs(tracker.distance(points)).max() < 0.001
    again = list(sequence(body, speed=3.0, frames=4, noise_m=0.0))
    assert all(np.array_equal(one.image, other.image) for one, other in zip(frames, again, strict=True))


def test_noise_grows_with_the_square_of_the_depth(body):
    noisy, clean = (next(iter(sequence(body, noise_m=noise, frames=1))).image for noise in (0.004, 0.0))
    off = noisy.astype(np.float64) - clean
    wall = clean == 3600
    assert np.std(off[wall]) == pytest.approx(4.0 * (3.6 / 2.4) ** 2, rel=0.05)
    assert np.std(off[~wall]) == pytest.approx(4.0, rel=0.15)


@pytest.mark.parametrize(("speed", "mean", "most"), [(1.0, 0.002, 0.020), (10.0, 0.003, 0.060)])
def test_perfect_model(body, speed, mean, most):
    errors, _, _, refused = follow(sequence(body, speed=speed), sequence(body), voodoo.Tracker(body))
    assert refused == 0
    assert errors.mean() < mean
    assert errors.max() < most


def test_surfaces_too_thick_and_too_long(body):
    wrong = grown(body, thicker=1.10, longer=1.05, joints=False)
    assert wrong.limbs[0].shape.a0 == pytest.approx(1.10 * body.limbs[0].shape.a0)
    assert wrong.limbs[0].shape.length == pytest.approx(1.05 * body.limbs[0].shape.length)
    errors, _, _, _ = follow(sequence(body, speed=3.0), sequence(body), voodoo.Tracker(wrong))
    assert 0.004 < errors.mean() < 0.014


def test_disturbances_are_what_they_report(body):
    clean = list(sequence(body, frames=40))
    how = Disturbance(rectangles=0, corrupted=0.1, blank=0.1, repeated=0.1, late=0.1)
    found = list(disturbed(clean, how))
    again = list(disturbed(clean, how))
    assert len(found) > len(clean)
    assert all(np.array_equal(one.image, other.image) for one, other in zip(found, again, strict=True))
    hit = np.mean(found[0].image != clean[0].image)
    assert hit == pytest.approx(0.15, abs=0.01)
    assert any(not frame.image.any() for frame in found)
    late = sum(one.stamp >= other.stamp for one, other in itertools.pairwise(found))
    assert late == len(found) - len(clean)
    assert clean[0].image.min() > 0, "the frames themselves are untouched"


def test_broken_frames_lose_hardly_anybody_and_the_penalty_calms(body):
    """R07 section 5.2: 15 % noise, and frames that are corrupted, blank, repeated and out of order."""
    lost, means, jitters = 0, [], []
    source = sequence(body, speed=3.0)
    broken = {"rectangles": 0, "corrupted": 0.04, "blank": 0.04, "repeated": 0.04, "late": 0.04}
    for seed in (7, 8, 9, 10):
        frames = disturbed(source, Disturbance(**broken, seed=seed))
        errors, angles, _, refused = follow(frames, source, voodoo.Tracker(body))
        lost += metrics.tracking_class(errors, np.arange(len(errors)) / 30.0, limit=0.10)[1].any()
        assert refused > 0
        means.append(errors.mean())
        jitters.append(np.var(np.diff(angles, n=2, axis=0), axis=0).mean())
    assert lost <= 1 and sorted(means)[-2] < 0.02
    loose = voodoo.Tracker(body, config=voodoo.Config(motion_scale=100.0))
    _, angles, _, _ = follow(disturbed(source, Disturbance(**broken)), source, loose)
    assert jitters[0] < 0.5 * np.var(np.diff(angles, n=2, axis=0), axis=0).mean()


def test_calm_steadies_a_body_that_does_not_fit_well(body):
    """Rough surfaces make a standing body tremble; what deviates little from the prediction is held as noise."""
    source = sequence(body, speed=0.05, frames=40, noise_m=0.03)
    trembling = []
    for calm in (voodoo.Config().still_prior_gain, 0.0):
        tracker = voodoo.Tracker(body, config=voodoo.Config(still_prior_gain=calm))
        errors, angles, _, _ = follow(list(source), source, tracker)
        assert errors.mean() < 0.01
        trembling.append(np.var(np.diff(angles, n=2, axis=0), axis=0).mean())
    assert trembling[0] < 0.7 * trembling[1]


@pytest.mark.parametrize("seed", [1, 4])
def test_rectangles_lose_nobody(body, seed):
    """R07 section 5.2 in full, where a single disturbed frame once made a hypothesis throw up a leg."""
    source = VirtualSequence(body=body, speed=3.0, frames=110, seed=seed)
    errors, _, _, refused = follow(disturbed(source, Disturbance()), source, voodoo.Tracker(body))
    assert refused < len(errors) / 10
    assert not metrics.tracking_class(errors, np.arange(len(errors)) / 30.0, limit=0.10)[1].any()
    assert errors.mean() < 0.02


def test_wrong_numbers_are_refused(body):
    for wrong in ({"speed": -1.0}, {"noise_m": float("nan")}, {"frames": 0}):
        with pytest.raises(ValueError, match=next(iter(wrong))):
            VirtualSequence(body=body, **wrong)
