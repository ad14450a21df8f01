"""How sure an estimate is: covariances, their calibration, and where results keep them."""

import copy
import csv
import pickle
from dataclasses import replace

import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore
from scipy.stats import norm

import voodoo
from voodoo.evaluation import metrics
from voodoo.evaluation.calibration import Deviations, calibrate, sigma_of
from voodoo.evaluation.evaluate import called_measured, differences
from voodoo.evaluation.report import write_reports
from voodoo.evaluation.score import FrameTable, Score
from voodoo.export.people import PeopleTrack
from voodoo.export.ros2 import write_bag
from voodoo.export.track import Track
from voodoo.pipeline.run import start_tracker, track
from voodoo.recordings import open_recording, sample_path
from voodoo.visualization.body_drawing import draw_body


@pytest.fixture(scope="module")
def estimates():
    recording = open_recording(sample_path(), use=("depth",))
    tracker = start_tracker(recording)
    return [step.estimate for step in track(recording, tracker)], tracker.body


def test_every_joint_and_limb_has_a_symmetric_positive_covariance(estimates):
    for estimate in estimates[0]:
        assert tuple(estimate.covariance) == estimate.joint_names
        assert tuple(estimate.limb_covariance) == estimate.limb_names
        assert set(estimate.angle_covariance) == set(estimate.joint_gaps)
        for matrix in [*estimate.covariance.values(), *estimate.limb_covariance.values()]:
            assert np.array_equal(matrix, matrix.T) or np.allclose(matrix, matrix.T, rtol=1e-12, atol=0.0)
            assert np.linalg.eigvalsh(matrix).min() > 0.0
        # A hinge turns about one axis only.
        ranks = {name: np.linalg.matrix_rank(turn, tol=1e-9) for name, turn in estimate.angle_covariance.items()}
        assert (ranks["l_elbow"], ranks["l_shoulder"]) == (1, 3)
        for index, name in enumerate(estimate.joint_names):
            assert np.array_equal(estimate.joint_covariances[index], estimate.covariance[name])
            assert np.allclose(estimate.joint_sigma[name], np.sqrt(np.diag(estimate.covariance[name])), rtol=1e-12)


def test_a_limb_is_measured_where_it_is_probably_right(estimates):
    for estimate in estimates[0]:
        assert tuple(estimate.limb_probability) == estimate.limb_names
        for limb, probability in estimate.limb_probability.items():
            assert 0.0 <= probability < 1.0, limb
            assert (estimate.limb_status[limb] == "measured") == (probability >= 0.8), limb


def test_nothing_is_known_before_the_first_frame_and_of_nobody():
    tracker = voodoo.Tracker(voodoo.Body.human())
    assert tracker.estimate.limb_probability == {} and tracker.estimate.covariance == {}
    assert tracker.estimate.joint_covariances.shape == (0, 3, 3)
    recording = open_recording(sample_path())
    set_there = tracker.reset(joints=recording.start["joints"])
    assert np.isnan(list(set_there.limb_probability.values())).all()
    assert np.isnan(set_there.joint_covariances).all() and np.isnan(set_there.limb_covariance["pelvis"]).all()
    assert all(np.isnan(sigma) for sigma in set_there.length_sigma.values())


def test_without_measurements_the_body_is_known_less_from_frame_to_frame(estimates):
    recording = open_recording(sample_path(), use=("depth",))
    tracker = start_tracker(recording)
    steps = iter(track(recording, tracker))
    observed = [next(steps).estimate for _ in range(10)][-1]
    dark = [tracker.step(voodoo.Frame(stamp=observed.stamp + (1 + index) / 30.0)) for index in range(5)]
    for joint in ("l_wrist", "r_ankle", "humanoid_root"):
        sizes = [np.trace(estimate.covariance[joint]) for estimate in (observed, *dark)]
        assert sizes == sorted(sizes) and sizes[-1] > 2.0 * sizes[0], joint


