"""voodoo info: what is told of a recording before it is tracked."""

import json

import cv2
import numpy as np
import pytest

from commands import run
from voodoo.recordings import RecordingInfo, sample_path
from voodoo.recordings.first_images import warnings
from voodoo.recordings.left_out import LeftOut
from voodoo.recordings.recording import SensorInfo


@pytest.fixture
def folder(tmp_path):
    """Images of a wall at two meters, and the calibration of a camera of the given size."""

    def written(width, height):
        (tmp_path / "depth").mkdir()
        for index in range(3):
            cv2.imwrite(str(tmp_path / f"depth/{index}.png"), np.full((60, 80), 2000 + index, np.uint16))
        (tmp_path / "calibration.toml").write_text(
            f"width={width}\nheight={height}\nfx=40\nfy=30\ncx={(width - 1) / 2}\ncy={(height - 1) / 2}\n"
        )
        return tmp_path

    return written


def test_the_first_image_of_each_camera_is_opened(folder):
    told = run("info", folder(80, 60)).stdout
    # 2 atan(39.5 / 40) and 2 atan(29.5 / 30)
    line = "80x60, 16-bit unsigned, a unit is 0.0002 m; calibrated for 80x60, field of view 89 x 89 deg"
    assert f"image      depth: {line}" in told
    assert "(a camera, not level: y down, z forward)" in told


def test_another_size_than_calibrated_is_told_with_both(folder):
    path = folder(160, 120)
    told = " ".join(run("info", path).stdout.split())
    assert (
        "left out 3 of another size than calibrated" in told and "expected 160x120 px" in told and "found 80x60" in told
    )
    done = run("track", path, "--out", path.parent / "o.csv")
    assert done.exit_code == 3 and "found none: 3 of another size" in done.stderr, "images are counted once"


def test_the_bundled_recording_as_json():
    told = json.loads(run("info", sample_path(), "--json").stdout)
    assert told["root_frame"] == "base_link" and told["camera_root"] is False and told["frames"] == 90
    assert [image["size"] for image in told["images"]] == [image["calibrated"] for image in told["images"]]
    assert {sensor["kind"] for sensor in told["sensors"]} == {"depth", "scan", "color"}
    assert any("odometry" in note for note in told["notes"])


def test_time_that_goes_backwards_and_lasers_without_odometry_are_doubted(tmp_path):
    def told(root, duration):
        sensor = SensorInfo("/scan", "scan", "laser", 2, 10.0, "scan")
        return warnings(RecordingInfo("a", tmp_path, "ros2", 2, 10.0, duration, 1.0, root, (sensor,)), LeftOut())

    assert told("odom", 1.0) == []
    assert len(told("base_link", 1.0)) == 1 and "/scan" in told("base_link", 1.0)[0]
    assert "the last frame is 4.000 s before the first" in told("odom", -4.0)[0]


def test_focal_lengths_that_no_depth_camera_has_are_doubted(folder):
    path = folder(80, 60)
    assert "focal lengths" not in run("info", path).stdout
    calibration = path / "calibration.toml"
    calibration.write_text(calibration.read_text().replace("fx=40", "fx=525"))
    said = " ".join(run("info", path).stdout.split())
    assert "depth sees 9 x 89 deg by its calibration, and depth cameras 40 to 120: are its focal lengths right?" in said
