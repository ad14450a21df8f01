"""voodoo info: what is told of a recording before it is tracked."""

import json
import math

import cv2
import numpy as np
import pytest

from commands import run
from voodoo.batch.task import Job, Settings, _track
from voodoo.recordings import RecordingInfo, sample_path
from voodoo.recordings.first_images import FirstFrames, doubts, warnings
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
            f"width={width}\nheight={height}\nfx=40\nfy=40\ncx={(width - 1) / 2}\ncy={(height - 1) / 2}\n"
        )
        return tmp_path

    return written


def test_the_first_image_of_each_camera_is_opened(folder):
    told = run("info", folder(80, 60)).stdout
    # 2 atan(39.5 / 40) and 2 atan(29.5 / 40)
    line = "80x60, 16-bit unsigned, a unit is 0.0002 m; calibrated for 80x60, field of view 89 x 73 deg"
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
    assert "depth sees 9 x 73 deg by its calibration, and depth cameras 40 to 120: are its focal lengths right?" in said


@pytest.mark.parametrize(
    ("interval", "words"),
    [
        (0.033, None),
        (1.0, None),
        (math.nan, None),
        (33.4, "milliseconds"),
        (33367.0, "microseconds"),
        (1e-5, "seconds"),
    ],
)
def test_rates_that_no_recording_has_are_doubted(interval, words):
    found = doubts(FirstFrames(interval=interval))
    assert len(found) == (words is not None) and all(f"are the stamps in {words}?" in one for one in found)


def test_stamps_of_a_wrong_unit_are_told_by_every_command(folder):
    path = folder(80, 60)
    for index in range(3):
        (path / f"depth/{index}.png").rename(path / f"depth/{1000.0 + 33.4 * index:.1f}.png")
    words = "frames are 33.4 s apart: are the stamps in milliseconds? (--option seconds_per_unit=0.001 of a folder of images)"
    assert f"note       {words}" in run("info", path).stdout
    assert words in run("track", path, "--out", path.parent / "o.csv").stderr
    right = run("track", path, "--option", "seconds_per_unit=0.001", "--out", path.parent / "o.csv")
    assert "apart" not in right.stderr
    row, _ = _track(Job("a", str(path), str(path.parent), Settings()), path)
    assert row.doubts == words
    said = run("live", path, "--rate", 1000, "--duration", 0.1).stderr
    assert f"{path.name}: {words}" in " ".join(said.split())


@pytest.mark.parametrize(("fy", "words"), [(37, ""), (30, "of 40 and 30 px"), (53, "of 40 and 53 px")])
def test_a_depth_camera_whose_pixels_are_not_square_is_doubted(folder, fy, words):
    path = folder(80, 60)
    (path / "calibration.toml").write_text((path / "calibration.toml").read_text().replace("fy=40", f"fy={fy}"))
    for said in (run("info", path).stdout, run("track", path, "--out", path.parent / "o.csv").stderr):
        said = " ".join(said.split())
        assert f"depth has focal lengths {words}" in said if words else "focal" not in said
