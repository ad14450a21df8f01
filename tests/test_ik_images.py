"""The image constraint: the criterion h and its silhouettes."""

import numpy as np
import pytest

import voodoo
from ik_cases import BAR, front_camera, shoulder
from voodoo import ik


@pytest.mark.parametrize("pixels", [np.zeros((120, 160)), np.ones((120, 160))])
def test_silhouettes_that_report_nothing_change_nothing(arm, pixels):
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


@pytest.mark.parametrize("wrong", [{"margin": np.nan}, {"margin": -1.0}, {"thin": np.nan}, {"thin": 9.0}])
def test_the_criterion_refuses_what_the_solver_refuses(arm, wrong):
    """A margin that is no number had every bone content, h = 0."""
    camera, pose = front_camera()
    mask = np.zeros((120, 160))
    mask[:5, :5] = 1
    image = ik.Silhouette(mask, camera=camera, world_from_camera=pose)
    assert arm.criterion(arm.rest(), [image])[0] > 1.0
    with pytest.raises(voodoo.MeasurementError, match=rf"^{next(iter(wrong))}: expected 0 to"):
        arm.criterion(arm.rest(), [image], **wrong)


def test_a_bone_lies_in_the_middle_of_a_limb_and_is_content_in_a_trunk():
    camera = voodoo.Camera(160, 120, 150.0, 150.0, 79.5, 59.5)
    v, u = np.mgrid[:120, :160]
    limb, trunk = (np.abs(u - 40) <= 6), (np.abs(u - 110) <= 25)
    image = ik.Silhouette((limb | trunk) & (np.abs(v - 60) < 55), camera=camera, world_from_camera=np.eye(4))
    assert image.thickness[60, 36] == pytest.approx(6.5, abs=1.0)
    assert image.thickness[60, 95] == pytest.approx(25.5, abs=1.0)
    assert image.thickness[60, 60] == 0.0
    chain = ik.Chain(voodoo.Body.from_toml(BAR), limbs=("bone",))

    def h(pixel, thin, image=image):
        # The bone runs down the picture, 2.5 m away; its radius is 4.8 px.
        base = np.eye(4)
        base[:3, :3] = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
        base[:3, 3] = ((pixel - 79.5) / 60.0, -0.2, 2.5)
        return chain.criterion(chain.rest(), [image], world_from_base=base, margin=1.0, thin=thin)[0]

    assert h(40, 1.7) == 0.0 and h(42.5, 0.0) == 0.0
    assert h(42.5, 1.7) == pytest.approx(2.0, abs=0.7) and h(37.5, 1.7) == pytest.approx(2.0, abs=0.7)
    assert h(100, 1.7) == 0.0
    # An outline that may be 5 px off asks for less: neither for the middle, to half of that, nor for depth.
    vague = ik.Silhouette(image.distance < 0.0, camera=camera, world_from_camera=np.eye(4), border=5.0)
    assert h(42, 1.7, vague) == 0.0 and h(45, 1.7, vague) > 0.0
    assert h(86, 1.7) > 1.0 and h(86, 1.7, vague) == 0.0


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


def test_lens_distortion_is_taken_out_of_a_silhouette():
    straight = voodoo.Camera(160, 120, 150.0, 150.0, 79.5, 59.5)
    bent = voodoo.Camera(160, 120, 150.0, 150.0, 79.5, 59.5, distortion=(-0.25, 0.05, 0.0, 0.0))
    # A bar near the border of the picture, as both lenses see it.
    v, u = np.mgrid[:120, :160]
    bar = (np.abs(u - 20) < 5) & (np.abs(v - 60) < 45)
    inside = np.argwhere(bar)[:, ::-1]
    rays = np.column_stack([(inside - (79.5, 59.5)) / 150.0, np.ones(len(inside))])
    observed = np.zeros((120, 160))
    pixels = np.rint(bent.project(rays)).astype(int)
    observed[pixels[:, 1], pixels[:, 0]] = 1
    assert (observed.astype(bool) & bar).sum() < 0.8 * bar.sum()  # the lens moves it
    found = ik.Silhouette(observed, camera=bent, world_from_camera=np.eye(4)).distance < 0
    expected = ik.Silhouette(bar, camera=straight, world_from_camera=np.eye(4)).distance < 0
    assert (found & expected).sum() > 0.95 * (found | expected).sum()


def test_images_alone_are_an_answer_too(arm):
    camera, pose = front_camera(0.5)
    for seed in range(30):
        rng = np.random.default_rng(seed)
        mask = np.zeros((120, 160), dtype=np.uint8)
        top, left = rng.integers(10, 60), rng.integers(40, 90)
        mask[top : top + 50, left : left + rng.integers(10, 50)] = 1
        image = ik.Silhouette(mask, camera=camera, world_from_camera=pose)
        start = np.clip(rng.uniform(-1.0, 1.0, 4), *arm.limits.T)
        found = ik.solve(arm, {}, images=[image], start=start, steps=100)
        assert found.residuals == () and found.h <= arm.criterion(start, [image])[0] + 1e-9
