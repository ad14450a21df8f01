"""Inverse kinematics from Python: J10's claims, priorities, limits, and answers to what cannot be solved."""

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import voodoo
from voodoo import ik
from voodoo.angles import angle_names, joint_angles
from voodoo.results import Track

EXAMPLES = Path(__file__).resolve().parent.parent / "examples"
ARM = ("l_upperarm", "l_forearm")


def load_example(name):
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def virtual():
    return load_example("ik_virtual")


@pytest.fixture(scope="module")
def arm():
    return ik.Chain(voodoo.Body.human(1.75, model="papers"), limbs=ARM)


def shoulder(arm):
    return arm.forward(arm.rest())[1]["l_shoulder"]


def within(chain, angles):
    return bool((angles >= chain.limits[:, 0]).all() and (angles <= chain.limits[:, 1]).all())


def front_camera(height=1.0):
    """Looks along +x of the world from 3 m behind its origin: person in front of base_link."""
    camera = voodoo.Camera(160, 120, 150.0, 150.0, 79.5, 59.5)
    pose = np.eye(4)
    pose[:3, :3] = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
    pose[:3, 3] = (-3.0, 0.0, height)
    return camera, pose


def test_experiment_1_image_pulls_the_chain_into_the_projection(virtual):
    chain = virtual.planar_chain()
    experiment = virtual.experiments(chain)[0]
    plain = virtual.run(chain, experiment, with_image=False, steps=15)
    image = virtual.run(chain, experiment, with_image=True, steps=15)
    assert plain.residuals[0] < 1e-6 and image.residuals[0] < 1e-6
    assert chain.criterion(plain.angles, [experiment.image])[0] > 5.0
    assert image.h < 0.05
    # Plain IK stops as soon as the end point is reached: more steps change nothing.
    more = virtual.run(chain, experiment, with_image=False, steps=60)
    assert np.array_equal(plain.angles, more.angles)


def test_experiment_2_same_end_point_other_configuration(virtual):
    chain = virtual.planar_chain()
    experiment = virtual.experiments(chain)[1]
    plain = virtual.run(chain, experiment, with_image=False, steps=40)
    image = virtual.run(chain, experiment, with_image=True, steps=40)
    assert np.allclose(plain.angles, experiment.start, atol=1e-6)
    assert image.residuals[0] < 1e-6 and image.h < 0.05
    middle = [chain.forward(angles)[1]["joint_2"] for angles in (experiment.objective, experiment.start, image.angles)]
    assert np.linalg.norm(middle[2] - middle[0]) < 0.06 < 0.3 < np.linalg.norm(middle[1] - middle[0])


def test_experiment_3_object_is_avoided(virtual):
    chain = virtual.planar_chain()
    experiment = virtual.experiments(chain)[2]
    plain = virtual.run(chain, experiment, with_image=False, steps=40)
    image = virtual.run(chain, experiment, with_image=True, steps=40)
    assert chain.criterion(plain.angles, [experiment.image])[0] > 1.0
    assert image.h < 0.05 and image.residuals[0] < 1e-6


def test_experiments_write_their_pictures(virtual, tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "argv", ["ik_virtual.py", "--out", str(tmp_path)])
    virtual.main()
    assert {file.name for file in tmp_path.iterdir()} == {f"experiment_{index}.png" for index in (1, 2, 3)}


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


def test_jacobian_of_a_site(arm):
    angles = np.array([0.3, -0.4, 0.2, 0.9])
    analytic = arm.jacobian("l_hand", angles)
    for index, row in enumerate(np.eye(4) * 1e-6):
        difference = arm.forward(angles + row)[1]["l_hand"] - arm.forward(angles - row)[1]["l_hand"]
        assert np.allclose(analytic[:, index], difference / 2e-6, atol=1e-8)


