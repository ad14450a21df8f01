import numpy as np
import pytest

from scene import turn
from voodoo.evaluation import metrics
from voodoo.measurements import nearest_stamps

STAMPS = np.arange(60) / 30.0


def errors_with(joint, start, count, error=0.2, frames=60):
    errors = np.full((frames, 12), 0.01)
    errors[start : start + count, joint] = error
    return errors


@pytest.mark.parametrize(
    ("start", "count", "expected"),
    [
        (10, 9, 2),  # nine frames last exactly 0.3 s: not longer
        (10, 10, 1),
        (51, 9, 2),  # too far at the end, but not for longer than 0.3 s
        (50, 10, 0),
        (49, 10, 1),  # back in the last frame
        (0, 60, 0),
    ],
)
def test_class_borders(start, count, expected):
    assert metrics.tracking_class(errors_with(3, start, count), STAMPS, limit=0.1)[0] == expected


def test_class_limit_is_exclusive():
    assert metrics.tracking_class(errors_with(0, 0, 60, error=0.1), STAMPS, limit=0.1)[0] == 2
    assert metrics.tracking_class(errors_with(0, 0, 60, error=0.1001), STAMPS, limit=0.1)[0] == 0


def test_two_short_runs_are_not_one_long_one():
    errors = errors_with(2, 10, 9)
    errors[20:29, 2] = 0.2
    assert metrics.tracking_class(errors, STAMPS, limit=0.1)[0] == 2


def test_different_joints_do_not_make_one_run():
    errors = errors_with(2, 10, 9)
    errors[19:28, 4] = 0.2
    assert metrics.tracking_class(errors, STAMPS, limit=0.1)[0] == 2


def test_class_reports_which_joint_was_lost_when():
    _, lost = metrics.tracking_class(errors_with(3, 10, 12), STAMPS, limit=0.1)
    assert lost[10:22, 3].all()
    assert lost.sum() == 12


def test_missing_reference_neither_ends_nor_lengthens_a_run():
    errors = errors_with(5, 10, 10)
    errors[14:17, 5] = np.nan
    assert metrics.tracking_class(errors, STAMPS, limit=0.1)[0] == 1
    errors[17:20, 5] = 0.01  # what remains lasts from frame 10 to 13
    assert metrics.tracking_class(errors, STAMPS, limit=0.1)[0] == 2


def test_still_lost_in_the_last_known_frame():
    errors = errors_with(5, 30, 20)
    errors[50:, 5] = np.nan
    assert metrics.tracking_class(errors, STAMPS, limit=0.1)[0] == 0


def test_class_counts_seconds_not_frames():
    assert metrics.tracking_class(errors_with(1, 10, 4), STAMPS * 3.0, limit=0.1)[0] == 1
    assert metrics.tracking_class(errors_with(1, 10, 3), STAMPS * 3.0, limit=0.1)[0] == 2


def test_class_of_nothing_known_is_none():
    assert metrics.tracking_class(np.full((60, 12), np.nan), STAMPS, limit=0.1)[0] is None


def walk(frames, shift=0, seed=0):
    """Twelve joints on smooth paths, delayed by `shift` frames."""
    phase = np.random.default_rng(seed).uniform(0.0, 6.0, (12, 3))
    return 0.3 * np.sin(0.2 * (np.arange(frames) - shift)[:, None, None] + phase)


@pytest.mark.parametrize("late", [-5, -2, 0, 1, 5])
def test_best_lag_is_recovered(late):
    reference = walk(60)
    estimate = walk(60, late) + np.random.default_rng(1).normal(0.0, 0.005, (60, 12, 3))
    assert metrics.best_lag(estimate, reference) == late
    errors = metrics.joint_errors(estimate, reference, lag=late)
    assert metrics.mean_or_nan(errors) < 0.01
    assert np.isnan(errors).all(axis=1).sum() == abs(late)


def test_lag_of_a_body_at_rest_is_zero():
    still = np.zeros((30, 12, 3))
    assert metrics.best_lag(still, still) == 0


def test_lag_without_reference_is_zero():
    assert metrics.best_lag(walk(30), np.full((30, 12, 3), np.nan)) == 0


