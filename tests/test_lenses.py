"""Depth cameras whose lenses distort: the projections against OpenCV's, and a person followed as through a pinhole."""

import pickle

import cv2
import numpy as np
import pytest

import voodoo
from voodoo.errors import CameraError
from voodoo.evaluation.metrics import JOINTS
from voodoo.synthetic.gait import path
from voodoo.synthetic.room_walk import Walk
from voodoo.synthetic.through_lens import _sources

AZURE = (
    0.5479397774,
    -0.0209713709,
    2.0557534e-5,
    -7.2104158e-5,
    -0.0026522316,
    0.8896790743,
    0.0861302093,
    -0.0139103848,
)
LENSES = {
    "none": ("plumb_bob", ()),
    "plumb_bob": ("plumb_bob", (-0.24, 0.06, 0.0008, -0.0006, -0.006)),
    "four": ("plumb_bob", (-0.24, 0.06, 0.0008, -0.0006)),
    "pincushion": ("plumb_bob", (0.12, -0.03, 0.001, 0.002, 0.004)),
    "azure": ("rational_polynomial", AZURE),
    "prism": ("rational_polynomial", (*AZURE, 0.002, -0.001, 0.0015, 0.0005)),
    "tilted": ("rational_polynomial", (*AZURE, 0.002, -0.001, 0.0015, 0.0005, 0.03, -0.02)),
    "fisheye": ("equidistant", (0.02, -0.01, 0.003, -0.001)),
    "equidistant": ("equidistant", ()),
}


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


def followed(camera):
    """Mean joint error [m], and share of limbs called lost, of a person who walks up to 40 degrees off the axis."""
    body = voodoo.Body.human(height=1.78)
    stops = path([(0.0, 2.1, 0.4), (0.7, 1.9, 1.2)])
    walk, tracker, errors, lost = Walk(body=body, stops=stops, camera=camera), voodoo.Tracker(body), [], []
    for frame in walk:
        if not errors:
            tracker.reset(joints=frame.joints)
        estimate = tracker.step(walk.measurement(frame))
        errors += [np.linalg.norm(estimate.joints[name] - frame.joints[name]) for name in JOINTS]
        lost += [status == "lost" for status in estimate.limb_status.values()]
    return np.mean(errors), np.mean(lost)


@pytest.fixture(scope="module")
def rectified():
    return followed(as_wide("none"))


@pytest.mark.parametrize("name", ["plumb_bob", "azure", "fisheye"])
def test_a_person_is_followed_through_a_lens_as_through_a_pinhole(rectified, name):
    error, lost = followed(as_wide(name))
    assert abs(error - rectified[0]) < 0.002
    # One limb in one frame of three: the neck, which the chin hides now and then.
    assert abs(lost - rectified[1]) < 0.02
    assert rectified[0] < 0.02


def test_an_image_visible_through_a_lens_shows_every_ray_what_lay_there():
    straight, bent = through("none"), through("fisheye")
    index = _sources(straight, bent)
    known = index >= 0
    rows, columns = np.divmod(index[known], straight.width)
    off = straight.rays()[rows, columns] - bent.rays()[known]
    assert np.abs(off * (straight.fx, straight.fy)).max() < 0.51
    # Unknown is what the straight camera does not see.
    beyond = np.abs(straight.project(np.dstack([bent.rays(), np.ones_like(known)])[~known]) - (159.5, 119.5))
    assert 0.5 < known.mean() < 1.0 and (beyond > (159.9, 119.9)).any(axis=1).all()
