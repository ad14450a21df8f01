"""Skin color that stays with its owner."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

import voodoo
from scene import rest_pose, turn
from skin_scene import CAMERA, POSE, SKIN, Pose, Z, at, learned, picture, pixel_error
from voodoo import MeasurementError
from voodoo.sensors.body_view import BodyView
from voodoo.sensors.pixels import in_sensor, ray_distance
from voodoo.sensors.skin.settings import SkinSettings
from voodoo.sensors.skin.tracker import SkinTracker


def test_hands_and_face_are_found_and_named():
    skin = SkinTracker()
    head, left, right = learned(skin)
    moved = ((162, 61), (104, 113), (214, 128))
    rays = skin.observe(picture(*moved, seed=99), CAMERA, POSE, Pose(head, left, right).joints)
    assert {ray.site for ray in rays} == {"head_center", "l_hand", "r_hand"}
    for site, pixel in zip(("head_center", "l_hand", "r_hand"), moved, strict=True):
        assert pixel_error(skin, site, pixel) < 2.0


def test_a_distorting_lens_is_undistorted():
    bent = replace(CAMERA, distortion=(0.05, -0.02, 0.001, 0.0))
    head, left, right = (160, 60), (110, 120), (210, 120)
    pose = Pose(head, left, right)
    names = ("head_center", "l_hand", "r_hand")
    points = np.array([pose.joints[name] for name in names])
    observed = [tuple(pixel) for pixel in bent.project(in_sensor(POSE, points)).round().astype(int).tolist()]
    grid = np.stack(np.meshgrid(np.arange(320.0), np.arange(240.0)), axis=-1).reshape(-1, 2)
    skin, body = SkinTracker(), BodyView(np.ones((240, 320), bool), grid, np.full(len(grid), Z))
    for seed in range(8):
        image = picture(*observed, seed=seed)
        rays = skin.observe(image, bent, POSE, pose.joints, body=body)
        skin.learn(image, bent, POSE, pose)
    assert [ray.site for ray in rays] == list(names)
    for ray in rays:  # behind the skin, on the ray through the undistorted pixel
        assert ray_distance(ray.origin, ray.direction, pose.joints[ray.site]) < 0.01
        assert np.linalg.norm(ray.place - pose.joints[ray.site]) < 0.09


def test_a_hidden_hand_gets_no_ray_and_the_other_keeps_its_own():
    skin = SkinTracker()
    head, left, right = learned(skin)
    image = picture(head, left, left, seed=5)  # the right hand is not there
    rays = skin.observe(image, CAMERA, POSE, Pose(head, left, right).joints)
    assert {ray.site for ray in rays} == {"head_center", "l_hand"}


def test_a_hand_behind_the_body_does_not_jump_to_what_is_in_front():
    skin = SkinTracker()
    head, left, right = learned(skin)
    joints = Pose(head, left, right).joints
    grid = np.stack(np.meshgrid(np.arange(320.0), np.arange(240.0)), axis=-1).reshape(-1, 2)
    body = BodyView(np.ones((240, 320), bool), grid, np.full(len(grid), Z))
    image = picture(head, left, right, seed=11)
    assert len(skin.observe(image, CAMERA, POSE, joints, body=body)) == 3
    joints["l_hand"] = at(left, Z + 0.4)
    hidden = picture(head, right, right, seed=12)
    for _ in range(10):
        skin.observe(hidden, CAMERA, POSE, joints, body=body)
    rays = skin.observe(image, CAMERA, POSE, joints, body=body)
    assert {ray.site for ray in rays} == {"head_center", "r_hand"}


def test_a_hand_keeps_its_name_while_the_model_falls_behind():
    skin = SkinTracker()
    head, left, right = learned(skin)
    joints = Pose(head, left, right).joints  # the model stands still, 20 cm and more from where the hand goes
    for step in range(1, 8):
        moved = (left[0] - 5 * step, left[1] - 6 * step)
        skin.observe(picture(head, moved, right, seed=step), CAMERA, POSE, joints)
        assert pixel_error(skin, "l_hand", moved) < 2.0


def test_a_lost_hand_is_taken_up_where_the_body_explains_nothing():
    head, left, right = (160, 60), (110, 120), (210, 120)
    far = (80, 90)
    grid = np.stack(np.meshgrid(np.arange(320.0), np.arange(240.0)), axis=-1).reshape(-1, 2)
    body = BodyView(np.ones((240, 320), bool), grid, np.full(len(grid), Z))
    found = {}
    for aside in (at(far, Z)[1], -0.1):  # where the body stands: at the far place, and away from it
        tracker = voodoo.Tracker(voodoo.Body.human(height=1.78))
        upright = turn((0.0, 0.0, 1.0), -np.pi / 2)
        root = np.eye(4)
        root[:3, :3], root[:3, 3] = upright, (Z, aside, 1.0)
        tracker.reset_pose({limb: root @ pose for limb, pose in rest_pose(tracker.body).items()})
        skin = SkinTracker()
        learned(skin)
        joints = Pose(head, left, right).joints
        for seed in range(12):  # long enough to have lost it
            skin.observe(picture(head, right, right, seed=seed), CAMERA, POSE, joints, body=body)
        for seed in range(8):  # a name without the body following is given up later
            rays = skin.observe(
                picture(head, far, right, seed=seed),
                CAMERA,
                POSE,
                joints,
                body=body,
                tracker=tracker,
            )
        explained = bool(tracker.distance(at(far, Z)[None])[0] < 0.0)
        found[explained] = {ray.site: ray for ray in rays}
    assert set(found[True]) == {"head_center", "r_hand"}
    place = found[False]["l_hand"].place  # behind the surface that the depth camera saw
    assert np.linalg.norm(place - at(far, Z)) == pytest.approx(0.04, abs=0.02)


def test_a_shirt_behind_one_hand_is_not_learned():
    skin = SkinTracker()
    head, left, right = learned(skin)
    shirt = (120, 110, 200)  # pink
    pose = Pose(head, left, right)
    for seed in range(20):
        image = picture(head, left, right, seed=seed)
        cv2.circle(image, left, 30, shirt, -1)
        cv2.circle(image, left, 5, SKIN, -1)
        skin.observe(image, CAMERA, POSE, pose.joints)
        skin.learn(image, CAMERA, POSE, pose)
    assert "l_hand" in skin.assigned and pixel_error(skin, "l_hand", left) < 3.0


def test_a_face_pulls_less_at_a_head_that_depth_shows():
    skin = SkinTracker()
    head, left, right = learned(skin)
    image, joints = picture(head, left, right, seed=9), Pose(head, left, right).joints
    found = {}
    for displayed in ((), ("head_center", "l_hand")):
        rays = skin.observe(image, CAMERA, POSE, joints, head_visible=displayed)
        found[displayed] = {ray.site: ray.bias for ray in rays}
    settings = SkinSettings()
    assert found[()] == dict(settings.sites)
    assert found["head_center", "l_hand"] == dict(settings.sites) | dict(settings.visible_bias)
    with pytest.raises(MeasurementError, match="visible_bias head_center"):
        SkinSettings(visible_bias={"head_center": -0.1})


def test_a_bare_forearm_does_not_take_the_hand_away():
    skin = SkinTracker()
    head, left, right = learned(skin, forearm=(135, 160))
    moved = (105, 115)
    skin.observe(picture(head, moved, right, forearm=(133, 157), seed=7), CAMERA, POSE, Pose(head, left, right).joints)
    assert pixel_error(skin, "l_hand", moved) < 9.0  # 7 cm; the forearm's middle is 25 pixels away


def test_a_door_of_the_same_color_takes_nothing_away():
    skin = SkinTracker()
    door = (20, 60, 90, 235)
    head, left, right = learned(skin, frames=60, door=door)
    behind = (100, 125)  # the hand goes to the door, then in front of it
    joints = Pose(head, left, right).joints
    skin.observe(picture(head, behind, right, door=door, seed=3), CAMERA, POSE, joints)
    assert pixel_error(skin, "l_hand", behind) < 4.0
    rays = skin.observe(
        picture(head, (60, 150), right, door=door, seed=4), CAMERA, POSE, Pose(head, (60, 150), right).joints
    )
    for ray in rays:
        if ray.site == "l_hand":  # better no ray than one to the door's middle
            assert pixel_error(skin, "l_hand", (60, 150)) < 10.0


def test_the_color_follows_the_light():
    skin, blind = SkinTracker(), SkinTracker()
    head, left, right = learned(skin)
    learned(blind)
    pose = Pose(head, left, right)
    for step in range(120):
        light = (1.0 + 0.004 * step, 1.0, 1.0 - 0.0025 * step)
        image = picture(head, left, right, light=light, seed=step)
        skin.observe(image, CAMERA, POSE, pose.joints)
        skin.learn(image, CAMERA, POSE, pose)
    last = picture(head, left, right, light=light, seed=500)
    assert len(skin.observe(last, CAMERA, POSE, pose.joints)) == 3
    assert len(blind.observe(last, CAMERA, POSE, pose.joints)) < 3  # without learning the light has taken the cue away


def test_lost_tracking_teaches_nothing():
    skin = SkinTracker()
    pose = Pose((160, 60), (110, 120), (210, 120))
    pose.status = "lost"
    before = skin.colors
    skin.learn(picture((160, 60), (110, 120), (210, 120)), CAMERA, POSE, pose)
    np.testing.assert_array_equal(before, skin.colors)
    assert not skin.settled


def test_settings_and_images_are_checked():
    with pytest.raises(MeasurementError, match="gate"):
        SkinSettings(gate=0.0)
    with pytest.raises(MeasurementError, match="240, 320"):
        SkinTracker().observe(np.zeros((10, 10, 3), np.uint8), CAMERA, POSE, {})


def test_the_front_end_runs_on_the_bundled_recording():
    from voodoo.pipeline.front_end import FrontEnd
    from voodoo.pipeline.pairing import paired
    from voodoo.recordings import open_recording, sample_path
    from voodoo.sensors.settings import FrontEndSettings

    recording = open_recording(sample_path())
    tracker = voodoo.Tracker(voodoo.Body.human(height=recording.start["height_m"]))
    tracker.reset(joints=recording.start["joints"], fit_sizes=True)
    front_end = FrontEnd(tracker, settings=FrontEndSettings(ground_z=0.0))
    rays = 0
    for recorded, _ in zip(paired(recording), range(30), strict=False):
        # what was taken up to 10 ms after the depth image belongs to it
        assert max(item.stamp for item in recorded.measurements) - recorded.stamp <= 0.010
        estimate = front_end.step(recorded)
        rays += len(front_end.rays)
    assert estimate.status != "lost"
    assert rays > 30
    assert any(name.startswith("/camera/color") for name in estimate.sources)
    with pytest.raises(MeasurementError, match="sonar"):
        FrontEndSettings(use=("sonar",))
