"""What lab/experiments/missing_frames.py changes in a frame."""

import numpy as np
import pytest

import voodoo
from lab_scripts import load_experiment
from voodoo.measurements import DepthImage, RecordedFrame


@pytest.mark.parametrize("empty", [False, True])
def test_one_pixel_that_has_a_depth_is_a_millimeter_off(empty):
    missing = load_experiment("missing_frames")
    image = np.full((6, 8), 1500, np.uint16)
    image[2:5, 3:6] = 0
    if empty:
        image[:] = 0
    camera = voodoo.Camera(8, 6, 5.0, 5.0, 3.5, 2.5)
    depth = DepthImage("depth", 0.0, image, 0.001, camera, np.eye(4))
    [frame] = missing.changed(RecordedFrame(0.0, (depth,)), "pixel")
    off = frame.measurements[0].image.astype(int) - image
    assert off.sum() == (0 if empty else 1) and not off[image == 0].any()
    if not empty:
        assert np.abs(np.argwhere(off)[0] - [3, 4]).sum() == 2
