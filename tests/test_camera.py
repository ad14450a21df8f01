import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from voodoo.errors import CameraError, VoodooError
from voodoo.model.camera import Camera

PINHOLE = Camera(width=8, height=6, fx=10.0, fy=12.0, cx=3.5, cy=2.5)
LENSES = {
    "plumb_bob": (-0.2, 0.05, 0.001, -0.002, 0.01),
    "rational_polynomial": (0.3, -0.1, 0.001, 0.0005, 0.02, 0.4, -0.05, 0.03),
    "equidistant": (0.02, -0.01, 0.003, -0.001),
}


def lens(model: str, distortion: tuple[float, ...]) -> Camera:
    return Camera(64, 48, 50.0, 51.0, 31.2, 24.1, distortion, model)


def test_project_follows_the_pinhole_equations():
    pixels = PINHOLE.project([[0.0, 0.0, 2.0], [0.2, -0.1, 2.0]])
    np.testing.assert_allclose(pixels, [[3.5, 2.5], [4.5, 1.9]])


def test_project_gives_nan_where_there_is_no_image():
    pixels = PINHOLE.project([[0.0, 0.0, 0.0], [0.0, 0.0, -1.0], [np.nan, 0.0, 1.0], [0.0, 0.0, 1.0]])
    assert np.isnan(pixels[:3]).all() and np.isfinite(pixels[3]).all()


def test_rays_have_pixel_centers_at_integers():
    rays = PINHOLE.rays()
    assert rays.shape == (6, 8, 2) and rays.dtype == np.float32
    np.testing.assert_allclose(rays[0, 0], [-0.35, -2.5 / 12.0], rtol=1e-6)
    with pytest.raises(ValueError):
        rays[0, 0, 0] = 1.0


@pytest.mark.parametrize("model", LENSES)
def test_rays_undo_project_to_every_pixel(model):
    camera = lens(model, LENSES[model])
    rays = camera.rays()
    assert np.isfinite(rays).all()
    points = np.dstack([rays, np.ones((48, 64))]).reshape(-1, 3) * 1.7
    u, v = np.meshgrid(np.arange(64.0), np.arange(48.0))
    np.testing.assert_allclose(camera.project(points), np.stack([u, v], -1).reshape(-1, 2), atol=2e-3)


@pytest.mark.parametrize("model", LENSES)
def test_single_pixels_and_all_of_them_are_inverted_alike(model):
    camera = lens(model, LENSES[model])
    pixels = np.stack(np.meshgrid(np.arange(64.0), np.arange(48.0)), axis=-1).reshape(-1, 2)
    alone = np.concatenate([camera.undistorted(part) for part in np.array_split(pixels, 100)])
    np.testing.assert_array_equal(alone.astype(np.float32), camera.rays().reshape(-1, 2))


def test_equidistant_follows_its_definition():
    """Kannala-Brandt: the radius in the image is f times theta (1 + k1 theta^2 + ...), not f tan(theta)."""
    k1 = 0.02
    camera = Camera(64, 48, 50.0, 50.0, 31.0, 24.0, (k1, 0.0, 0.0, 0.0), "equidistant")
    theta = 0.6
    pixel = camera.project([[np.tan(theta), 0.0, 1.0]])[0]
    np.testing.assert_allclose(pixel, [31.0 + 50.0 * theta * (1.0 + k1 * theta**2), 24.0], atol=1e-9)


def test_plumb_bob_follows_its_definition():
    k1, k2, p1, p2, k3 = LENSES["plumb_bob"]
    x, y = 0.3, -0.2
    r2 = x * x + y * y
    radial = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
    u = 50.0 * (x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)) + 31.2
    v = 51.0 * (y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y) + 24.1
    np.testing.assert_allclose(lens("plumb_bob", LENSES["plumb_bob"]).project([[x, y, 1.0]])[0], [u, v], atol=1e-9)


@settings(max_examples=40, deadline=None)
@given(st.lists(st.floats(-0.6, 0.6), min_size=5, max_size=5))
def test_every_finite_ray_projects_back_however_wild_the_lens(distortion):
    camera = Camera(16, 12, 8.0, 8.0, 7.5, 5.5, tuple(distortion))
    rays = camera.rays().reshape(-1, 2).astype(float)
    finite = np.isfinite(rays).all(axis=1)
    u, v = np.meshgrid(np.arange(16.0), np.arange(12.0))
    pixels = camera.project(np.column_stack([rays[finite], np.ones(finite.sum())]))
    assert np.abs(pixels - np.stack([u, v], -1).reshape(-1, 2)[finite]).max(initial=0.0) < 0.11


