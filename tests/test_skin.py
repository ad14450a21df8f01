"""Skin color that stays with its owner."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

import voodoo
from measurement_data import data_folder
from scene import rest_pose, turn
from skin_scene import CAMERA, POSE, SKIN, Pose, Z, at, learned, picture, pixel_error, shown
from voodoo import Config, MeasurementError
from voodoo.measurements import DepthImage
from voodoo.pipeline.front_end import FrontEnd
from voodoo.pipeline.pairing import paired
from voodoo.recordings import open_recording, sample_path
from voodoo.sensors.pixels import in_sensor, ray_distance
from voodoo.sensors.settings import FrontEndSettings
from voodoo.sensors.skin.settings import SkinSettings
from voodoo.sensors.skin.tracker import SkinTracker


def beside(depth=Z, **changes):
    """The image of a depth camera in the color camera's place, all of it at one depth or given (H, W) [m]."""
    image = np.broadcast_to(np.float32(depth), (240, 320)).copy()
    return replace(DepthImage("depth", 0.0, image, 1.0, CAMERA, POSE), **changes)


def test_hands_and_face_are_found_and_named():
    skin = SkinTracker()
    head, left, right = learned(skin)
    moved = ((162, 61), (104, 113), (214, 128))
    rays = skin.observe(shown(picture(*moved, seed=99)), Pose(head, left, right).joints)
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
    skin, depth = SkinTracker(), beside(camera=bent)
    for seed in range(8):
        image = picture(*observed, seed=seed)
        rays = skin.observe(shown(image, camera=bent), pose.joints, depth=depth)
        skin.learn(shown(image, camera=bent), pose)
    assert [ray.site for ray in rays] == list(names)
    for ray in rays:  # behind the skin, on the ray through the undistorted pixel
        assert ray_distance(ray.origin, ray.direction, pose.joints[ray.site]) < 0.01
        assert np.linalg.norm(ray.place - pose.joints[ray.site]) < 0.09


def test_a_hidden_hand_gets_no_ray_and_the_other_keeps_its_own():
    skin = SkinTracker()
    head, left, right = learned(skin)
    image = picture(head, left, left, seed=5)  # the right hand is not there
    rays = skin.observe(shown(image), Pose(head, left, right).joints)
    assert {ray.site for ray in rays} == {"head_center", "l_hand"}


def test_a_hand_keeps_its_name_while_the_model_falls_behind():
    skin = SkinTracker()
    head, left, right = learned(skin)
    joints = Pose(head, left, right).joints  # the model stands still, 20 cm and more from where the hand goes
    for step in range(1, 6):
        moved = (left[0] - 5 * step, left[1] - 5 * step)
        skin.observe(shown(picture(head, moved, right, seed=step)), joints, depth=beside())
        assert pixel_error(skin, "l_hand", moved) < 2.0


@pytest.mark.parametrize("units", [np.float32, np.uint16])
def test_skin_at_another_distance_is_that_of_the_room(units):
    skin = SkinTracker()
    head, left, right = learned(skin)
    meters = np.full((240, 320), Z)
    meters[:, :135] = Z + 1.0
    image = (meters if units is np.float32 else 1000.0 * meters).astype(units)
    depth = beside(image=image, meters_per_unit=1.0 if units is np.float32 else 0.001)
    joints = Pose(head, left, right).joints
    rays = skin.observe(shown(picture(head, left, right, seed=3)), joints, depth=depth)
    assert {ray.site: ray.place is None for ray in rays} == {"head_center": False, "r_hand": False}
    depth.image[:] = 0  # no return: nothing is known of any distance
    rays = skin.observe(shown(picture(head, left, right, seed=4)), joints, depth=depth)
    assert {ray.site: ray.place is None for ray in rays} == dict.fromkeys(joints, True)


def test_a_depth_camera_at_another_place_measures_the_same():
    """30 cm to the side: what is seen there at a given pixel depends on its distance."""
    skin = SkinTracker()
    head, left, right = learned(skin)
    aside = POSE.copy()
    aside[1, 3] += 0.3
    image = picture(head, left, right, seed=3)
    for away in (Z, Z + 0.25):
        joints = Pose(head, left, right).joints | {"l_hand": at(left, away)}
        depth = beside(np.where(np.arange(320) < 178, away, Z), root_from_sensor=aside)
        rays = {ray.site: ray for ray in skin.observe(shown(image), joints, depth=depth)}
        # Behind the surface by 4 cm.
        assert np.linalg.norm(rays["l_hand"].place - at(left, away)) == pytest.approx(0.04, abs=0.01)


