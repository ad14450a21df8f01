"""Which part of a region of skin is the hand."""

import cv2
import numpy as np
import pytest

from skin_scene import CAMERA, POSE, SKIN, Pose, Z, at, learned, picture, pixel_error
from voodoo.sensors.body_view import BodyView, body_view
from voodoo.sensors.skin.tracker import SkinTracker


@pytest.mark.parametrize("gap", [0, 6])
def test_a_hand_ends_where_a_table_behind_it_begins(gap):
    """Also when the depth camera sees nothing between them, as in the shadow of structured light."""
    depth = np.full((240, 320), 4.5, np.float32)
    depth[110:130, 100:140] = Z + 0.3  # a table of skin's color, within the box around the body
    depth[100:121, 100:112] = Z  # the hand before it
    depth[110:121, 112 : 112 + gap] = 0.0
    depth[121 : 121 + gap, 100:112] = 0.0
    view = body_view(
        depth,
        depth_camera=CAMERA,
        world_from_depth=POSE,
        meters_per_unit=1.0,
        color_camera=CAMERA,
        world_from_color=POSE,
        joints=[at((120, 60)), at((160, 180)), at((140, 120))],
    )
    skin = np.zeros((240, 320), bool)
    skin[100:121, 100:112] = True
    skin[110:130, 100:140] = True
    assert cv2.connectedComponents(skin.view(np.uint8))[0] == 2  # background and one region, in color alone
    _, regions, _, middles = cv2.connectedComponentsWithStats((skin & view.mask).view(np.uint8))
    hand = regions[105, 105]
    assert hand != 0 and regions[125, 130] not in (0, hand)
    assert np.linalg.norm(middles[hand] - (105.5, 110.0)) < 3.0


def test_a_ring_across_a_hand_does_not_move_it_to_its_fingers():
    grid = np.stack(np.meshgrid(np.arange(320.0), np.arange(240.0)), axis=-1).reshape(-1, 2)
    body = BodyView(np.ones((240, 320), bool), grid, np.full(len(grid), Z - 0.04))
    skin = SkinTracker()
    head, left, right = learned(skin)
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


def test_a_far_hand_is_no_speck():
    """A hand is as large as it is at its own depth, not at that of the nearest site: it keeps its name beyond the gate."""
    skin = SkinTracker()
    head, left, right = learned(skin)
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
    """The door has had skin's color for seconds where no hand was; the hand stands before it."""
    skin = SkinTracker()
    door = (60, 60, 130, 230)
    learned(skin, frames=60, door=door)
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


def test_a_hand_is_a_forearm_away_from_an_elbow_that_is_visible():
    """With the hand in the shade, the middle of what is left of a bare forearm is near the expected hand, and is not it."""
    head, left, right = (160, 60), (110, 120), (210, 120)
    grid = np.stack(np.meshgrid(np.arange(320.0), np.arange(240.0)), axis=-1).reshape(-1, 2)
    body = BodyView(np.ones((240, 320), bool), grid, np.full(len(grid), Z))
    found = {}
    for held in ((), ("l_hand",)):
        skin = SkinTracker()
        learned(skin)
        joints = Pose(head, left, right).joints
        joints["l_hand"] = at(left, Z + 0.04)
        joints["l_elbow"] = at((left[0] + 12, left[1] - 24), Z + 0.04)  # 23 cm above the hand
        piece = (left[0] + 6, left[1] - 12)
        rays = skin.observe(
            picture(head, piece, right, seed=7), CAMERA, POSE, joints, body=body, upper_arm_visible=held
        )
        found[held] = {ray.site for ray in rays}
    assert found[()] == {"head_center", "l_hand", "r_hand"}
    assert found["l_hand",] == {"head_center", "r_hand"}
