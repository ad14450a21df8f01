"""Depth edges, and skin colour that stays with its owner."""

import cv2
import numpy as np
import pytest

import voodoo
from voodoo import Camera, MeasurementError
from voodoo.sensors.assignment import assign
from voodoo.sensors.depth import BodyView, DepthFilter, StillDepth, body_view
from voodoo.sensors.hands import FINGERS_M, of_pieces, to_palm
from voodoo.sensors.skin import SkinSettings, SkinTracker
from voodoo.sensors.skin_regions import candidates, joined

CAMERA = Camera(320, 240, 300.0, 300.0, 159.5, 119.5)
# at the origin of a world whose z points up, looking along x
POSE = np.array([[0.0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 1.2], [0, 0, 0, 1]])
SKIN, WALL, SHIRT = (120, 150, 205), (150, 140, 130), (160, 70, 40)  # BGR
Z = 2.5


class Pose:
    """What a SkinTracker reads of an estimate."""

    status = "tracking"

    def __init__(self, head, left, right):
        self.joints = {"head_center": at(head), "l_hand": at(left), "r_hand": at(right)}


def at(pixel, z=Z):
    """World position behind a pixel at depth z."""
    camera_point = np.array([(pixel[0] - CAMERA.cx) / CAMERA.fx * z, (pixel[1] - CAMERA.cy) / CAMERA.fy * z, z])
    return POSE[:3, :3] @ camera_point + POSE[:3, 3]


def picture(head, left, right, *, forearm=None, door=None, light=(1.0, 1.0, 1.0), seed=0):
    """A shirt, a face and two hands; a bare left forearm to the elbow `forearm`, and a door of skin's colour."""
    image = np.full((240, 320, 3), WALL, np.uint8)
    if door is not None:
        cv2.rectangle(image, door[:2], door[2:], SKIN, -1)
    cv2.rectangle(image, (130, 80), (190, 180), SHIRT, -1)
    cv2.circle(image, head, 10, SKIN, -1)
    if forearm is not None:
        cv2.line(image, forearm, left, SKIN, 9)
    for hand in (left, right):
        cv2.circle(image, hand, 6, SKIN, -1)
    noise = np.random.default_rng(seed).normal(0, 3, image.shape)
    return np.clip(image * np.array(light) + noise, 0, 255).astype(np.uint8)


def learnt(skin, frames=8, **parts):
    head, left, right = (160, 60), (110, 120), (210, 120)
    pose = Pose(head, left, right)
    for seed in range(frames):
        image = picture(head, left, right, seed=seed, **parts)
        skin.observe(image, CAMERA, POSE, pose.joints)
        skin.learn(image, CAMERA, POSE, pose)
    return head, left, right


def pixel_error(skin, site, pixel):
    return np.linalg.norm(np.subtract(skin.assigned[site].pixel, pixel))


def test_hands_and_face_are_found_and_named():
    skin = SkinTracker()
    head, left, right = learnt(skin)
    moved = ((162, 61), (104, 113), (214, 128))
    rays = skin.observe(picture(*moved, seed=99), CAMERA, POSE, Pose(head, left, right).joints)
    assert {ray.site for ray in rays} == {"head_center", "l_hand", "r_hand"}
    for site, pixel in zip(("head_center", "l_hand", "r_hand"), moved, strict=True):
        assert pixel_error(skin, site, pixel) < 2.0


def test_a_hidden_hand_gets_no_ray_and_the_other_keeps_its_own():
    skin = SkinTracker()
    head, left, right = learnt(skin)
    image = picture(head, left, left, seed=5)  # the right hand is not there
    rays = skin.observe(image, CAMERA, POSE, Pose(head, left, right).joints)
    assert {ray.site for ray in rays} == {"head_center", "l_hand"}


def test_a_hand_behind_the_body_does_not_jump_to_what_is_in_front():
    skin = SkinTracker()
    head, left, right = learnt(skin)
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
    head, left, right = learnt(skin)
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
    for outside in (0.0, 0.2):
        skin = SkinTracker()
        learnt(skin)
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
                surface=lambda places, outside=outside: {"thorax": np.full(len(places), outside)},
            )
        found[outside] = {ray.site: ray for ray in rays}
    assert set(found[0.0]) == {"head_center", "r_hand"}
    place = found[0.2]["l_hand"].place  # behind the surface that the depth camera saw
    assert np.linalg.norm(place - at(far, Z)) == pytest.approx(0.04, abs=0.02)