def test_what_lies_on_the_trunk_is_no_hand():
    head, left, right = (160, 60), (110, 120), (210, 120)
    far = (80, 90)
    found = {}
    for aside in (at(far, Z)[1], -0.1):  # where the body stands: at the far place, and away from it
        tracker = voodoo.Tracker(voodoo.Body.human(height=1.78))
        root = np.eye(4)
        root[:3, :3], root[:3, 3] = turn((0.0, 0.0, 1.0), -np.pi / 2), (Z, aside, 1.0)
        tracker.reset_pose({limb: root @ pose for limb, pose in rest_pose(tracker.body).items()})
        skin = SkinTracker()
        learned(skin)
        joints = Pose(head, left, right).joints
        for seed in range(12):  # long enough to have lost it
            skin.observe(shown(picture(head, right, right, seed=seed)), joints, depth=beside())
        image = picture(head, far, right, seed=20)
        rays = skin.observe(shown(image), joints, depth=beside(), tracker=tracker)
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
        skin.observe(shown(image), pose.joints)
        skin.learn(shown(image), pose)
    assert "l_hand" in skin.assigned and pixel_error(skin, "l_hand", left) < 3.0


def test_a_face_pulls_less_at_a_head_that_depth_shows():
    skin = SkinTracker()
    head, left, right = learned(skin)
    image, joints = picture(head, left, right, seed=9), Pose(head, left, right).joints
    found = {}
    for displayed in ((), ("head_center", "l_hand")):
        rays = skin.observe(shown(image), joints, head_visible=displayed)
        found[displayed] = {ray.site: ray.bias for ray in rays}
    settings = SkinSettings()
    assert found[()] == dict(settings.sites)
    assert found["head_center", "l_hand"] == dict(settings.sites) | dict(settings.visible_bias)
    with pytest.raises(MeasurementError, match="visible_bias head_center"):
        SkinSettings(visible_bias={"head_center": -0.1})


def test_the_hand_is_the_end_of_a_bare_forearm_that_is_far_from_the_elbow():
    skin = SkinTracker()
    head, left, right = learned(skin, forearm=(135, 160))
    moved, elbow = (105, 115), (133, 157)
    image, joints = picture(head, moved, right, forearm=elbow, seed=7), Pose(head, left, right).joints
    skin.observe(shown(image), joints | {"l_elbow": at(elbow)})
    assert pixel_error(skin, "l_hand", moved) < 9.0  # 7 cm; the forearm's middle is 25 pixels away


def test_a_hand_is_a_forearm_away_from_its_elbow():
    """With the hand in the shade, the middle of what is left of a bare forearm is near the expected hand, and is not it."""
    skin = SkinTracker()
    head, left, right = learned(skin)
    joints = Pose(head, left, right).joints
    joints["l_hand"] = at(left, Z + 0.04)
    image = picture(head, (left[0] + 6, left[1] - 12), right, seed=7)
    assert {ray.site for ray in skin.observe(shown(image), joints, depth=beside())} == set(joints)
    joints["l_elbow"] = at((left[0] + 12, left[1] - 24), Z + 0.04)  # 23 cm above the hand
    assert "l_hand" not in {ray.site for ray in skin.observe(shown(image), joints, depth=beside())}


def test_a_door_of_the_same_color_gives_no_wrong_hand():
    skin = SkinTracker()
    door = (20, 60, 90, 235)
    head, _, right = learned(skin, frames=60, door=door)
    for seed, hand in enumerate([(100, 125), (60, 150)]):  # near the door, and in front of it
        joints = Pose(head, hand, right).joints
        for ray in skin.observe(shown(picture(head, hand, right, door=door, seed=seed)), joints):
            assert pixel_error(skin, ray.site, dict(zip(joints, (head, hand, right), strict=True))[ray.site]) < 4.0


def test_the_color_follows_the_light():
    skin, blind = SkinTracker(), SkinTracker()
    head, left, right = learned(skin)
    learned(blind)
    pose = Pose(head, left, right)
    for step in range(120):
        light = (1.0 + 0.004 * step, 1.0, 1.0 - 0.0025 * step)
        image = picture(head, left, right, light=light, seed=step)
        skin.observe(shown(image), pose.joints)
        skin.learn(shown(image), pose)
    last = picture(head, left, right, light=light, seed=500)
    assert len(skin.observe(shown(last), pose.joints)) == 3
    assert len(blind.observe(shown(last), pose.joints)) < 3  # without learning the light has taken the cue away


