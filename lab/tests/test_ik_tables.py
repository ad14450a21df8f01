"""J10's tables on rendered recordings and real cameras, as lab/experiments/ik_tables.py makes them."""

from functools import cache

import ik_limbs
import ik_open
import ik_pose2sim
import ik_tables
import numpy as np
import pytest

from measurement_data import data_folder
from voodoo.model.projection import CameraView


@pytest.fixture(scope="module")
def sequence(voodoo_data):
    """A rendered recording with its silhouettes by name, made once."""
    return cache(lambda name: ik_tables.rendered(voodoo_data / "rendered" / name))


@pytest.fixture(scope="module")
def solved(sequence):
    """Mean errors of what was solved of it, once each."""

    @cache
    def solve(name, views, **options):
        return means(sequence(name).solve(views, **options), sequence(name).truth)

    return solve


def means(found, truth):
    errors = ik_limbs.errors(found, truth)
    return np.array([np.mean([errors[f"{side}_{joint}"] for side in "lr"]) for joint in ("elbow", "knee")])


@pytest.mark.long
@pytest.mark.parametrize("name", ["dev_03_punch", "dev_05_walk"])
def test_images_halve_the_error_of_the_inner_joints(sequence, solved, name):
    plain, one, two = (solved(name, views) for views in (0, 1, 2))
    for found in (one, two):
        assert (found < 0.5 * plain).all() and (found < 0.025).all()
    assert (two < one + 0.001).all()  # a second view does no harm
    # One view is nearly as good as two, but for the puncher's knees, which move along its line of sight.
    assert one[0] < two[0] + 0.006 and (name == "dev_03_punch" or one[1] < two[1] + 0.006)
    # The second view shows the limbs along the true joints: their axes lie in its silhouettes.
    sequence = sequence(name)
    for frame in range(0, len(sequence.side), 20):
        view = CameraView(ik_tables.SIDE_CAMERA, sequence.side_pose(frame))
        for joint, (_, first, last) in ik_limbs.LIMBS.items():
            ends = np.stack([sequence.truth[site][frame] for site in (first, joint, last)])
            along = np.concatenate([ends[:1] + (ends[1] - ends[0]) * fraction for fraction in (0.3, 0.6)]
                                   + [ends[1:2] + (ends[2] - ends[1]) * fraction for fraction in (0.2, 0.5, 0.8)])  # fmt: skip
            u, v = np.rint(view.project(along)[0]).astype(int).T
            observed = (u >= 0) & (v >= 0) & (u < 320) & (v < 240)
            assert (sequence.side[frame].distance[v[observed], u[observed]] < -1.0).all(), (frame, joint)


@pytest.mark.long
@pytest.mark.parametrize("name", ["dev_03_punch", "dev_07_sword_cmu"])
def test_the_mean_posture_helps_where_one_view_does_not_report(solved, name):
    alone = solved(name, 1)
    plain, one, two = (solved(name, views, rest="mean") for views in (0, 1, 2))
    assert one.mean() < 0.9 * alone.mean() and (one < alone + 0.001).all()
    assert (one < plain).all()
    if name == "dev_03_punch":
        # Half of what two views are better by, for the knees; and half of plain inverse kinematics that has the same rest.
        without = solved(name, 2)
        assert one[1] - two[1] < 0.55 * (alone[1] - without[1]) and (one < 0.5 * plain).all()


@pytest.mark.long
def test_depths_report_of_arms_before_the_trunk(solved):
    silhouette, deep = solved("dev_07_sword_cmu", 1), solved("dev_07_sword_cmu", 1, deep=True)
    assert deep[0] < 0.5 * silhouette[0] and deep[1] < silhouette[1] + 0.001


@pytest.mark.long
def test_one_view_leaves_open_what_it_cannot_see(sequence, monkeypatch):
    monkeypatch.setattr(ik_open, "EVERY", 8)

    def left(name: str, views: int) -> np.ndarray:
        found = ik_open.left_open(sequence(name), views)
        return np.mean([values.mean(axis=0) for values in found.values()], axis=0)

    # A boxer before the camera: his legs are one shape, and his arms lie before the trunk. A walk hides little.
    assert (left("dev_03_punch", 1) > 2.0 * left("dev_03_punch", 2)).all()
    assert (left("dev_05_walk", 1) < 1.2 * left("dev_05_walk", 2)).all()


def test_the_best_guess_among_turns():
    places = np.array([[float(x), 0.0, 0.0] for x in (0, 1, 2, 9, 9, 9, 9, 1)])
    content = np.array([True, True, False, True, False, False, False, True])
    every, around = ik_open.scatter(places, content)
    # 0, 1, 9 and 1: from 1 it is 1, 0, 8 and 0. Around the first: 0, 1 and, the circle being closed, the last.
    assert every == pytest.approx(9 / 4) and around == pytest.approx(1 / 3)


