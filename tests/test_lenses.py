"""Depth cameras whose lenses distort: the projections against OpenCV's, and a person followed as through a pinhole."""

import pickle

import cv2
import numpy as np
import pytest

import voodoo
from lenses import LENSES
from room_walk import Walk
from synthetic.gait import path
from voodoo.errors import CameraError
from voodoo.evaluation.metrics import JOINTS


def through(name, width=320, height=240, focal=220.0):
    model, coefficients = LENSES[name]
    return voodoo.Camera(width, height, focal, 1.02 * focal, 0.49 * width, 0.52 * height, coefficients, model)


def as_wide(name):
    """A camera that sees 50 degrees to the left and right of its axis."""
    half, edge = 159.5, np.tan(np.radians(50.0))
    focal = half / float(through(name, 2, 2, 1.0).project([[edge, 0.0, 1.0]])[0, 0] - 0.98)
    model, coefficients = LENSES[name]
    return voodoo.Camera(320, 240, focal, focal, half, 119.5, coefficients, model)


def by_opencv(camera, points):
    zero = np.zeros(3)
    coefficients = np.array(camera.distortion or (0.0,) * 4)
    project = cv2.fisheye.projectPoints if camera.model == "equidistant" else cv2.projectPoints
    return project(points[:, None], zero, zero, camera.matrix, coefficients)[0].reshape(-1, 2)


@pytest.mark.parametrize("name", LENSES)
def test_projections_are_those_of_opencv(name):
    camera = through(name)
    rng = np.random.default_rng(3)
    points = np.column_stack([rng.uniform(-0.9, 0.9, (500, 2)), np.ones(500)]) * rng.uniform(0.3, 6.0, (500, 1))
    np.testing.assert_allclose(camera.project(points), by_opencv(camera, points), rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("name", LENSES)
def test_rays_are_those_of_opencv(name):
    camera = through(name)
    pixels = np.random.default_rng(4).uniform((0.0, 0.0), (319.0, 239.0), (500, 2))
    until = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 500, 1e-13)
    undistort = cv2.fisheye.undistortPoints if camera.model == "equidistant" else cv2.undistortPoints
    coefficients = np.array(camera.distortion or (0.0,) * 4)
    expected = undistort(pixels[:, None], camera.matrix, coefficients, criteria=until).reshape(-1, 2)
    found = camera.undistorted(pixels)
    assert np.isfinite(found).all()
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=2e-8)
    # Where the two differ, ours is the one that comes back to the pixel.
    back = camera.project(np.column_stack([found, np.ones(len(found))]))
    np.testing.assert_allclose(back, pixels, rtol=0.0, atol=1e-9)


def test_bad_coefficients_are_refused_by_the_core_too():
    with pytest.raises(CameraError, match="camera distortion: expected 0, 4 or 5 coefficients, found 3"):
        voodoo._core.Camera(8, 6, (5.0, 5.0, 3.5, 2.5), "plumb_bob", (0.1, 0.2, 0.3))
    with pytest.raises(CameraError, match="finite coefficients"):
        voodoo._core.Camera(8, 6, (5.0, 5.0, 3.5, 2.5), "equidistant", (0.1, np.nan, 0.3, 0.0))


def test_a_camera_goes_to_another_process_and_back():
    camera = through("azure")
    camera.rays()
    other = pickle.loads(pickle.dumps(camera))
    assert other == camera
    np.testing.assert_array_equal(other.rays(), camera.rays())


def test_what_lies_beyond_the_lens_is_nowhere():
    barrel = voodoo.Camera(64, 48, 50.0, 50.0, 31.5, 23.5, (-0.25, 0.0, 0.0, 0.0))
    pixels = barrel.project([[1.1, 0.0, 1.0], [1.2, 0.0, 1.0], [9.0, 0.0, 1.0]])
    assert np.isfinite(pixels[0]).all() and np.isnan(pixels[1:]).all()


FOLLOWED = ("none", "plumb_bob", "azure", "fisheye")
ENDS = [(sign * start, sign * end) for start, end in ((0.4, 1.2), (0.5, 1.1), (0.3, 1.0)) for sign in (1, -1)]
"""Lateral start and end of walks [m], up to 40 degrees off the axis."""


def followed(camera, ends):
    """Joint errors [m] of a walking person; for each limb in each frame, whether it is reported lost, and whether measured."""
    body = voodoo.Body.human(height=1.78)
    stops = path([(0.0, 2.1, ends[0]), (0.7, 1.9, ends[1])])
    walk, tracker, errors, statuses = Walk(body=body, stops=stops, camera=camera), voodoo.Tracker(body), [], []
    for frame in walk:
        if not errors:
            tracker.reset(joints=frame.joints)
        estimate = tracker.step(walk.measurement(frame))
        errors += [np.linalg.norm(estimate.joints[name] - frame.joints[name]) for name in JOINTS]
        statuses += estimate.limb_status.values()
    return errors, np.equal(statuses, "lost"), np.equal(statuses, "measured")


def test_a_person_is_followed_through_every_lens_as_through_a_pinhole():
    runs = [[[np.mean(each) for each in followed(as_wide(name), ends)] for name in FOLLOWED] for ends in ENDS]
    errors, lost, measured = np.moveaxis(np.array(runs), 2, 0)
    assert errors[:, 0].max() < 0.02
    assert abs(errors[:, 1:] - errors[:, :1]).max() < 0.002
    shares = measured.mean(axis=0)
    assert (measured > 0.5).all() and abs(shares[1:] - shares[0]).max() < 0.02, "computed through every lens"
    # Shares are stated in percent: over all lenses and walks together less than one percent more limbs are lost than rectified.
    assert lost[:, 1:].mean() - lost[:, 0].mean() < 0.01
