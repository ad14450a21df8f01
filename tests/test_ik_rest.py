"""The rest posture of inverse kinematics: below targets and images, of one posture, many, and sequences."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import voodoo
from ik_cases import front_camera, shoulder, within
from voodoo import ik


def picture(seed):
    rng = np.random.default_rng(seed)
    camera, pose = front_camera(0.5)
    mask = np.zeros((120, 160), dtype=np.uint8)
    top, left = rng.integers(10, 60), rng.integers(40, 90)
    mask[top : top + 50, left : left + rng.integers(10, 50)] = 1
    return ik.Silhouette(mask, camera=camera, world_from_camera=pose)


def off(posture, rest):
    return sum((posture.angles[posture.angle_names.index(name)] - value) ** 2 for name, value in rest.items())


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_a_rest_posture_leaves_targets_and_images_alone(seed):
    rng = np.random.default_rng(seed)
    chain = ik.Chain(voodoo.Body.human(1.75, model="papers"))
    start = chain.forward(chain.rest())[1]
    targets = [ik.Target.at(site, start[site] + rng.uniform(-0.3, 0.3, 3)) for site in ("l_hand", "r_hand", "l_ankle")]
    targets.append(ik.Target.at("r_knee", start["r_knee"] + rng.uniform(-0.2, 0.2, 3), priority=1))
    names = rng.choice(chain.angle_names, rng.integers(1, len(chain.angle_names)), replace=False)
    rest = {str(name): float(rng.uniform(-0.5, 0.5)) for name in names}
    images = [picture(seed)] * rng.integers(0, 2)
    alone = ik.solve(chain, targets, images=images, steps=40)
    drawn = ik.solve(chain, targets, images=images, steps=40, rest=rest)
    costs = [(sum(r * r for r in some.residuals[:3]), some.residuals[3] ** 2) for some in (alone, drawn)]
    for before, after in zip(*costs, strict=True):
        assert np.sqrt(after) <= np.sqrt(before) + 1e-9
    assert drawn.h <= alone.h + 1e-8 and within(chain, drawn.angles)
    assert off(drawn, rest) <= off(alone, rest) + 1e-12


def test_what_is_left_free_goes_to_rest(arm):
    goal = {"l_hand": shoulder(arm) + np.array([0.25, 0.15, -0.3])}
    plain = ik.solve(arm, goal, start=[0.4, -0.3, 0.9, 0.8], steps=60)
    comfortable = ik.solve(arm, goal, start=plain, rest=arm.rest(), steps=60)
    assert max(plain.residuals + comfortable.residuals) < 1e-6 and comfortable.converged
    assert (comfortable.angles**2).sum() < 0.9 * (plain.angles**2).sum()
    # The elbow's turn about the line between shoulder and hand, all of it: none is nearer to rest.
    center, hand = shoulder(arm), np.array(goal["l_hand"])
    best = min(
        (
            ik.solve(arm, goal, start=[0.4, -0.3, turn, 0.8], rest=arm.rest(), steps=60)
            for turn in np.linspace(-1.5, 1.5, 7)
        ),
        key=lambda found: (found.angles**2).sum(),
    )
    assert (comfortable.angles**2).sum() == pytest.approx((best.angles**2).sum(), abs=1e-6)
    assert np.linalg.norm(hand - center) < 0.5
    # It stays there, and whence does not matter.
    again = ik.solve(arm, goal, start=comfortable, rest=arm.rest(), steps=60)
    assert np.allclose(again.angles, comfortable.angles, atol=1e-6)


def test_without_a_rest_posture_nothing_changes(arm):
    goal = {"l_hand": shoulder(arm) + np.array([0.25, 0.15, -0.3])}
    for images in ((), [picture(3)]):
        plain = ik.solve(arm, goal, images=images)
        assert np.array_equal(ik.solve(arm, goal, images=images, rest=None).angles, plain.angles)
        assert np.array_equal(ik.solve(arm, goal, images=images, rest={}).angles, plain.angles)


def test_rest_by_name_by_angles_and_by_posture(arm):
    free = ik.Chain(arm.body)
    assert ik.solve(arm, {}, start=[0.1, 0.2, 0.3, 0.4], rest={"l_elbow_flexion": 1.0}).angles == pytest.approx(
        [0.1, 0.2, 0.3, 1.0]
    )
    posture = ik.solve(arm, {}, start=[0.1, -0.2, 0.3, 0.4])
    assert ik.solve(arm, {}, rest=posture).angles == pytest.approx(posture.angles)
    # Beyond the limits: as far as they go.
    assert ik.solve(arm, {}, rest=[0.0, 0.0, 0.0, 9.0], steps=60).angles[3] == arm.limits[3, 1]
    # Angles of a free root: where someone stands is no question of comfort, unless it is named.
    start = np.full(len(free.angle_names), 0.1)
    found = ik.solve(free, {}, start=start, rest=np.zeros(len(start))).angles
    assert found[:6] == pytest.approx(start[:6]) and found[6:] == pytest.approx(0.0)
    found = ik.solve(free, {}, start=start, rest={"root_x": 0.3}).angles
    assert found == pytest.approx([0.3, *start[1:]])


def test_many_postures_go_to_the_same_rest(arm):
    goals = shoulder(arm) + np.random.default_rng(3).uniform(-0.4, 0.4, (20, 1, 3))
    many = ik.solve_many(arm, ["l_hand"], goals, rest=arm.rest())
    for index, goal in enumerate(goals):
        assert np.array_equal(ik.solve(arm, {"l_hand": goal[0]}, rest=arm.rest()).angles, many.angles[index])


def test_a_follower_goes_back_to_where_it_usually_is(arm):
    start = np.array([0.3, -0.5, 0.1, 1.0])
    hand = arm.forward(start)[1]["l_hand"]
    follower = ik.Follower(arm, start=start, rest="mean", steps=60)
    assert follower.rest == pytest.approx(dict(zip(arm.angle_names, start, strict=True)))
    postures = [start]
    for step in range(10):
        found = follower.step({"l_hand": hand + 0.01 * step})
        postures.append(found.angles)
        assert list(follower.rest.values()) == pytest.approx(np.mean(postures, axis=0))
    # Turned away by hand, it comes back, which it does not without.
    turned = ik.solve(arm, {"l_hand": hand}, start=start + [0.0, 0.0, 0.6, 0.0], steps=60).angles
    kept, drawn = (
        ik.solve(arm, {"l_hand": hand}, start=turned, rest=rest, steps=60).angles for rest in (None, follower.rest)
    )
    assert np.linalg.norm(drawn - start) < 0.3 * np.linalg.norm(kept - start)
    before = follower.rest
    with pytest.raises(voodoo.MeasurementError):
        follower.step({"l_hand": (np.nan, 0.0, 0.0)})
    assert follower.rest is before
    # Any other posture stays where it is, none is none.
    other = ik.Follower(arm, rest={"l_shoulder_rz": 0.2})
    other.step({"l_hand": hand})
    assert other.rest == {"l_shoulder_rz": 0.2} and ik.Follower(arm).rest == {}


@pytest.mark.parametrize(
    ("rest", "error", "words"),
    [
        ({"r_knee_flexion": 0.0}, voodoo.BodyError, "rest: expected some of l_shoulder_rx, .* found 'r_knee_flexion'"),
        ({3: 0.0}, voodoo.BodyError, "found 3"),
        ({"l_elbow_flexion": np.nan}, voodoo.MeasurementError, "rest: expected 1 finite numbers"),
        ({"l_elbow_flexion": "bent"}, voodoo.MeasurementError, "rest: expected numbers"),
        ({"l_elbow_flexion": (0.0, 1.0)}, voodoo.MeasurementError, "rest: expected 1 finite numbers"),
        ([0.0, 0.0, 0.0], voodoo.MeasurementError, "rest: expected 4 finite numbers"),
        (np.zeros((2, 2)), voodoo.MeasurementError, "rest: expected 4 finite numbers"),
        ([0.0, 0.0, np.inf, 0.0], voodoo.MeasurementError, "rest: expected 4 finite numbers"),
        ("standing", voodoo.MeasurementError, "rest: expected numbers, found 'standing'"),
    ],
)
def test_a_rest_that_cannot_be_used_is_named(arm, rest, error, words):
    for call in (
        lambda: ik.solve(arm, {}, rest=rest),
        lambda: ik.solve_many(arm, ["l_hand"], np.zeros((2, 1, 3)), rest=rest),
        lambda: ik.Follower(arm, rest=rest),
    ):
        with pytest.raises(error, match=words):
            call()


def test_a_rest_of_another_chain_is_refused(arm):
    other = ik.solve(ik.Chain(arm.body, limbs=("r_upperarm", "r_forearm")), {})
    with pytest.raises(voodoo.MeasurementError, match="rest: expected a posture of Chain"):
        ik.solve(arm, {}, rest=other)
    with pytest.raises(voodoo.MeasurementError, match="rest: expected numbers, found 'mean'"):
        ik.solve(arm, {}, rest="mean")