def test_sizes_are_known_better_the_more_is_visible(estimates):
    first, last = estimates[0][0], estimates[0][-1]
    for limb in ("l_thigh", "r_upperarm", "thorax"):
        assert 0.0 < last.length_sigma[limb] < first.length_sigma[limb] < 0.05, limb
        assert 0.0 < last.girth_sigma[limb] <= first.girth_sigma[limb] < 0.05, limb
    assert np.isnan(last.length_sigma["head"]), "lengths of ends are not refined"
    recording = open_recording(sample_path(), use=("depth",))
    given = voodoo.Tracker(estimates[1])
    given.reset(joints=recording.start["joints"], fit_sizes=False)
    (step,) = [step.estimate for step, _ in zip(track(recording, given), range(1), strict=False)]
    assert all(np.isnan(sigma) for sigma in (*step.length_sigma.values(), *step.girth_sigma.values()))


def test_an_estimate_keeps_it_in_pickles(estimates):
    estimate = estimates[0][-1]
    for again in (pickle.loads(pickle.dumps(estimate)), copy.deepcopy(estimate)):
        assert np.array_equal(again.joint_covariances, estimate.joint_covariances)
        assert np.array_equal(again.limb_covariance["head"], estimate.limb_covariance["head"])
        assert np.array_equal(again.angle_covariance["l_hip"], estimate.angle_covariance["l_hip"])
        assert again.length_sigma["l_calf"] == estimate.length_sigma["l_calf"]
        assert again.limb_probability == estimate.limb_probability


def test_results_keep_it(tmp_path, estimates):
    found = Track.of(estimates[0], body=estimates[1])
    found.save(tmp_path / "a.npz")
    again = Track.load(tmp_path / "a.npz")
    assert np.array_equal(again.covariance, found.covariance)
    assert np.array_equal(again.root_covariance, found.root_covariance)
    found.save(tmp_path / "a.csv")
    with (tmp_path / "a.csv").open(newline="") as file:
        header, *rows = list(csv.reader(file))
    assert header[-1].endswith("_sigma_m"), "behind what earlier readers know"
    column = header.index("l_wrist_sigma_m")
    wrist = found.covariance[:, found.joint_names.index("l_wrist")]
    sigma = np.sqrt(np.einsum("fii->f", wrist) / 3.0)
    np.testing.assert_allclose([float(row[column]) for row in rows], sigma, atol=1e-6)
    back = Track.load(tmp_path / "a.csv")
    assert back.joint_names == found.joint_names and back.covariance.shape == (len(found), 0, 3, 3)
    assert back.limb_status == found.limb_status
    people = PeopleTrack(found.stamps, {1: found})
    assert np.array_equal(people.unbroken(1).covariance, found.covariance)