def test_lost_tracking_teaches_nothing():
    skin = SkinTracker()
    pose = Pose((160, 60), (110, 120), (210, 120))
    pose.status = "lost"
    skin.learn(shown(picture((160, 60), (110, 120), (210, 120))), pose)
    assert not skin._cue.learned


def test_settings_and_images_are_checked():
    with pytest.raises(MeasurementError, match="gate"):
        SkinSettings(gate=0.0)
    with pytest.raises(MeasurementError, match="240, 320"):
        SkinTracker().observe(shown(np.zeros((10, 10, 3), np.uint8)), {})


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"image": np.zeros((240, 319), np.float32)}, "a depth for every pixel of the camera"),
        ({"image": np.zeros((240, 320), np.int64)}, "uint16 or float32"),
        ({"root_from_sensor": np.eye(3)}, "shape .4, 4."),
    ],
)
def test_a_depth_image_is_checked(change, message):
    skin = SkinTracker()
    joints = Pose((160, 60), (110, 120), (210, 120)).joints
    with pytest.raises(MeasurementError, match=message):
        skin.observe(shown(np.zeros((240, 320, 3), np.uint8)), joints, depth=beside(**change))


def test_no_places_and_places_that_are_nowhere_give_nothing():
    skin = SkinTracker()
    head, left, right = learned(skin)
    image = picture(head, left, right)
    for joints in (
        {},
        {"l_hand": np.full(3, np.nan)},
        {"l_hand": np.array([-2.0, 0.0, 1.0])},
        {"l_hand": np.full(3, 1e300)},
    ):
        assert skin.observe(shown(image), joints, depth=beside()) == []
    assert len(skin.observe(shown(image), Pose(head, left, right).joints)) == 3


def run(recording, use, solver="chain", frames=30):
    """The estimates of the first frames, and the number of rays."""
    body = voodoo.Body.human(height=recording.start["height_m"], model="papers" if solver == "limbwise" else "full")
    tracker = voodoo.Tracker(body, config=Config(solver=solver))
    tracker.reset(joints=recording.start["joints"], fit_sizes=True)
    front_end = FrontEnd(tracker, settings=FrontEndSettings(use=use, ground_z=0.0))
    estimates, rays = [], 0
    for recorded, _ in zip(paired(recording), range(frames), strict=False):
        # what was taken up to 10 ms after the depth image belongs to it
        assert max(item.stamp for item in recorded.measurements) - recorded.stamp <= 0.010
        estimates.append(front_end.step(recorded))
        rays += len(front_end.rays)
    return estimates, rays


def test_the_front_end_runs_on_the_bundled_recording():
    recording = open_recording(sample_path())
    runs = [run(recording, ("depth", "skin")) for _ in range(2)]
    estimates, rays = runs[0]
    assert estimates[-1].status != "lost" and rays > 30
    assert any(name.startswith("/camera/color") for name in estimates[-1].sources)
    positions = [[estimate.joint_positions.tolist() for estimate in each] for each, _ in runs]
    assert positions[0] == positions[1], "bit by bit the same"
    with pytest.raises(MeasurementError, match="sonar"):
        FrontEndSettings(use=("sonar",))
    assert "skin" not in FrontEndSettings().use and "skin" not in FrontEndSettings.of(recording).use


def test_fusion_keeps_the_arms_that_depth_alone_loses_with_the_published_solver(voodoo_data):
    """K06 section V: depth alone loses fast arms, and skin gives them back."""
    recording = open_recording(data_folder(voodoo_data, "rendered", "dev_01_bend_scoop_cmu"))
    reference = recording.reference
    hands = [reference.names.index(name) for name in ("l_wrist", "r_wrist", "l_hand", "r_hand")]
    error = {}
    for use in (("depth",), ("depth", "skin")):
        estimates, _ = run(recording, use, "limbwise", len(reference.positions))
        found = np.array([[estimate.joints[reference.names[hand]] for hand in hands] for estimate in estimates])
        error[use] = np.linalg.norm(found - reference.positions[:, hands], axis=2).mean()
    assert error["depth", "skin"] < 0.6 * error["depth",], error
