"""Weights from standard deviations, and gates around predictions."""

from functools import partial

import numpy as np
import pytest

from voodoo import Camera, MeasurementError
from voodoo.sensors.depth import DepthFilter
from voodoo.sensors.gating import SiteGate
from voodoo.sensors.model import (
    PAPER_WEIGHTS,
    POINTS_SHARING,
    TIME_OF_FLIGHT,
    PixelNoise,
    RangeNoise,
    SensorModel,
    stereo_noise,
)
from voodoo.sensors.pixels import ray_distance, world_rays
from voodoo.sensors.skin.settings import SkinSettings

LENS = Camera(640, 480, 500.0, 510.0, 320.5, 239.0, (-0.2, 0.05, 1e-3, -2e-3, 0.0))
FISHEYE = Camera(640, 480, 300.0, 300.0, 320.0, 240.0, (0.05, -0.01, 0.002, 0.0), "equidistant")


def test_weight_is_the_inverse_variance_relative_to_the_reference():
    model = SensorModel(reference_sigma=0.1, max_weight=1000.0)
    assert model.weight(0.1) == pytest.approx(1.0)
    assert model.weight(0.05) == pytest.approx(4.0)
    assert model.weight(0.05, sharing=4.0) == pytest.approx(1.0)
    np.testing.assert_allclose(model.weight(np.array([0.1, 0.2])), [1.0, 0.25])


def test_weight_is_capped():
    assert SensorModel().weight(1e-6) == SensorModel().max_weight


def test_the_papers_weights_are_centimeters():
    model = SensorModel()
    assert model.sigma(PAPER_WEIGHTS["hand"]) == pytest.approx(0.0224, abs=1e-4)
    assert model.weight(model.sigma(PAPER_WEIGHTS["face"])) == pytest.approx(30.0)
    assert model.weight(TIME_OF_FLIGHT.sigma(3.0), sharing=POINTS_SHARING) == pytest.approx(
        PAPER_WEIGHTS["point"], rel=0.01
    )


def test_stereo_noise_grows_with_the_square_of_the_range():
    noise = stereo_noise(focal=400.0, baseline=0.1, disparity_sigma=0.4)
    assert noise.sigma(1.0) == pytest.approx(0.01)
    assert noise.sigma(3.0) == pytest.approx(0.09)


def test_pixels_become_meters_at_the_depth_of_the_site():
    noise = PixelNoise(pixels=5.0, spread=0.0)
    assert noise.sigma(2.0, 500.0) == pytest.approx(0.02)
    assert noise.sigma(2.0, 500.0, confidence=0.5) == pytest.approx(0.04)
    assert PixelNoise(pixels=5.0, spread=0.02).sigma(2.0, 500.0) == pytest.approx(0.02 * 2**0.5)


@pytest.mark.parametrize("sigma", [0.0, -1.0, float("nan"), float("inf")])
def test_weight_refuses_what_is_no_standard_deviation(sigma):
    with pytest.raises(MeasurementError, match="sigma"):
        SensorModel().weight(sigma)


def test_noise_refuses_nonsense():
    with pytest.raises(MeasurementError, match="above zero"):
        RangeNoise()
    with pytest.raises(MeasurementError, match="baseline"):
        stereo_noise(focal=400.0, baseline=0.0)
    with pytest.raises(MeasurementError, match="depth"):
        PixelNoise().sigma(0.0, 500.0)


@pytest.mark.parametrize(
    ("make", "name"),
    [
        (SensorModel, "reference_sigma"),
        (RangeNoise, "constant"),
        (PixelNoise, "spread"),
        (partial(stereo_noise, focal=400.0), "baseline"),
        (DepthFilter, "nearest"),
        (SkinSettings, "gate"),
    ],
)
@pytest.mark.parametrize("value", ["x", None, [1.0, 2.0]])
def test_what_is_no_number_is_refused_by_name(make, name, value):
    with pytest.raises(MeasurementError, match=f"{name}: expected a .*number.*, found"):
        make(**{name: value})


@pytest.mark.parametrize("camera", [LENS, FISHEYE])
def test_normalized_inverts_the_lens_at_any_subpixel(camera):
    points = np.array([[0.3, -0.2, 2.0], [-0.7, 0.5, 1.9], [0.0, 0.0, 1.0]])
    np.testing.assert_allclose(camera.undistorted(camera.project(points)), points[:, :2] / points[:, 2:], atol=1e-6)


def test_world_rays_pass_through_the_point():
    pose = np.array([[0, 0, 1, 0.5], [-1, 0, 0, 0.2], [0, -1, 0, 1.4], [0, 0, 0, 1.0]])
    point = np.array([3.0, 0.4, 0.9])
    pixel = LENS.project(((point - pose[:3, 3]) @ pose[:3, :3])[None])
    origin, directions = world_rays(LENS, pose, pixel)
    assert ray_distance(origin, directions, point[None])[0] < 1e-5
    assert ray_distance(origin, directions, (2 * origin - point)[None])[0] == pytest.approx(
        np.linalg.norm(point - origin)
    )


def test_gate_opens_while_nothing_passes_and_closes_again():
    gate = SiteGate(radius=0.1, growth=1.0, widest=0.25)
    assert not gate.accepts("l_wrist", 0.15, 0.0, "points")
    assert gate.accepts("l_wrist", 0.15, 0.1, "points")
    assert not gate.accepts("l_wrist", 0.15, 0.11, "points")
    assert gate.limit("l_wrist", "points", 100.0) == 0.25
    assert gate.limit("r_wrist", "points", 0.1) == 0.1  # each site has its own