def test_unreachable_target_gives_the_nearest_posture(arm):
    centre = shoulder(arm)
    straight = np.linalg.norm(arm.forward([0, 0, 0, 0])[1]["l_hand"] - centre)
    found = ik.solve(arm, {"l_hand": centre + np.array([2.0, 0.3, -0.2])}, steps=300)
    assert found.residuals[0] == pytest.approx(np.linalg.norm([2.0, 0.3, -0.2]) - straight, abs=1e-4)
    assert found.converged and within(arm, found.angles)


def test_stretched_arm_leaves_the_singular_pose(arm):
    centre = shoulder(arm)
    found = ik.solve(arm, {"l_hand": centre - np.array([0.0, 0.0, 0.35])}, start=np.zeros(4), steps=60)
    assert found.residuals[0] < 1e-6


def test_contradictory_targets_meet_in_the_weighted_middle():
    body = voodoo.Body.human(1.75, model="papers")
    chain = ik.Chain(body, limbs=("torso",), root="free")
    a, b = np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.4, 1.0])
    targets = [ik.Target.at("humanoid_root", a, weight=3.0), ik.Target.at("humanoid_root", b, weight=1.0)]
    found = ik.solve(chain, targets, steps=100)
    assert found.joints["humanoid_root"] == pytest.approx(0.75 * a + 0.25 * b, abs=1e-5)
    assert found.residuals == pytest.approx((0.1, 0.3), abs=1e-5)


def test_limits_hold_and_the_residual_is_told(arm):
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


@pytest.mark.parametrize("pixels", [np.zeros((120, 160)), np.ones((120, 160))])
def test_silhouettes_that_say_nothing_change_nothing(arm, pixels):
    camera, pose = front_camera()
    image = ik.Silhouette(pixels, camera=camera, world_from_camera=pose)
    goal = {"l_hand": shoulder(arm) + np.array([0.3, 0.1, -0.2])}
    plain, found = ik.solve(arm, goal), ik.solve(arm, goal, images=[image])
    assert np.allclose(plain.angles, found.angles, atol=1e-5) and found.h == 0.0
    assert found.images == (1 if pixels.any() else 0)


def test_bones_behind_the_camera_count_nothing(arm):
    camera, pose = front_camera()
    pose[:3, 3] = (3.0, 0.0, 0.5)
    mask = np.zeros((120, 160))
    mask[:5, :5] = 1
    image = ik.Silhouette(mask, camera=camera, world_from_camera=pose)
    found = ik.solve(arm, {"l_hand": shoulder(arm) + np.array([0.3, 0.1, -0.2])}, images=[image])
    assert found.h == 0.0 and found.residuals[0] < 1e-6 and np.isfinite(found.angles).all()


def test_criterion_gradient(arm):
    camera, pose = front_camera(0.4)
    v, u = np.mgrid[:120, :160]
    image = ik.Silhouette((u - 90.0) ** 2 + (v - 60.0) ** 2 < 60.0, camera=camera, world_from_camera=pose)
    angles = np.array([0.4, -0.5, 0.2, 0.8])
    h, gradient = arm.criterion(angles, [image], margin=0.8)
    assert h > 1.0
    numeric = [
        (arm.criterion(angles + step, [image], margin=0.8)[0] - arm.criterion(angles - step, [image], margin=0.8)[0])
        / 2e-6
        for step in np.eye(4) * 1e-6
    ]
    assert np.allclose(gradient, numeric, rtol=2e-2, atol=1e-2)


