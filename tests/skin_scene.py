"""A head and two hands of skin's color in a picture, for the tests of skin and depth."""

from itertools import count

import cv2
import numpy as np

from voodoo import Camera
from voodoo.measurements import ColorImage

CAMERA = Camera(320, 240, 300.0, 300.0, 159.5, 119.5)
# at the origin of a world whose z points up, looking along x
POSE = np.array([[0.0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 1.2], [0, 0, 0, 1]])
SKIN, WALL, SHIRT = (120, 150, 205), (150, 140, 130), (160, 70, 40)  # BGR
Z = 2.5
_NUMBERS = count()


class Pose:
    """What a SkinTracker reads of an estimate."""

    status = "tracking"

    def __init__(self, head, left, right):
        self.joints = {"head_center": at(head), "l_hand": at(left), "r_hand": at(right)}
        self.joint_names, self.joint_positions = tuple(self.joints), np.array(list(self.joints.values()))


def at(pixel, z=Z):
    """World position behind a pixel at depth z."""
    camera_point = np.array([(pixel[0] - CAMERA.cx) / CAMERA.fx * z, (pixel[1] - CAMERA.cy) / CAMERA.fy * z, z])
    return POSE[:3, :3] @ camera_point + POSE[:3, 3]


def picture(head, left, right, *, forearm=None, door=None, light=(1.0, 1.0, 1.0), seed=0):
    """A shirt, a face and two hands; a bare left forearm to the elbow `forearm`, and a door of skin's color."""
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


def shown(image, *, camera=CAMERA, pose=POSE):
    """An image of the camera, 1/30 s after the last one."""
    return ColorImage("skin", next(_NUMBERS) / 30.0, lambda: image, camera, pose)


def learned(skin, frames=8, **parts):
    head, left, right = (160, 60), (110, 120), (210, 120)
    pose = Pose(head, left, right)
    for seed in range(frames):
        image = picture(head, left, right, seed=seed, **parts)
        skin.observe(shown(image), pose.joints)
        skin.learn(shown(image), pose)
    return head, left, right


def pixel_error(skin, site, pixel):
    return np.linalg.norm(np.subtract(skin.assigned[site], pixel))
