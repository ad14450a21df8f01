"""A depth camera's points in the picture of a camera beside it: the compiled functions against plain NumPy and OpenCV."""

import math

import cv2
import numpy as np
import pytest

from voodoo import Camera, MeasurementError, _core
from voodoo.sensors.body_view import BodyView, body_view


def far_side(nearest):
    """A line on the far side of edges between surfaces, filled and eroded by OpenCV."""
    unknown = np.isinf(nearest)
    _, labels = cv2.distanceTransformWithLabels(
        unknown.view(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_3, labelType=cv2.DIST_LABEL_PIXEL
    )
    z = np.concatenate([np.zeros(1, np.float32), nearest[~unknown]]).take(labels)
    return z > cv2.erode(z, np.ones((3, 3), np.uint8)) + 0.1


@pytest.mark.parametrize("seed", range(40))
def test_the_mask_of_the_body_is_what_opencv_makes_of_its_points(seed):
    chance = np.random.default_rng(seed)
    height, width, every = (int(number) for number in chance.integers((12, 12, 1), (50, 70, 4)))
    wide = Camera(width, height, 0.6 * width, 0.6 * width, (width - 1) / 2, (height - 1) / 2)
    scale = chance.uniform(0.5, 2.5)
    # Its picture lies within the depth image, so that nothing is beyond.
    shape = round(0.4 * height * scale), round(0.4 * width * scale)
    focal = 0.6 * width * scale
    narrow = Camera(shape[1], shape[0], focal, focal, (shape[1] - 1) / 2, (shape[0] - 1) / 2)
    beside = np.eye(4)
    beside[:3, 3] = chance.uniform(-0.02, 0.02, 3)
    depth = chance.choice([1.0, 1.05, 1.5, 2.3], (height, width)) + chance.normal(0.0, 0.02, (height, width))
    depth[chance.random((height, width)) < chance.uniform(0.2, 0.99)] = 0.0
    depth[0, 0] = 1.0
    view = body_view(
        depth.astype(np.float32),
        depth_camera=wide,
        world_from_depth=np.eye(4),
        metres_per_unit=1.0,
        color_camera=narrow,
        world_from_color=beside,
        joints=[[0.0, 0.0, 1.5]],
        margin=9.0,
        step=every,
    )
    rows, columns = np.nonzero(depth[::every, ::every])
    z = depth.astype(np.float32)[::every, ::every][rows, columns].astype(float)
    expected = np.column_stack([wide.rays()[::every, ::every][rows, columns] * z[:, None], z]) - beside[:3, 3]
    pixels = narrow.project(expected)
    inside = ((np.rint(pixels) >= 0.0) & (np.rint(pixels) < (narrow.width, narrow.height))).all(axis=1)
    np.testing.assert_allclose(view.pixels, pixels[inside], atol=1e-4)
    np.testing.assert_allclose(view.depths, expected[inside, 2], atol=1e-6)

    nearest = np.full(shape, np.inf, np.float32)
    u, v = np.rint(view.pixels).astype(int).T
    np.minimum.at(nearest, (v, u), view.depths.astype(np.float32))
    reach = math.ceil(1.5 * every * narrow.fx / wide.fx)
    around = np.ones((2 * reach + 1, 2 * reach + 1), np.uint8)
    seen = np.isfinite(nearest)
    grown = cv2.dilate(seen.view(np.uint8), around).view(bool)
    edges = np.zeros_like(grown)
    if seen.any():
        window = tuple(slice(places.min(), places.max() + 1) for places in np.nonzero(seen))
        edges[window] = far_side(nearest[window].copy())
    np.testing.assert_array_equal(view.mask, grown & ~edges)


def test_the_nearest_surface_around_a_place():
    chance = np.random.default_rng(5)
    pixels = chance.uniform(0.0, 40.0, (600, 2))
    depths = np.where(pixels[:, 0] < 20.0, 2.0, 3.0) + chance.normal(0.0, 0.01, 600)
    there = np.sort(depths[np.hypot(*(pixels - (20.0, 20.0)).T) < 8.0])
    surface = there[np.abs(there - there[(len(there) - 1) // 5]) < 0.1]
    found = _core.nearest_surface(pixels, depths, pixel=(20.0, 20.0), radius=8.0)
    assert found == surface[len(surface) // 2]
    assert _core.nearest_surface(pixels, depths, pixel=(90.0, 20.0), radius=8.0) is None


def test_arrays_that_do_not_belong_together_are_refused():
    pixels = np.zeros((4, 2))
    with pytest.raises(MeasurementError, match="depths: expected"):
        _core.nearest_surface(pixels, np.zeros(3), pixel=(0.0, 0.0), radius=1.0)
    with pytest.raises(MeasurementError, match=r"pixels: expected shape \(N, 2\), found \(4, 3\)"):
        _core.nearest_surface(np.zeros((4, 3)), np.zeros(4), pixel=(0.0, 0.0), radius=1.0)
    with pytest.raises(MeasurementError, match="pixels: expected"):
        BodyView(np.ones((41, 41), bool), pixels, np.zeros(3))