def test_a_bone_lies_in_the_middle_of_a_limb_and_is_content_in_a_trunk():
    camera = voodoo.Camera(160, 120, 150.0, 150.0, 79.5, 59.5)
    v, u = np.mgrid[:120, :160]
    limb, trunk = (np.abs(u - 40) <= 6), (np.abs(u - 110) <= 25)
    image = ik.Silhouette((limb | trunk) & (np.abs(v - 60) < 55), camera=camera, world_from_camera=np.eye(4))
    assert image.thickness[60, 36] == pytest.approx(6.5, abs=1.0)
    assert image.thickness[60, 95] == pytest.approx(25.5, abs=1.0)
    assert image.thickness[60, 60] == 0.0
    text = """name = "bar"
[[limbs]]
name = "base"
shape = { length = 0.1, a0 = 0.05, b0 = 0.05, a1 = 0.05, b1 = 0.05 }
[[limbs]]
name = "bone"
parent = "base"
shape = { length = 0.4, a0 = 0.08, b0 = 0.08, a1 = 0.08, b1 = 0.08 }
joint = { name = "joint" }
"""
    chain = ik.Chain(voodoo.Body.from_toml(text), limbs=("bone",))

    def h(pixel, thin):
        # The bone runs down the picture, 2.5 m away; its radius is 4.8 px.
        base = np.eye(4)
        base[:3, :3] = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
        base[:3, 3] = ((pixel - 79.5) / 60.0, -0.2, 2.5)
        return chain.criterion(chain.rest(), [image], world_from_base=base, margin=1.0, thin=thin)[0]

    assert h(40, 1.7) == 0.0 and h(42.5, 0.0) == 0.0
    assert h(42.5, 1.7) == pytest.approx(2.0, abs=0.7) and h(37.5, 1.7) == pytest.approx(2.0, abs=0.7)
    assert h(100, 1.7) == 0.0


def test_no_elbow_in_the_trunk(arm):
    # Everything is silhouette: nothing but the trunk speaks.
    camera, pose = front_camera(0.3)
    mask = np.ones((120, 160))
    image = ik.Silhouette(mask, camera=camera, world_from_camera=pose)
    angles = np.random.default_rng(0).uniform(arm.limits[:, 0], arm.limits[:, 1], (400, 4))
    deep = np.array([arm.criterion(row, [image])[0] for row in angles])
    assert 0.0 < (deep > 0.0).mean() < 0.5
    # Its gradient leads out of it.
    row = angles[np.argmax(deep)]
    gradient = arm.criterion(row, [image])[1]
    assert arm.criterion(row - 0.05 * gradient / np.linalg.norm(gradient), [image])[0] < deep.max()
    assert all(arm.criterion(row, [image], margin=0.0)[0] == 0.0 for row in angles)  # J10's criterion knows no trunk


def test_a_view_that_is_content_changes_no_step(arm):
    camera, pose = front_camera(0.4)
    v, u = np.mgrid[:120, :160]
    narrow = ik.Silhouette((np.abs(u - 40) < 4) & (np.abs(v - 70) < 35), camera=camera, world_from_camera=pose)
    content = ik.Silhouette(np.ones((120, 160)), camera=camera, world_from_camera=pose)
    goal = {"l_hand": shoulder(arm) + np.array([0.3, 0.05, -0.2])}
    one = ik.solve(arm, goal, images=[narrow], margin=0.0, steps=4)
    two = ik.solve(arm, goal, images=[narrow, content], margin=0.0, steps=4)
    assert one.h > 0.1 and two.images == 2
    assert two.h == pytest.approx(0.5 * one.h, rel=1e-6)
    assert two.angles == pytest.approx(one.angles, abs=1e-9)


def test_a_criterion_that_no_longer_falls_ends_the_search(arm):
    camera, pose = front_camera(0.4)
    v, u = np.mgrid[:120, :160]
    narrow = ik.Silhouette((np.abs(u - 40) < 2) & (np.abs(v - 70) < 35), camera=camera, world_from_camera=pose)
    goal = {"l_hand": shoulder(arm) + np.array([0.3, 0.05, -0.2])}
    found = ik.solve(arm, goal, images=[narrow], steps=5000)
    assert found.h > 1.0 and found.converged and found.steps < 30 and found.residuals[0] < 1e-6
    # There was nothing left to gain.
    assert ik.solve(arm, goal, images=[narrow], start=found, steps=5000).h > 0.97 * found.h


