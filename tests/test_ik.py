"""Inverse kinematics from Python: targets, priorities, limits, and answers to what cannot be solved."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import voodoo
from ik_cases import front_camera, shoulder, within
from voodoo import ik


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_reachable_targets_near_the_start_are_reached(arm, seed):
    rng = np.random.default_rng(seed)
    middle, half = arm.limits.mean(axis=1), 0.3 * np.ptp(arm.limits, axis=1)
    angles = middle + rng.uniform(-half, half)
    goal = arm.forward(angles)[1]["l_hand"]
    found = ik.solve(arm, {"l_hand": goal}, start=angles + rng.uniform(-0.05, 0.05, len(angles)), steps=60)
    assert found.residuals[0] < 1e-6 and found.converged
    assert within(arm, found.angles)


def test_unreachable_target_gives_the_nearest_posture(arm):
    center = shoulder(arm)
    straight = np.linalg.norm(arm.forward([0, 0, 0, 0])[1]["l_hand"] - center)
    found = ik.solve(arm, {"l_hand": center + np.array([2.0, 0.3, -0.2])}, steps=300)
    assert found.residuals[0] == pytest.approx(np.linalg.norm([2.0, 0.3, -0.2]) - straight, abs=1e-4)
    assert found.converged and within(arm, found.angles)


def test_stretched_arm_leaves_the_singular_pose(arm):
    center = shoulder(arm)
    found = ik.solve(arm, {"l_hand": center - np.array([0.0, 0.0, 0.35])}, start=np.zeros(4), steps=60)
    assert found.residuals[0] < 1e-6


@pytest.mark.parametrize("bend", [0.6, 1.0, 1.5])
def test_an_elbow_bent_backwards_comes_back_for_a_nearer_target(arm, bend):
    # At its limit the elbow has the stretched arm, which is farther from the target, between itself and the answer.
    start = np.array([0.7, -1.0, -0.6, arm.limits[3, 0]])
    goal = arm.forward([*start[:3], bend])[1]["l_hand"]
    assert start[3] < -0.05
    found = ik.Follower(arm, start=start, steps=30).step({"l_hand": goal})
    assert found.residuals[0] < 1e-6 and found.angles[3] == pytest.approx(bend, abs=0.05)


def test_contradictory_targets_meet_in_the_weighted_middle():
    body = voodoo.Body.human(1.75, model="papers")
    chain = ik.Chain(body, limbs=("torso",), root="free")
    a, b = np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.4, 1.0])
    targets = [ik.Target.at("humanoid_root", a, weight=3.0), ik.Target.at("humanoid_root", b, weight=1.0)]
    found = ik.solve(chain, targets, steps=100)
    assert found.joints["humanoid_root"] == pytest.approx(0.75 * a + 0.25 * b, abs=1e-5)
    assert found.residuals == pytest.approx((0.1, 0.3), abs=1e-5)


def test_limits_hold_and_the_residual_is_reported(arm):
    # Behind the back, through the body: no shoulder gets there.
    found = ik.solve(arm, {"l_hand": shoulder(arm) + np.array([-0.4, -0.3, 0.3])}, steps=100)
    assert within(arm, found.angles) and found.residuals[0] > 0.01
    assert ((found.angles == arm.limits[:, 0]) | (found.angles == arm.limits[:, 1])).any()


def test_a_start_outside_the_limits_is_moved_onto_them(arm):
    found = ik.solve(arm, {}, start=[9.0, -9.0, 9.0, -9.0])
    assert np.array_equal(found.angles, [arm.limits[0, 1], arm.limits[1, 0], arm.limits[2, 1], arm.limits[3, 0]])


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_lower_levels_and_images_leave_the_top_level_alone(seed):
    rng = np.random.default_rng(seed)
    chain = ik.Chain(voodoo.Body.human(1.75, model="papers"))
    rest = chain.forward(chain.rest())[1]
    camera, pose = front_camera(0.5)
    mask = np.zeros((120, 160), dtype=np.uint8)
    mask[20:100, 60:100] = 1
    image = ik.Silhouette(mask, camera=camera, world_from_camera=pose)
    top = [ik.Target.at(site, rest[site] + rng.uniform(-0.3, 0.3, 3)) for site in ("l_hand", "r_hand", "l_ankle")]
    lower = [
        ik.Target.at("head_center", rest["head_center"] + rng.uniform(-0.5, 0.5, 3), priority=1),
        ik.Target.at("l_elbow", rng.uniform(-1, 1, 3), priority=1, weight=4.0),
        ik.Target.at("r_knee", rng.uniform(-1, 1, 3), priority=2),
    ]
    alone = ik.solve(chain, top, steps=60)
    both = ik.solve(chain, top + lower, images=[image], steps=60)
    for before, after in zip(alone.residuals, both.residuals, strict=False):
        assert after <= max(before, 1e-6) + 1e-9
    cost = [sum(r * r for r in posture.residuals[:3]) for posture in (alone, both)]
    assert np.sqrt(cost[1]) <= np.sqrt(cost[0]) + 1e-9


def test_rays_and_positions(arm):
    goal = arm.forward([0.5, -0.3, 0.1, 1.0])[1]["l_hand"]
    rays = [
        ik.Target.on_ray("l_hand", origin=origin, direction=goal - origin)
        for origin in (np.array([3.0, 0.0, 0.0]), np.array([0.0, 3.0, 1.0]))
    ]
    found = ik.solve(arm, rays, steps=60)
    assert max(found.residuals) < 1e-6
    assert np.linalg.norm(found.joints["l_hand"] - goal) < 1e-5


def test_batch_equals_single(arm):
    rng = np.random.default_rng(3)
    goals = shoulder(arm) + rng.uniform(-0.4, 0.4, (20, 1, 3))
    many = ik.solve_many(arm, ["l_hand"], goals)
    for index in range(20):
        one = ik.solve(arm, {"l_hand": goals[index, 0]})
        assert np.array_equal(one.angles, many.angles[index])


def test_follower_starts_from_the_last_posture(arm):
    follower = ik.Follower(arm, steps=30)
    goal = shoulder(arm) + np.array([0.3, 0.1, -0.2])
    first = follower.step({"l_hand": goal})
    second = follower.step({"l_hand": goal})
    assert np.array_equal(first.angles, second.angles) and second.steps == 0
    before = follower.angles
    with pytest.raises(voodoo.MeasurementError):
        follower.step({"l_hand": (np.nan, 0.0, 0.0)})
    assert follower.angles is before


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda arm: ik.solve(arm, {"r_hand": (0, 0, 0)}), "expected one on the chain"),
        (lambda arm: ik.solve(arm, {"nose": (0, 0, 0)}), "unknown site"),
        (lambda arm: ik.solve(arm, {"l_hand": (0, 0)}), "three finite numbers"),
        (lambda arm: ik.solve(arm, {"l_hand": (0, 0, np.inf)}), "finite"),
        (lambda arm: ik.solve(arm, {}, start=[0.0]), "expected 4 finite numbers"),
        (lambda arm: ik.solve(arm, {}, steps=-1), "steps"),
        (lambda arm: ik.solve(arm, {}, stpes=3), "stpes"),
        (lambda arm: ik.solve(arm, {}, world_from_base=np.ones((4, 4))), "rigid"),
        (lambda arm: ik.Target.at("l_hand", (0, 0, 0), weight=0.0), "weight"),
        (lambda arm: ik.Target.at("l_hand", (0, 0, 0), priority=-1), "priority"),
        (lambda arm: ik.Target.on_ray("l_hand", origin=(0, 0, 0), direction=(0, 0, 0)), "direction"),
        (lambda arm: ik.Chain(arm.body, limbs=("l_forearm", "r_forearm")), "hang together"),
        (lambda arm: ik.Chain(arm.body, root="loose"), "root"),
        (lambda arm: ik.Chain(arm.body, limbs="l_forearm"), "list of names"),
        (lambda arm: ik.solve("arm", {}), "chain: expected"),
        (lambda arm: ik.solve(arm, "l_hand"), "targets: expected"),
        (lambda arm: ik.solve(arm, ik.Target.at("l_hand", (0, 0, 0))), "targets: expected"),
        (lambda arm: ik.solve(arm, [("l_hand", (0, 0, 0))]), "list of Target"),
        (lambda arm: ik.solve(arm, {3: (0, 0, 0)}), "names of sites"),
        (lambda arm: ik.solve(arm, {}, start="rest"), "angles: expected numbers"),
        (lambda arm: ik.solve(arm, {}, world_from_base="here"), "world_from_base: expected numbers"),
        (lambda arm: ik.solve(arm, {}, images=np.ones((120, 160))), "list of ik.Silhouette"),
        (lambda arm: ik.solve_many(arm, ["l_hand"], np.zeros((2, 1, 3)), images=[None]), "list of ik.Silhouette"),
        (lambda arm: arm.criterion(arm.rest(), [3]), "list of ik.Silhouette"),
        (lambda arm: ik.solve(arm, {}, options={"steps": 3}), "ik.Options"),
        (lambda arm: ik.solve(arm, {}, others=["l_calf"]), "others: expected"),
        (lambda arm: ik.Options(bones=(("l_elbow", "l_hand"),)), "site, site, radius"),
        (lambda arm: ik.Options(bones=(("l_elbow", "l_hand", float("nan")),)), "radius of at least 0"),
        (lambda arm: ik.Target.at("l_hand", (0, 0, 0), weight="heavy"), "weight"),
        (lambda arm: ik.Silhouette(np.ones((120, 160)), camera=None, world_from_camera=np.eye(4)), "camera"),
        (
            lambda arm: ik.Silhouette(
                np.full((120, 160), np.nan), camera=front_camera()[0], world_from_camera=np.eye(4)
            ),
            "finite",
        ),
        (
            lambda arm: ik.Silhouette(
                np.ones((120, 160)), camera=front_camera()[0], world_from_camera=np.eye(4), border=-1.0
            ),
            "border: expected 0 to 1000 pixels, found -1.0",
        ),
        (lambda arm: ik.Silhouette(np.zeros((3, 3)), camera=front_camera()[0], world_from_camera=np.eye(4)), "mask"),
    ],
)
def test_bad_input_is_named(arm, call, words):
    with pytest.raises(voodoo.VoodooError, match=words):
        call(arm)


@settings(max_examples=25, deadline=None)
@given(
    far=st.sampled_from([0.0, 1e-9, 0.3, 5.0, 1e6]),
    weight=st.sampled_from([1e-9, 1.0, 1e9]),
    seed=st.integers(0, 1_000),
)
def test_whatever_is_asked_the_answer_is_finite_and_within_the_limits(arm, far, weight, seed):
    rng = np.random.default_rng(seed)
    camera, pose = front_camera()
    # From in front of the arm, from within it, and from behind.
    pose[:3, 3] = shoulder(arm) + rng.uniform(-0.5, 0.5, 3)
    mask = np.zeros((120, 160))
    mask[rng.integers(0, 120), rng.integers(0, 160)] = 1
    images = [ik.Silhouette(mask, camera=camera, world_from_camera=pose)]
    targets = [
        ik.Target.at("l_hand", shoulder(arm) + far * rng.normal(size=3), weight=weight),
        ik.Target.at("l_hand", shoulder(arm) - far * rng.normal(size=3)),
        ik.Target.on_ray("l_elbow", origin=far * rng.normal(size=3), direction=rng.normal(size=3), priority=1),
    ]
    found = ik.solve(arm, targets, images=images, start=rng.uniform(-4, 4, 4), steps=30)
    assert within(arm, found.angles)
    assert np.isfinite([*found.angles, *found.residuals, found.h]).all()
    reached = found.joints["l_hand"]
    expected = [np.linalg.norm(reached - np.array(target.values[:3])) for target in targets[:2]]
    assert found.residuals[:2] == pytest.approx(expected, rel=1e-9, abs=1e-12)


def test_a_transform_in_any_order_of_memory_is_the_same(arm):
    turn = np.array([[0.0, -1.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
    for shift in (0.0, 0.3):
        turn[0, 3] = shift
        as_it_is, other = (
            arm.forward(np.zeros(4), world_from_base=pose)[1] for pose in (turn, np.asfortranarray(turn))
        )
        assert all((place == other[name]).all() for name, place in as_it_is.items())


def test_a_chain_without_angles_has_residuals():
    chain = ik.Chain(voodoo.Body.human(1.75), limbs=("pelvis",))
    found = ik.solve(chain, {"humanoid_root": (1.0, 0.0, 0.0)})
    assert found.residuals[0] > 0.9 and len(found.angles) == 0


def test_a_root_that_turns_past_half_a_turn_takes_no_more_steps_than_any():
    chain = ik.Chain(voodoo.Body.human(1.75, model="full"), root="free")
    rng, steps = np.random.default_rng(1), []
    goal = np.clip(chain.rest() + rng.normal(0.0, 0.2, len(chain.rest())), *chain.limits.T)
    for before, after in (((0.1, 0.0, 3.1), (0.1, 0.8, 3.2)), ((0.1, 0.0, 2.1), (0.1, 0.8, 2.2))):
        start = chain.rest()
        start[3:6], goal[3:6] = before, after
        places = chain.forward(goal)[1]
        found = ik.solve(
            chain,
            {name: places[name] for name in ("l_wrist", "r_wrist", "l_ankle", "r_ankle", "skullbase")},
            start=start,
            steps=60,
        )
        assert found.converged and max(found.residuals) < 1e-6
        steps.append(found.steps)
    assert steps[0] <= steps[1] + 3, steps
