"""Depth edges."""

import numpy as np
import pytest

from voodoo import MeasurementError
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