def test_a_shirt_behind_one_hand_is_not_learnt():
    skin = SkinTracker()
    head, left, right = learnt(skin)
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
    head, left, right = learnt(skin)
    image, joints = picture(head, left, right, seed=9), Pose(head, left, right).joints
    found = {}
    for shown in ((), ("head_center", "l_hand")):
        rays = skin.observe(image, CAMERA, POSE, joints, shown=shown)
        found[shown] = {ray.site: ray.bias for ray in rays}
    settings = SkinSettings()
    assert found[()] == dict(settings.sites)
    assert found["head_center", "l_hand"] == dict(settings.sites) | dict(settings.shown_bias)
    with pytest.raises(MeasurementError, match="shown_bias head_center"):
        SkinSettings(shown_bias={"head_center": -0.1})


def test_a_bare_forearm_does_not_take_the_hand_away():
    skin = SkinTracker()
    head, left, right = learnt(skin, forearm=(135, 160))
    moved = (105, 115)
    skin.observe(picture(head, moved, right, forearm=(133, 157), seed=7), CAMERA, POSE, Pose(head, left, right).joints)
    assert pixel_error(skin, "l_hand", moved) < 9.0  # 7 cm; the forearm's middle is 25 pixels away


def test_a_door_of_the_same_colour_takes_nothing_away():
    skin = SkinTracker()
    door = (20, 60, 90, 235)
    head, left, right = learnt(skin, frames=60, door=door)
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


def test_the_colour_follows_the_light():
    skin, blind = SkinTracker(), SkinTracker()
    head, left, right = learnt(skin)
    learnt(blind)
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
    before = skin.colour.skin.copy()
    skin.learn(picture((160, 60), (110, 120), (210, 120)), CAMERA, POSE, pose)
    np.testing.assert_array_equal(before, skin.colour.skin)
    assert not skin.settled


def test_candidates_skip_noise_and_doors():
    mask = np.zeros((240, 320), bool)
    mask[10:12, 10:12] = True
    mask[40:52, 40:52] = True
    mask[0:240, 200:320] = True
    found, regions = candidates(mask, palm_px=5.4)
    assert [item.pixel for item in found] == [(45.5, 45.5)]
    assert (regions == found[0].region).sum() == found[0].area == 144


def test_assignment_is_one_to_one_and_gated():
    cost = np.array([[0.05, 0.09], [0.06, 0.5], [np.nan, np.inf]])
    assert sorted(assign(cost, gate=0.2)) == [(0, 1), (1, 0)]  # both get one, although 0 likes 0 best
    assert assign(cost, gate=0.055) == [(0, 0)]
    assert assign(np.empty((3, 0)), gate=1.0) == []


def test_settings_and_images_are_checked():
    with pytest.raises(MeasurementError, match="gate"):
        SkinSettings(gate=0.0)
    with pytest.raises(MeasurementError, match="240, 320"):
        SkinTracker().observe(np.zeros((10, 10, 3), np.uint8), CAMERA, POSE, {})


def test_flying_pixels_go_and_surfaces_stay():
    depth = np.full((60, 80), 4000, np.uint16)
    depth[:, 30:50] = 2000
    depth[:, 29] = 3100  # between the two surfaces
    depth[:, 50] = 2700
    depth[10, 10] = 3000  # a lonely pixel
    slope = (1500 + 12 * np.arange(80)).astype(np.uint16)
    depth[40:] = slope  # a slanted surface
    dropped = DepthFilter().dropped(depth)
    assert dropped[1:38, 29].all() and dropped[1:38, 50].all() and dropped[10, 10]
    assert not dropped[2:38, 31:49].any() and not dropped[2:38, 52:79].any()
    assert not dropped[42:59, 2:78].any()
    kept = DepthFilter(nearest=2.5, farthest=5.0).apply(depth)
    assert (kept[5, 31:49] == 0).all() and kept[5, 60] == 4000
    with pytest.raises(MeasurementError, match="uint16"):
        DepthFilter().dropped(depth.astype(np.int32))
    with pytest.raises(MeasurementError, match="nearest"):
        DepthFilter(nearest=3.0, farthest=2.0)


def test_body_view_is_where_the_body_is():
    depth_camera = Camera(160, 120, 150.0, 150.0, 79.5, 59.5)
    depth = np.full((120, 160), 4.5, np.float32)
    depth[30:90, 60:80] = Z
    joints = [at((120, 60)), at((160, 180)), at((140, 120))]
    view = body_view(
        depth,
        depth_camera=depth_camera,
        world_from_depth=POSE,
        metres_per_unit=1.0,
        color_camera=CAMERA,
        world_from_color=POSE,
        joints=joints,
    )
    mask = view.mask
    assert view.look_at((140.0, 120.0), 8.0) == (pytest.approx(Z), False)
    assert view.look_at((300.0, 120.0), 8.0) is None
    assert mask.shape == (240, 320)
    assert mask[62:178, 122:158].all()
    assert not mask[:, :110].any() and not mask[:, 175:].any()