@pytest.mark.parametrize("frames", [1, 2, 3, 9])
def test_lag_of_short_recordings_stays_inside(frames):
    assert abs(metrics.best_lag(walk(frames, 1), walk(frames))) <= frames // 4


def test_joint_errors_are_distances():
    estimate = np.zeros((2, 12, 3))
    estimate[1, 4] = (0.03, 0.04, 0.12)
    errors = metrics.joint_errors(estimate, np.zeros((2, 12, 3)))
    assert errors[1, 4] == pytest.approx(0.13)
    assert errors.sum() == pytest.approx(0.13)


def test_jitter_of_uniform_motion_is_zero_and_of_a_known_zigzag_is_known():
    line = np.arange(20)[:, None, None] * np.ones((1, 12, 3)) * 0.01
    assert metrics.jitter(line) == pytest.approx(0.0, abs=1e-12)
    zigzag = np.zeros((20, 12, 3))
    zigzag[::2, :, 0] = 0.001
    assert metrics.jitter(zigzag) == pytest.approx(0.002)
    assert np.isnan(metrics.jitter(line[:2]))


def test_standing_jitter_counts_only_what_stands_still():
    stamps = np.arange(90) / 30.0
    reference = np.zeros((90, 2, 3))
    # The first joint stands, then walks at 0.6 m/s; the second stands, but is not known for a while.
    reference[45:, 0, 0] = 0.02 * np.arange(45)
    reference[30:33, 1] = np.nan
    still = metrics.standing_still(reference, stamps)
    assert not still[:6].any()
    assert not still[-6:].any()
    assert still[6:40, 0].all()
    assert not still[42:, 0].any()
    assert still[[20, 60], 1].all()
    assert not still[24:39, 1].any()
    zigzag = np.zeros((90, 2, 3))
    zigzag[:, 0, 1] = 0.001 * (-1.0) ** np.arange(90)
    zigzag[45:, 0, 1] *= 10.0
    zigzag[:, 1, 1] = 0.003 * (-1.0) ** np.arange(90)
    assert metrics.jitter(zigzag[:, :1], still[:, :1]) == pytest.approx(0.004)
    assert metrics.jitter(zigzag[:, 1:], still[:, 1:]) == pytest.approx(0.012)
    # A late estimate stands still later.
    assert metrics.jitter(zigzag[:, :1], still[:, :1], lag=5) > 0.004
    assert np.isnan(metrics.jitter(zigzag, np.zeros_like(still)))
    assert not metrics.standing_still(reference[:5], stamps[:5]).any()


def test_fraction_within_includes_the_limit_and_skips_the_unknown():
    assert metrics.fraction_within(np.array([0.05, 0.051, np.nan, 0.01, 0.2]), 0.05) == 0.5
    assert np.isnan(metrics.fraction_within(np.array([np.nan]), 0.05))


def test_match_takes_the_nearest_stamp_within_tolerance():
    positions = np.arange(3.0)[:, None, None] * np.ones((1, 1, 3))
    matched = metrics.match_reference(
        np.array([-0.3, 0.04, 0.06, 0.19, 0.4]), np.array([0.0, 0.1, 0.2]), positions, tolerance=0.05
    )
    assert matched[:, 0, 0].tolist()[1:4] == [0.0, 1.0, 2.0]
    assert np.isnan(matched[[0, 4]]).all()


def test_the_nearest_of_stamps_in_any_order_is_the_first_of_equal_ones():
    rng = np.random.default_rng(5)
    for count in (1, 2, 7, 60):
        stamps, times = rng.integers(0, 40, count) / 8.0, rng.integers(-40, 360, 200) / 64.0
        away = np.abs(stamps - times[:, None])
        expected = np.where(away.min(axis=1) <= 0.25, away.argmin(axis=1), -1)
        ties = (away == away.min(axis=1)[:, None]).sum(axis=1) > 1
        found = nearest_stamps(stamps, times, within=0.25)
        assert (found == expected)[~ties].all()
        assert (stamps[found[ties]] <= stamps[expected[ties]]).all() and (found >= 0).tolist() == (
            expected >= 0
        ).tolist()
    assert nearest_stamps(np.array([]), [1.0], within=9.0).tolist() == [-1]


def test_twelve_joints():
    assert len(set(metrics.JOINTS)) == 12
    assert {"l_shoulder", "r_ankle"} <= set(metrics.JOINTS)


