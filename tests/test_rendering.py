"""Rendered depth from Python: the API, and agreement with the closest-point query."""

import numpy as np
import pytest

import voodoo
from scene import rest_pose, standing_joints

CAMERA = voodoo.Camera(80, 60, 70.0, 70.0, 39.5, 29.5)
# The world is REP-103; the camera stands 2.4 m before the person and looks along x.
WORLD_FROM_SENSOR = np.array(
    [[0.0, 0.0, 1.0, -2.4], [-1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
)


@pytest.fixture(scope="module")
def body():
    return voodoo.Body.human(1.75, model="full")


def points_of(image, camera):
    rays = np.dstack([camera.rays(), np.ones(image.depth.shape)])
    return (rays * image.depth[..., None])[image.depth > 0.0].astype(np.float64)


@pytest.mark.parametrize("distortion", [(), (-0.2, 0.05, 0.001, -0.002, 0.0)])
def test_every_pixel_lies_on_the_limb_it_names(body, distortion):
    camera = voodoo.Camera(80, 60, 70.0, 70.0, 39.5, 29.5, distortion)
    poses = rest_pose(body)
    image = voodoo.render_depth(body, poses, camera=camera, world_from_sensor=WORLD_FROM_SENSOR)
    assert image.depth.shape == image.limb.shape == (60, 80)
    assert np.array_equal(image.depth > 0.0, image.limb >= 0)
    assert image.limb_names == body.limb_names
    points = points_of(image, camera) @ WORLD_FROM_SENSOR[:3, :3].T + WORLD_FROM_SENSOR[:3, 3]
    limbs = image.limb[image.limb >= 0]
    assert len(points) > 400
    assert len(np.unique(limbs)) >= 12
    for index, limb in enumerate(body.limbs):
        own = points[limbs == index]
        if len(own):
            inverse = np.linalg.inv(poses[limb.name])
            distance = limb.shape.closest_points(own @ inverse[:3, :3].T + inverse[:3, 3]).signed_distance
            assert np.abs(distance).max() < 1e-5, limb.name
    # Nothing of the body lies before what is seen.
    tracker = voodoo.Tracker(body)
    tracker.reset_pose(poses)
    nearer = WORLD_FROM_SENSOR[:3, 3] + (points - WORLD_FROM_SENSOR[:3, 3]) * 0.99
    assert tracker.distance(nearer).min() > -1e-5


def test_an_estimate_renders_as_it_comes(body):
    tracker = voodoo.Tracker(body)
    estimate = tracker.reset(joints=standing_joints(body))
    image = voodoo.render_depth(
        tracker.body, estimate.world_from_limb, camera=CAMERA, world_from_sensor=WORLD_FROM_SENSOR
    )
    assert (
        repr(image)
        == f"RenderedDepth(80x60, {(image.limb >= 0).sum()} pixels of {len(np.unique(image.limb)) - 1} limbs)"
    )
    away = voodoo.render_depth(body, rest_pose(body), camera=CAMERA)
    assert away.depth.dtype == np.float32
    assert away.limb.dtype == np.int16


def test_refuses_wrong_poses(body):
    poses = rest_pose(body)
    with pytest.raises(voodoo.BodyError, match="expected the limbs"):
        voodoo.render_depth(body, {"head": np.eye(4)}, camera=CAMERA)
    with pytest.raises(voodoo.MeasurementError, match="rigid"):
        voodoo.render_depth(body, poses | {"head": 2.0 * np.eye(4)}, camera=CAMERA)
    with pytest.raises(voodoo.MeasurementError, match="world_from_sensor"):
        voodoo.render_depth(body, poses, camera=CAMERA, world_from_sensor=np.eye(3))