@pytest.mark.parametrize("gap", [0, 6])
def test_a_hand_ends_where_a_table_behind_it_begins(gap):
    """Also when the depth camera sees nothing between them, as in the shadow of structured light."""
    depth = np.full((240, 320), 4.5, np.float32)
    depth[110:130, 100:140] = Z + 0.3  # a table of skin's colour, within the box around the body
    depth[100:121, 100:112] = Z  # the hand before it
    depth[110:121, 112 : 112 + gap] = 0.0
    depth[121 : 121 + gap, 100:112] = 0.0
    view = body_view(
        depth,
        depth_camera=CAMERA,
        world_from_depth=POSE,
        metres_per_unit=1.0,
        color_camera=CAMERA,
        world_from_color=POSE,
        joints=[at((120, 60)), at((160, 180)), at((140, 120))],
    )
    skin = np.zeros((240, 320), bool)
    skin[100:121, 100:112] = True
    skin[110:130, 100:140] = True
    assert len(candidates(skin, palm_px=5.4)[0]) != 2  # one region, in colour alone
    found, regions = candidates(skin & view.mask, palm_px=5.4)
    hand = next(item for item in found if regions[105, 105] == item.region)
    assert regions[125, 130] not in (0, hand.region)
    assert np.linalg.norm(np.subtract(hand.pixel, (105.5, 110.0))) < 3.0


def test_what_a_shadow_parts_is_one_hand_and_arms_stay_apart():
    mask = np.zeros((240, 320), bool)
    mask[100:108, 100:108] = mask[110:118, 100:108] = True  # palm and fingers
    mask[100:150, 200:208] = mask[100:150, 210:218] = True  # two forearms
    _, regions = candidates(joined(mask, palm_px=5.4), palm_px=5.4)
    assert regions[104, 104] == regions[114, 104] != 0
    assert regions[120, 204] != regions[120, 214]


def test_a_hand_in_pieces_is_where_it_is_expected_between_them():
    fingers, palm, far = np.array([2.0, 0.0, 0.9]), np.array([2.0, 0.0, 1.0]), np.array([2.0, 0.0, 1.2])
    expected = np.array([2.05, 0.0, 0.97])
    assert np.allclose(of_pieces(fingers, [palm, far], expected), [2.0, 0.0, 0.97])
    assert np.array_equal(of_pieces(fingers, [far], expected), fingers), "no hand is that long"
    assert np.array_equal(of_pieces(fingers, [palm], np.array([2.0, 0.0, 0.5])), fingers), "not beyond the pieces"


def test_a_ring_across_a_hand_does_not_move_it_to_its_fingers():
    grid = np.stack(np.meshgrid(np.arange(320.0), np.arange(240.0)), axis=-1).reshape(-1, 2)
    body = BodyView(np.ones((240, 320), bool), grid, np.full(len(grid), Z - 0.04))
    skin = SkinTracker()
    head, left, right = learnt(skin)
    joints = Pose(head, left, right).joints
    whole = picture(head, left, right, seed=3)
    cv2.ellipse(whole, left, (5, 11), 0, 0, 360, SKIN, -1)
    (ray,) = [ray for ray in skin.observe(whole, CAMERA, POSE, joints, body=body) if ray.site == "l_hand"]
    assert np.linalg.norm(ray.place - joints["l_hand"]) < 0.02
    parted = whole.copy()
    cv2.rectangle(parted, (100, left[1] - 3), (120, left[1] + 2), (90, 40, 30), -1)
    (ray,) = [ray for ray in skin.observe(parted, CAMERA, POSE, joints, body=body) if ray.site == "l_hand"]
    assert pixel_error(skin, "l_hand", left) > 4.0, "it is named after one piece"
    assert np.linalg.norm(ray.place - joints["l_hand"]) < 0.02


def test_a_hands_middle_lies_beyond_its_palm():
    predicted = {"l_hand": np.array([2.0, 0.0, 1.0]), "l_elbow": np.array([2.0, 0.0, 1.3]), "head_center": np.zeros(3)}
    assert np.allclose(to_palm("l_hand", predicted), [0.0, 0.0, FINGERS_M])
    assert np.array_equal(to_palm("head_center", predicted), np.zeros(3))
    assert np.array_equal(to_palm("r_hand", predicted | {"r_hand": np.ones(3)}), np.zeros(3)), "without an elbow"