def test_a_bag_has_the_body_with_its_covariance_and_ellipsoids(tmp_path, estimates):
    found = Track.of(estimates[0][:3], body=estimates[1])
    write_bag(tmp_path / "bag", found, estimates[1], root_frame="odom")
    with AnyReader([tmp_path / "bag"], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
        messages = {
            topic: [
                reader.deserialize(raw, connection.msgtype)
                for connection, _, raw in reader.messages()
                if connection.topic == f"/humans/bodies/p1/{topic}"
            ]
            for topic in ("pose", "markers")
        }
    assert len(messages["pose"]) == 3
    for index, message in enumerate(messages["pose"]):
        assert message.header.frame_id == "odom"
        covariance = message.pose.covariance.reshape(6, 6)
        np.testing.assert_allclose(covariance, covariance.T, atol=1e-12)
        # Turns are the limb's own; the place is between the hips, whose sites say about how well it is known.
        np.testing.assert_allclose(covariance[3:, 3:], found.root_covariance[index, 3:, 3:])
        hips = [found.covariance[index, found.joint_names.index(f"{side}_hip")] for side in "lr"]
        assert np.trace(covariance[:3, :3]) < np.trace(hips[0] + hips[1])
        spheres = [marker for marker in messages["markers"][index].markers if marker.ns == "uncertainty"]
        assert len(spheres) == len(found.joint_names)
        volume = spheres[0].scale.x * spheres[0].scale.y * spheres[0].scale.z / 8.0
        assert volume == pytest.approx(np.sqrt(np.linalg.det(found.covariance[index, 0])), rel=1e-6)


def test_ellipses_are_drawn_as_large_as_joints_are_uncertain(estimates):
    from voodoo.model.projection import TopView

    estimate, body = estimates[0][-1], estimates[1]
    view = TopView(estimate.joints["humanoid_root"], 0.004, 400, "rep103")

    def drawn(found):
        picture = np.zeros((400, 400, 3), dtype=np.uint8)
        draw_body(picture, body, found, view)
        return picture

    class Uncertain:
        def __getattr__(self, name):
            value = getattr(estimate, name)
            return 16.0 * value if name == "joint_covariances" else value

    sure, uncertain = drawn(estimate), drawn(Uncertain())
    assert (uncertain.any(axis=2).sum()) > 1.02 * sure.any(axis=2).sum()


def test_calibration_of_errors_that_are_as_large_as_reported():
    chance = np.random.default_rng(3)
    frames = 4000
    sigma = np.exp(chance.uniform(np.log(0.005), np.log(0.1), (frames, 12, 3)))
    errors = sigma * chance.standard_normal(sigma.shape)
    errors[::7, 3] = np.nan
    measured = chance.random((frames, 12)) < 0.8
    found = calibrate([Deviations(errors[:1000], sigma[:1000], measured[:1000]),
                       Deviations(errors[1000:], sigma[1000:], measured[1000:])])  # fmt: skip
    assert len(found.coverages) == 4 and len(found.quartiles) == 8
    for fraction in (*found.coverages, *found.quartiles):
        assert fraction.within_one == pytest.approx(norm.cdf(1) - norm.cdf(-1), abs=0.02), fraction.name
        assert fraction.within_two == pytest.approx(norm.cdf(2) - norm.cdf(-2), abs=0.02), fraction.name
        assert fraction.error_m == pytest.approx(fraction.sigma_m, rel=0.1)
    assert found.coverages[0].coordinates == 3 * (12 * frames - len(errors[::7]))
    assert 1.0 < found.ratio < found.mean_m / found.oracle_m
    overconfident = calibrate([Deviations(errors, sigma / 2.0, measured)])
    assert overconfident.coverages[0].within_one == pytest.approx(norm.cdf(0.5) - norm.cdf(-0.5), abs=0.02)
    # Who knows the worst joints drops them.
    oracle = calibrate([Deviations(errors, np.abs(errors), measured)])
    assert oracle.ratio == pytest.approx(1.0)
    assert calibrate([]) is None
    assert calibrate([Deviations(np.full_like(errors, np.nan), sigma, measured)]) is None


def test_the_evaluation_prints_and_draws_it(tmp_path, estimates):
    recording = open_recording(sample_path(), use=("depth",))
    errors = differences(recording, Track.of(estimates[0], body=estimates[1]))
    measured = np.array([called_measured(estimate) for estimate in estimates[0]])
    sigma = np.array([sigma_of(estimate) for estimate in estimates[0]])
    assert errors.shape == sigma.shape == (len(estimates[0]), len(metrics.JOINTS), 3)
    stamps, flat = np.array([estimate.stamp for estimate in estimates[0]]), np.zeros(len(errors))
    sizes = np.linalg.norm(errors, axis=2)
    deviations = Deviations(errors, sigma, measured)
    frames = FrameTable(stamps, ("tracking",) * len(flat), sizes, sizes > 1.0, flat, flat, flat, deviations)
    score = Score(
        "sample", sample_path(), frames=len(flat), exact=True, joint_error_m=dict.fromkeys(metrics.JOINTS, 0.0)
    )
    files = write_reports(tmp_path, [score], [frames])
    assert files[-1] == tmp_path / "calibration.png" and files[-1].stat().st_size > 10_000
    found = calibrate([deviations])
    text = (tmp_path / "summary.md").read_text(encoding="utf-8")
    assert "against exact truth" in text and f"| {100 * found.coverages[2].within_one:.1f} %" in text
    # The sample is walked with exact truth: most errors are as large as said.
    assert 0.5 < found.coverages[0].within_one < 0.95 and found.coverages[0].within_two > 0.8


def test_a_track_without_it_is_as_before(estimates):
    found = Track.of(estimates[0][:2], body=estimates[1])
    without = replace(found, covariance=np.empty((0, 0, 3, 3)), root_covariance=np.empty((0, 6, 6)))
    assert without.covariance.shape == (2, 0, 3, 3) and np.isnan(without.root_covariance).all()