def test_no_bone_in_a_limb_beside_the_chain():
    body = voodoo.Body.human(1.75, model="papers")
    legs = {side: ik.Chain(body, limbs=(f"{side}_thigh", f"{side}_calf")) for side in "lr"}
    camera, pose = front_camera(-0.4)
    everything = ik.Silhouette(np.ones((120, 160)), camera=camera, world_from_camera=pose)
    right = np.array([0.5, 0.0, 0.0, 0.9])
    poses, sites = legs["r"].forward(right)
    # The left leg as it was, with its knee where the right one is.
    angles = ik.solve(legs["l"], {"l_knee": sites["r_knee"]}, start=[0.5, 0.0, 0.0, 0.9], steps=60).angles
    alone = legs["l"].criterion(angles, [everything])[0]
    h, gradient = legs["l"].criterion(angles, [everything], others=poses)
    assert alone == 0.0 and h > 0.5
    numeric = [
        (legs["l"].criterion(angles + step, [everything], others=poses)[0]
         - legs["l"].criterion(angles - step, [everything], others=poses)[0]) / 2e-6
        for step in np.eye(4) * 1e-6
    ]  # fmt: skip
    assert gradient == pytest.approx(numeric, rel=1e-3, abs=1e-3)
    ankle = legs["l"].forward(angles)[1]["l_ankle"]
    found = ik.Follower(legs["l"], start=angles).step({"l_ankle": ankle}, images=[everything], others=poses)
    assert found.residuals[0] < 1e-6 and found.h < 0.5 * h
    with pytest.raises(voodoo.BodyError, match="not on the chain, found"):
        ik.solve(legs["l"], {}, others={"l_calf": np.eye(4)})
    with pytest.raises(voodoo.BodyError, match="l_fin"):
        ik.solve(legs["l"], {}, others={"l_fin": np.eye(4)})
    with pytest.raises(voodoo.MeasurementError, match="others"):
        ik.solve(legs["l"], {}, others={"r_calf": np.ones((4, 4))})


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
        (lambda arm: ik.solve(arm, {"l_hand": (0, 0)}), "three numbers"),
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
        (lambda arm: ik.Silhouette(np.zeros((3, 3)), camera=front_camera()[0], world_from_camera=np.eye(4)), "mask"),
    ],
)
def test_bad_input_is_named(arm, call, words):
    with pytest.raises(voodoo.VoodooError, match=words):
        call(arm)


def test_the_example_of_the_documentation_runs():
    text = (EXAMPLES.parent / "docs" / "ik.md").read_text(encoding="utf-8")
    camera, pose = front_camera()
    names = {"mask": np.ones((120, 160)), "camera": camera, "pose": pose, "hand": (0.3, 0.2, 0.1), "thorax": np.eye(4)}
    exec(text.split("```python\n")[1].split("```")[0], names)
    assert names["posture"].images == 1 and len(names["posture"].angles) == 7


def test_joint_angles_of_an_estimate(tmp_path):
    body = voodoo.Body.human(1.75, model="papers")
    chain = ik.Chain(body)
    rng = np.random.default_rng(1)
    wanted = chain.rest()
    wanted[6:] = np.clip(rng.uniform(-0.6, 0.6, len(wanted) - 6), chain.limits[6:, 0], chain.limits[6:, 1])
    poses, _ = chain.forward(wanted)
    tracker = voodoo.Tracker(body)
    estimate = tracker.reset_pose(dict(poses))
    found = joint_angles(body, estimate)
    assert tuple(found) == angle_names(body) == chain.angle_names[6:]
    assert list(found.values()) == pytest.approx(wanted[6:], abs=1e-6)
    assert found["l_elbow_flexion"] == pytest.approx(wanted[chain.angle_names.index("l_elbow_flexion")], abs=1e-6)


def test_apart_joints_are_projected_onto_the_chain():
    chain = ik.Chain(voodoo.Body.human(1.75, model="papers"))
    poses = {name: pose.copy() for name, pose in chain.forward(chain.rest())[0].items()}
    poses["l_forearm"][:3, 3] += (0.02, 0.0, 0.0)
    angles = chain.project(poses)
    closed, _ = chain.forward(angles)
    read = chain.project(poses, closest=False)
    assert np.isfinite(angles).all()
    apart = [
        np.linalg.norm(pose["l_forearm"][:3, 3] - poses["l_forearm"][:3, 3])
        for pose in (closed, chain.forward(read)[0])
    ]
    assert apart[0] < apart[1]