def test_a_constant_offset_of_a_joint_is_no_error():
    """In the trunk's axes: the person turns, and the offset turns with them."""
    rng = np.random.default_rng(0)
    rest = rng.normal(0.0, 0.05, (len(metrics.JOINTS), 3))
    rest[:4, 2] += 0.5
    rest[[0, 6], 1] += 0.2
    rest[[1, 7], 1] -= 0.2
    offsets = rng.normal(0.0, 0.04, rest.shape)
    turns = [turn((0.0, 0.0, 1.0), angle) for angle in np.linspace(0.0, 3.0, 20)]
    reference = np.array([way @ rest.T for way in turns]).transpose(0, 2, 1)
    estimate = np.array([way @ (rest + offsets).T for way in turns]).transpose(0, 2, 1)
    estimate[5, 3] += (0.0, 0.0, 0.1)
    estimate[7] = np.nan
    errors = metrics.without_offsets(estimate, reference)
    assert errors[5, 3] == pytest.approx(0.1) and np.isnan(errors[7]).all()
    errors[5, 3] = 0.0
    assert np.nanmax(errors) < 1e-9 < np.nanmin(metrics.joint_errors(estimate, reference))


def test_joint_angles_are_those_of_a_skeleton_that_is_bent_by_them():
    joints = {"shoulder": (0.2, 0.0, 1.4), "elbow": (0.2, 0.0, 1.1), "hip": (0.1, 0.0, 0.9), "knee": (0.1, 0.0, 0.5)}
    rest = {**joints, "wrist": (0.2, 0.0, 0.8), "ankle": (0.1, 0.0, 0.1)}
    standing = np.array([(sign * x, y, z) for joint in rest_order() for sign in (1, -1) for x, y, z in [rest[joint]]])
    assert metrics.joint_angles(standing[None]) == pytest.approx(np.zeros((1, 8)), abs=1e-9)
    bent = standing.copy()
    elbow, wrist = metrics.JOINTS.index("l_elbow"), metrics.JOINTS.index("l_wrist")
    turn = np.radians(70.0)
    bent[wrist] = bent[elbow] + 0.3 * np.array([0.0, np.sin(turn), -np.cos(turn)])
    found = np.degrees(metrics.joint_angles(bent[None])[0])
    assert found == pytest.approx([70.0, 0, 0, 0, 0, 0, 0, 0], abs=1e-6)
    # A turn of the whole body changes none of them; half the frames 70 degrees off is 35 in the mean of one angle of eight.
    c, s = np.cos(0.7), np.sin(0.7)
    turned = bent @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    assert metrics.joint_angles(turned[None])[0] == pytest.approx(np.radians(found), abs=1e-9)
    mean, spread = metrics.angle_error(np.array([standing, bent]), np.array([standing, standing]))
    assert (mean, spread) == pytest.approx((35.0 / 8.0, 35.0 / 8.0))
    assert all(np.isnan(metrics.angle_error(np.full((2, 12, 3), np.nan), np.full((2, 12, 3), np.nan))))


def rest_order():
    return ("shoulder", "elbow", "wrist", "hip", "knee", "ankle")


def test_a_reference_whose_bone_shrinks_by_a_quarter_reports_nothing_of_its_end():
    rng = np.random.default_rng(1)
    reference = np.repeat(rng.normal(0.0, 0.3, (1, len(metrics.JOINTS), 3)), 20, axis=0)
    knee, ankle = metrics.JOINTS.index("l_knee"), metrics.JOINTS.index("l_ankle")
    shank = reference[0, ankle] - reference[0, knee]
    for frame, factor in ((3, 0.8), (4, 0.7), (5, 1.3), (6, 0.1)):
        reference[frame, ankle] = reference[frame, knee] + factor * shank
    reference[9, knee] = np.nan
    judged = metrics.without_contradictions(reference)
    left_out = np.isnan(judged).any(axis=2) & ~np.isnan(reference).any(axis=2)
    assert np.argwhere(left_out).tolist() == [[4, ankle], [5, ankle], [6, ankle]]
    assert np.array_equal(judged[~left_out], reference[~left_out], equal_nan=True)
    assert np.isnan(metrics.without_contradictions(np.full_like(reference, np.nan))).all()
