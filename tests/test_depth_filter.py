"""Depth edges, the body in a picture beside the depth camera, and what stands before the still scene."""

from dataclasses import replace

import numpy as np
import pytest

from skin_scene import CAMERA, POSE, Z, at
from voodoo import Camera, MeasurementError
from voodoo.sensors.body_view import body_view
from voodoo.sensors.depth import DepthFilter


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
        meters_per_unit=1.0,
        color_camera=CAMERA,
        world_from_color=POSE,
        joints=joints,
    )
    mask = view.mask
    near = np.hypot(*(view.pixels - (140.0, 120.0)).T) < 8.0
    assert near.sum() > 20
    np.testing.assert_allclose(view.depths[near], Z)
    assert mask.shape == (240, 320)
    assert mask[62:178, 122:158].all()
    assert not mask[:, :110].any() and not mask[:, 175:].any()


def test_lenses_that_distort_show_the_same_body():
    """By the functions of the camera model, not by the core's pinhole."""
    straight = Camera(160, 120, 150.0, 150.0, 79.5, 59.5)
    depth = np.full((120, 160), 4.5, np.float32)
    depth[30:90, 60:80] = Z
    found = []
    for bend in ((), (1e-7, 0.0, 0.0, 0.0)):
        view = body_view(
            depth,
            depth_camera=replace(straight, distortion=bend),
            world_from_depth=POSE,
            meters_per_unit=1.0,
            color_camera=replace(CAMERA, distortion=bend),
            world_from_color=POSE,
            joints=[at((120, 60)), at((160, 180)), at((140, 120))],
        )
        found.append(view)
    assert len(found[0].pixels) == 1200
    np.testing.assert_allclose(found[1].pixels, found[0].pixels, atol=1e-3)
    np.testing.assert_array_equal(found[1].mask, found[0].mask)
