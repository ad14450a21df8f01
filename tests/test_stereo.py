"""Stereo depth of a rendered scene whose depth is known."""

import cv2
import numpy as np
import pytest

from voodoo import Camera, MeasurementError
from voodoo.sensors.stereo import StereoPair

LEFT = Camera(320, 240, 300.0, 300.0, 160.0, 120.0, (-0.1, 0.02, 0.0, 0.0))
RIGHT = Camera(320, 240, 302.0, 301.0, 158.0, 121.0, (-0.08, 0.01, 0.0, 0.0))
LEFT_FROM_RIGHT = np.eye(4)
LEFT_FROM_RIGHT[:3, :3] = cv2.Rodrigues(np.array([0.004, -0.01, 0.006]))[0]
LEFT_FROM_RIGHT[:3, 3] = (0.12, 0.002, -0.001)


def picture(camera, world_from_camera, planes):
    """What a camera sees of textured upright planes z = const, each inside a range of x [m], the last one
    everywhere."""
    texture = np.random.default_rng(3).integers(0, 255, (4000, 4000)).astype(np.uint8)
    texture = cv2.GaussianBlur(texture, (0, 0), 2.0)
    texture = cv2.normalize(texture, None, 0, 255, cv2.NORM_MINMAX)
    rays = np.dstack([camera.rays(), np.ones((camera.height, camera.width))]) @ world_from_camera[:3, :3].T
    image = np.zeros((camera.height, camera.width), np.uint8)
    for z, low, high in reversed(planes):
        scale = (z - world_from_camera[2, 3]) / rays[..., 2]
        x, y = (world_from_camera[axis, 3] + rays[..., axis] * scale for axis in (0, 1))
        observed = cv2.remap(
            texture,
            (2000 + 180 * x).astype(np.float32),
            (2000 + 180 * y + 300 * z).astype(np.float32),
            cv2.INTER_LINEAR,
        )
        inside = (x >= low) & (x <= high)
        image[inside] = observed[inside]
    return image


def test_depth_of_two_planes():
    planes = [(2.0, -0.4, 0.3), (4.0, -9.0, 9.0)]
    pair = StereoPair(LEFT, RIGHT, LEFT_FROM_RIGHT)
    found = pair.depth(picture(LEFT, np.eye(4), planes), picture(RIGHT, LEFT_FROM_RIGHT, planes))
    assert not found.camera.distorted
    z = found.image
    rays = np.dstack([found.camera.rays(), np.ones(z.shape)])
    points = (rays * z[..., None])[z > 0] @ found.world_from_sensor[:3, :3].T  # in the left camera's frame
    assert (z > 0).mean() > 0.5
    near, far = points[np.abs(points[:, 2] - 2.0) < 0.3], points[np.abs(points[:, 2] - 4.0) < 0.8]
    assert len(near) + len(far) > 0.95 * len(points)
    assert abs(np.median(near[:, 2]) - 2.0) < 0.02 and abs(np.median(far[:, 2]) - 4.0) < 0.08
    assert np.quantile(near[:, 0], 0.02) > -0.5 and np.quantile(near[:, 0], 0.98) < 0.4
    # the error grows with the square of the depth, and the promised sigma covers it
    for part, depth in ((near, 2.0), (far, 4.0)):
        assert np.quantile(np.abs(part[:, 2] - depth), 0.68) < pair.noise.sigma(depth)
    assert pair.noise.sigma(4.0) == pytest.approx(4.0 * pair.noise.sigma(2.0))


def test_bad_pairs_are_refused():
    left_of_it = LEFT_FROM_RIGHT.copy()
    left_of_it[0, 3] *= -1
    with pytest.raises(MeasurementError, match="to the right"):
        StereoPair(LEFT, RIGHT, left_of_it)
    with pytest.raises(MeasurementError, match="left_from_right: expected a rigid 4x4 transform"):
        StereoPair(LEFT, RIGHT, 2.0 * LEFT_FROM_RIGHT)
    with pytest.raises(MeasurementError, match="one size"):
        StereoPair(LEFT, Camera(160, 120, 150.0, 150.0, 80.0, 60.0), LEFT_FROM_RIGHT)
    with pytest.raises(MeasurementError, match="left: expected uint8"):
        StereoPair(LEFT, RIGHT, LEFT_FROM_RIGHT).depth(np.zeros((2, 2), np.uint8), np.zeros((240, 320), np.uint8))