def test_angles_in_result_files(tmp_path):
    track = Track(
        stamps=np.array([0.0, 0.1]), status=("tracking",) * 2, residual=np.zeros(2), joint_names=("a",),
        joints=np.ones((2, 1, 3)), limb_names=(), world_from_limb=np.empty((2, 0, 4, 4)),
        angle_names=("l_elbow_flexion",), angles=np.array([[0.5], [0.25]]),
    )  # fmt: skip
    for suffix in ("csv", "npz"):
        file = tmp_path / f"pose.{suffix}"
        track.save(file)
        again = Track.load(file)
        assert again.angle_names == track.angle_names and np.array_equal(again.angles, track.angles)
    assert "l_elbow_flexion_rad" in (tmp_path / "pose.csv").read_text().splitlines()[0]


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
    wanted = [np.linalg.norm(reached - np.array(target.values[:3])) for target in targets[:2]]
    assert found.residuals[:2] == pytest.approx(wanted, rel=1e-9, abs=1e-12)


def test_lens_distortion_is_taken_out_of_a_silhouette():
    straight = voodoo.Camera(160, 120, 150.0, 150.0, 79.5, 59.5)
    bent = voodoo.Camera(160, 120, 150.0, 150.0, 79.5, 59.5, distortion=(-0.25, 0.05, 0.0, 0.0))
    # A bar near the border of the picture, as both lenses see it.
    v, u = np.mgrid[:120, :160]
    bar = (np.abs(u - 20) < 5) & (np.abs(v - 60) < 45)
    inside = np.argwhere(bar)[:, ::-1]
    rays = np.column_stack([(inside - (79.5, 59.5)) / 150.0, np.ones(len(inside))])
    seen = np.zeros((120, 160))
    pixels = np.rint(bent.project(rays)).astype(int)
    seen[pixels[:, 1], pixels[:, 0]] = 1
    assert (seen.astype(bool) & bar).sum() < 0.8 * bar.sum()  # the lens moves it
    found = ik.Silhouette(seen, camera=bent, world_from_camera=np.eye(4)).distance < 0
    wanted = ik.Silhouette(bar, camera=straight, world_from_camera=np.eye(4)).distance < 0
    assert (found & wanted).sum() > 0.95 * (found | wanted).sum()


def test_a_planar_chain_stays_in_its_plane(virtual):
    chain = virtual.planar_chain(3)
    assert chain.angle_names == ("joint_0_flexion", "joint_1_flexion", "joint_2_flexion")
    for angles in np.random.default_rng(0).uniform(-1, 1, (10, 3)):
        _, sites = chain.forward(angles)
        turns = np.cumsum(angles)
        tip = virtual.SEGMENT * np.array([-np.sin(turns).sum(), np.cos(turns).sum(), 0.0])
        assert sites["tip"] == pytest.approx(tip, abs=1e-9)
    found = ik.solve(chain, {"tip": (0.2, 0.4, 0.7)}, start=[0.1, 0.2, 0.3], steps=100)
    assert found.joints["tip"] == pytest.approx((0.2, 0.4, 0.0), abs=1e-5)
    assert found.residuals[0] == pytest.approx(0.7, abs=1e-6)


def test_sub_chains_of_a_body_from_toml(virtual):
    body = virtual.planar_chain(4).body
    part = ik.Chain(body, limbs=("segment_2", "segment_3"))
    whole = ik.Chain(body, root="fixed")
    angles = np.array([0.3, -0.2, 0.5, 0.4])
    poses, sites = whole.forward(angles)
    _, found = part.forward(angles[2:], world_from_base=poses["segment_1"])
    assert found["tip"] == pytest.approx(sites["tip"], abs=1e-12)
    assert part.site_names == ("joint_2", "joint_3", "tip")