@pytest.mark.long
def test_four_real_cameras(voodoo_data):
    trial = ik_pose2sim.four_cameras(data_folder(voodoo_data, "pose2sim", "videos").parent)
    assert trial.agreeing == ("cam_01", "cam_02", "cam_04")
    # The worse a calibration, the less exactly its silhouettes are taken.
    borders = {name: trial.border(name) for name in trial.apart}
    assert all(1.0 < pixels < 6.0 for pixels in borders.values()) and max(borders, key=borders.get) == "cam_03"
    assert trial.best(1) == ("cam_02",) and trial.best(2) == ("cam_01", "cam_04")
    plain, one, two, agreeing, four = (
        means(trial.solve(cameras, trial.steady), trial.steady)
        for cameras in ((), trial.best(1), trial.best(2), trial.agreeing, tuple(trial.views))
    )
    for found in (one, two, agreeing, four):
        assert found[0] < 0.5 * plain[0] and (found < 0.025).all()
    # The mean over all inner joints is halved with two cameras and more; knees by themselves are not, see the record.
    for found in (two, agreeing, four):
        assert found.mean() < 0.5 * plain.mean()
    assert agreeing[1] < 0.6 * plain[1] and one.mean() < 0.6 * plain.mean()
    # No single camera agrees with the truth so well that half of plain could be asked for knees: not even the keypoints the truth
    # was triangulated from are so near.
    for camera in trial.views:
        turned = trial.keypoints.turned((camera,), trial.steady)
        assert ik_tables.mean(turned, trial.steady, "knee") > 0.5e3 * plain[1]
    every = trial.keypoints.turned(tuple(trial.views), trial.steady)
    assert ik_tables.mean(every, trial.steady, "both") < 0.01e3
    # Drawn to the mean of the postures so far, all of them are better, plain inverse kinematics most.
    resting = [
        means(trial.solve(cameras, trial.steady, rest="mean"), trial.steady).mean()
        for cameras in ((), trial.best(1), trial.best(2), trial.agreeing, tuple(trial.views))
    ]
    assert all(
        now < before.mean() + 0.001 for now, before in zip(resting, (plain, one, two, agreeing, four), strict=True)
    )
    assert resting[0] < 0.85 * plain.mean() and max(resting[1:]) < 0.75 * resting[0]
    # Against the triangulation itself no chain of constant limbs between its ends can halve it.
    plain, best = (means(found, trial.truth) for found in (trial.solve((), trial.truth), ik_limbs.nearest(trial.truth)))
    assert best.mean() > 0.5 * plain.mean()
    moved = [np.linalg.norm(trial.steady[name] - places, axis=1).mean() for name, places in trial.truth.items()]
    assert max(moved) < 0.02
    assert not any(view.empty for views, _ in trial.views.values() for view in views)


def test_chains_of_constant_limbs_nearest_to_a_truth():
    rng = np.random.default_rng(4)
    truth = {}
    for joint, (_, first, last) in ik_limbs.LIMBS.items():
        truth[first] = rng.normal(size=(20, 3))
        ways = rng.normal(size=(2, 20, 3))
        ways /= np.linalg.norm(ways, axis=2, keepdims=True)
        truth[joint] = truth[first] + 0.3 * ways[0]
        truth[last] = truth[joint] + 0.25 * ways[1]
    # Exact truth stays.
    for name, places in ik_limbs.steady(truth).items():
        assert np.allclose(places, truth[name], atol=1e-9)
    # So do its inner joints, if only their turn about the line between the known ones can be chosen.
    for joint, places in ik_limbs.nearest(truth).items():
        assert np.allclose(places, truth[joint], atol=1e-9)
    noisy = {name: places + 0.02 * rng.normal(size=places.shape) for name, places in truth.items()}
    found, medians = ik_limbs.steady(noisy), ik_limbs.limb_lengths(noisy)
    for joint, lengths in ik_limbs.limb_lengths(found).items():
        assert np.allclose(lengths, np.median(medians[joint], axis=0), atol=1e-9)
    assert np.mean([np.linalg.norm(found[name] - noisy[name], axis=1) for name in noisy]) < 0.03
    # The best turn: no other one of the same limbs is nearer.
    for joint, (_, first, last) in ik_limbs.LIMBS.items():
        best, (upper, lower) = ik_limbs.nearest(noisy)[joint], np.median(medians[joint], axis=0)
        apart = np.linalg.norm(noisy[last] - noisy[first], axis=1)
        reached = (apart < upper + lower) & (apart > abs(upper - lower))
        assert reached.any()
        assert np.allclose(np.linalg.norm(best - noisy[first], axis=1)[reached], upper)
        assert np.allclose(np.linalg.norm(best - noisy[last], axis=1)[reached], lower)
        way = (noisy[last] - noisy[first]) / apart[:, None]
        for angle in (-0.3, 0.3):
            arm = best - noisy[first]
            turned = (arm * np.cos(angle) + np.cross(way, arm) * np.sin(angle)
                      + way * (way * arm).sum(axis=1, keepdims=True) * (1.0 - np.cos(angle)))  # fmt: skip
            worse = np.linalg.norm(noisy[first] + turned - noisy[joint], axis=1)
            assert (worse >= np.linalg.norm(best - noisy[joint], axis=1) - 1e-12).all()