def test_a_far_hand_is_no_speck():
    """A hand is as large as it is at its own depth, not at that of the nearest site: it keeps its name beyond the gate."""
    skin = SkinTracker()
    head, left, right = learnt(skin)
    grid = np.stack(np.meshgrid(np.arange(320.0), np.arange(240.0)), axis=-1).reshape(-1, 2)
    far = 1.6 * Z
    body = BodyView(np.ones((240, 320), bool), grid, np.where(grid[:, 0] < 140, far, Z))
    joints = Pose(head, left, right).joints
    joints["l_hand"] = at(left, far)
    for step in range(6):
        moved = (left[0] - 4 * step, left[1] - 4 * step)
        image = picture(head, right, right, seed=step)
        cv2.circle(image, moved, 4, SKIN, -1)
        skin.observe(image, CAMERA, POSE, joints, body=body)
        assert pixel_error(skin, "l_hand", moved) < 2.0


def test_a_hand_before_a_door_is_not_the_door():
    """The door has had skin's colour for seconds where no hand was; the hand stands before it."""
    skin = SkinTracker()
    door = (60, 60, 130, 230)
    learnt(skin, frames=60, door=door)
    head, left, right = (160, 60), (85, 180), (210, 120)
    joints = Pose(head, left, right).joints
    grid = np.stack(np.meshgrid(np.arange(320.0), np.arange(240.0)), axis=-1).reshape(-1, 2)
    of_hand = np.hypot(*(grid - left).T) < 7
    mask = of_hand.reshape(240, 320) | (np.arange(320) > 130)
    depths = np.where(of_hand | (grid[:, 0] > 130), Z, Z + 1.0)
    image = picture(head, left, right, door=door, seed=99)
    found = {}
    for before in (None, of_hand.reshape(240, 320)):
        body = BodyView(mask, grid, depths, before=before)
        rays = skin.observe(image, CAMERA, POSE, joints, body=body)
        found[before is None] = {ray.site for ray in rays}
    assert found[True] == {"head_center", "r_hand"}
    assert found[False] == {"head_center", "l_hand", "r_hand"}


def test_what_stands_before_the_scene_is_known_by_what_was_seen_there():
    """Neither a still scene nor its noise stands before itself; a hand that came does, and stays so when it rests."""
    chance = np.random.default_rng(3)
    scene = StillDepth()
    seen = []
    for step in range(20):
        image = (3.0 + chance.normal(0.0, 0.01, (60, 80))).astype(np.float32)
        if step >= 8:
            image[20:30, 30:40] = 2.5
        seen.append(scene.see(image, POSE))
    assert seen[0] is None
    still, before = seen[-1]
    assert before[21:29, 31:39].all() and not still[21:29, 31:39].any()
    outside = np.ones((60, 80), bool)
    outside[19:31, 29:41] = False
    assert not before[outside].any() and still[outside].mean() > 0.95


def test_a_forearm_as_long_as_a_hand_across_its_box_offers_its_tips():
    """What counts is the length along the region, however it lies: a hand turned by 45 degrees stays one."""
    for angle in (0.0, 45.0, 90.0):
        for length, hand in ((3.6, True), (5.4, False)):  # in radii of a palm, 1.6 wide
            image = np.zeros((240, 320), np.uint8)
            box = cv2.boxPoints(((160.0, 120.0), (length * 10.0, 16.0), angle))
            cv2.fillPoly(image, [np.round(box).astype(np.int32)], 1)
            found, _ = candidates(image.astype(bool), palm_px=10.0)
            assert found[0].hand == hand
            assert (len(found) > 1) != hand


def test_a_hand_is_a_forearm_away_from_an_elbow_that_is_seen():
    """With the hand in the shade, the middle of what is left of a bare forearm is near the expected hand, and is not it."""
    head, left, right = (160, 60), (110, 120), (210, 120)
    grid = np.stack(np.meshgrid(np.arange(320.0), np.arange(240.0)), axis=-1).reshape(-1, 2)
    body = BodyView(np.ones((240, 320), bool), grid, np.full(len(grid), Z))
    found = {}
    for held in ((), ("l_hand",)):
        skin = SkinTracker()
        learnt(skin)
        joints = Pose(head, left, right).joints
        joints["l_hand"] = at(left, Z + 0.04)
        joints["l_elbow"] = at((left[0] + 12, left[1] - 24), Z + 0.04)  # 23 cm above the hand
        piece = (left[0] + 6, left[1] - 12)
        rays = skin.observe(picture(head, piece, right, seed=7), CAMERA, POSE, joints, body=body, held=held)
        found[held] = {ray.site for ray in rays}
    assert found[()] == {"head_center", "l_hand", "r_hand"}
    assert found["l_hand",] == {"head_center", "r_hand"}


def test_the_front_end_runs_on_the_bundled_recording():
    from voodoo.recordings import open_recording, sample_path
    from voodoo.sensors.front_end import FrontEnd, FrontEndSettings, paired

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