def test_zero_distortion_is_no_distortion_and_cameras_compare_by_value():
    zeros = Camera(8, 6, 10, 12, 3.5, 2.5, (0.0,) * 5)
    assert zeros == PINHOLE and hash(zeros) == hash(PINHOLE)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"width": 0}, "width"),
        ({"height": 4.5}, "height"),
        ({"fx": 0.0}, "fx"),
        ({"fy": float("nan")}, "fy"),
        ({"cx": "a"}, "cx"),
        ({"distortion": (1.0, 2.0)}, "0, 4 or 5 coefficients"),
        ({"distortion": (float("inf"), 0, 0, 0)}, "finite"),
        ({"distortion": None}, "distortion: expected numbers, found None"),
        ({"distortion": 0.1}, "distortion: expected numbers, found 0.1"),
        ({"model": "ftheta"}, "plumb_bob, rational_polynomial, equidistant"),
    ],
)
def test_impossible_cameras_are_refused(change, words):
    fields = {"width": 8, "height": 6, "fx": 10.0, "fy": 12.0, "cx": 3.5, "cy": 2.5, **change}
    with pytest.raises(CameraError, match=words) as caught:
        Camera(**fields)
    assert isinstance(caught.value, VoodooError)


def test_points_of_another_shape_are_refused():
    with pytest.raises(CameraError, match=r"\(N, 3\)"):
        PINHOLE.project([1.0, 2.0, 3.0])


class TestCameraInfo:
    k = (10.0, 0, 3.5, 0, 12.0, 2.5, 0, 0, 1)
    p = (9.0, 0, 3.0, 0, 0, 11.0, 2.0, 0, 0, 0, 1, 0)

    def test_raw_images_use_k_and_d(self):
        camera = Camera.from_camera_info(width=8, height=6, k=self.k, d=(0.1, 0, 0, 0, 0), p=self.p)
        assert (camera.fx, camera.cy, camera.distortion) == (10.0, 2.5, (0.1, 0.0, 0.0, 0.0, 0.0))

    def test_rectified_images_use_p(self):
        camera = Camera.from_camera_info(width=8, height=6, k=self.k, d=(0.1, 0, 0, 0, 0), p=self.p, rectified=True)
        assert camera == Camera(8, 6, 9.0, 11.0, 3.0, 2.0)

    def test_an_empty_p_falls_back_to_k(self):
        camera = Camera.from_camera_info(width=8, height=6, k=self.k, p=(0.0,) * 12, rectified=True)
        assert camera == PINHOLE

    @pytest.mark.parametrize("model", ["", "none"])
    def test_no_model_means_no_distortion(self, model):
        assert Camera.from_camera_info(width=8, height=6, k=self.k, d=(0.0,) * 3, model=model) == PINHOLE

    def test_uncalibrated_is_refused(self):
        with pytest.raises(CameraError, match="fx"):
            Camera.from_camera_info(width=8, height=6, k=(0.0,) * 9)

    def test_unknown_model_is_refused(self):
        with pytest.raises(CameraError, match="inverse_brown"):
            Camera.from_camera_info(width=8, height=6, k=self.k, d=(0.1,), model="inverse_brown")

    def test_matrices_may_be_matrices(self):
        """As message types and OpenCV have them."""
        fields = {"width": 8, "height": 6, "k": np.reshape(self.k, (3, 3)), "d": np.array([[0.1, 0, 0, 0, 0]])}
        assert Camera.from_camera_info(**fields).distortion == (0.1, 0.0, 0.0, 0.0, 0.0)
        assert Camera.from_camera_info(**fields, p=np.reshape(self.p, (3, 4)), rectified=True).fx == 9.0

    @pytest.mark.parametrize(
        ("change", "words"),
        [({"k": None}, "k: expected numbers, found None"), ({"k": np.eye(2)}, "k: expected 9 numbers, found 4")],
    )
    def test_what_is_no_matrix_is_refused(self, change, words):
        with pytest.raises(CameraError, match=words):
            Camera.from_camera_info(**({"width": 8, "height": 6, "k": self.k} | change))
