"""Which topics, frames and calibrations of a ROS bag are used, and what is wrong with some."""

import numpy as np
import pytest
from typer.testing import CliRunner

from bag_writer import write_bag
from ros_bags import DEPTH, INFO, TF, M, bag, compressed_depth, depth_entry, only
from voodoo.cli import app
from voodoo.errors import RecordingError
from voodoo.recordings import open_recording


def test_without_base_link_the_depth_camera_is_the_root_and_without_it_the_laser(tmp_path):
    path = bag(tmp_path, INFO, depth_entry())
    recording = open_recording(path)
    assert recording.root_frame == "cam"
    np.testing.assert_array_equal(only(recording)[0].root_from_sensor, np.eye(4))
    path = write_bag(tmp_path / "c", [("/scan", 10.0, M.scan(10.0, [1.0]))])
    assert open_recording(path).root_frame == "laser"


def test_several_depth_topics_need_a_choice_and_may_all_be_chosen(tmp_path):
    other = depth_entry(10.2, topic="/e/depth/image")
    path = bag(tmp_path, TF, INFO, ("/e/depth/camera_info", 10.0, M.camera_info(10.0)), other, depth_entry(10.3))
    with pytest.raises(RecordingError, match=r"/d/depth/image, /e/depth/image.*depth_topic="):
        open_recording(path)
    assert len(open_recording(path, depth_topic="/e/depth/image")) == 1
    (frame,) = open_recording(path, depth_topic=["/d/depth/image", "/e/depth/image"])
    assert [m.sensor for m in frame.measurements] == ["/e/depth/image", "/d/depth/image"] and frame.stamp == 10.3


def test_the_command_line_chooses_topics_too(tmp_path):
    def info(*options):
        return CliRunner().invoke(app, ["info", str(path), *options], env={"COLUMNS": "200"})

    info_of_e = ("/e/depth/camera_info", 10.0, M.camera_info(10.0))
    path = bag(tmp_path, TF, INFO, info_of_e, depth_entry(10.2, topic="/e/depth/image"), depth_entry(10.3))
    assert "--topic depth=NAME" in info().stderr
    both = info("--topic", "depth=/d/depth/image", "--topic", "depth=/e/depth/image")
    assert both.exit_code == 0 and "/d/depth/image" in both.stdout and "/e/depth/image" in both.stdout
    one = info("--topic", "depth=/e/depth/image", "--topic", "camera_info=/d/depth/camera_info")
    assert one.exit_code == 0 and "/d/depth/image" not in one.stdout
    for wrong in ("depth", "depth=", "sonar=/e"):
        assert f"expected KIND=NAME with one of depth, points, scan, color, camera_info, found '{wrong}'" in (
            info("--topic", wrong).stderr
        )
    assert "expected one camera_info" in info("--topic", "camera_info=/a", "--topic", "camera_info=/b").stderr


@pytest.mark.parametrize(
    ("entries", "words"),
    [
        ([TF, depth_entry()], r"calibration of /d/depth/image .*/d/depth/camera_info.*none"),
        ([TF, INFO, depth_entry(encoding="8UC2")], "16UC1, mono16, 32FC1, found .*8UC2"),
        ([TF, INFO, depth_entry(cut=1)], "expected 3 rows of 8 bytes"),
        ([TF, INFO, depth_entry(step=7)], "rows of 7"),
        ([TF, INFO, depth_entry(data=DEPTH[:2])], "expected 4x3 px as calibrated, found 4x2"),
        (
            [TF, INFO, depth_entry(10.5), ("/d/depth/image", 10.6, depth_entry(10.4)[2])],
            r"rising stamps, found 10\.4\d* after 10\.5",
        ),
        ([TF, INFO, (*depth_entry()[:1], 10.0, M.image(0.0, DEPTH, "16UC1"))], "header stamp, found zero"),
        ([TF, INFO, depth_entry(), depth_entry(10.1, encoding="rgb8")], "depth encoding"),
        ([TF, ("/d/depth/camera_info", 10.0, M.camera_info(10.0, f=0.0)), depth_entry()], "camera_info: camera fx"),
        ([TF, ("/d/depth/camera_info", 10.0, M.camera_info(10.0, binning=2)), depth_entry()], "binning"),
        ([TF, ("/d/depth/camera_info", 10.0, M.camera_info(10.0, model="odd", d=(1,))), depth_entry()], "odd"),
        ([TF, INFO, depth_entry(), ("/d/depth/camera_info", 10.5, M.camera_info(10.5, f=6.0))], "one calibration"),
        ([TF, INFO, compressed_depth(DEPTH.astype(np.uint8))], "16-bit single-channel PNG"),
        ([TF, INFO, compressed_depth(DEPTH, "16UC1; compressedDepth rvl")], "expected 4x3 px as calibrated, found"),
        ([TF, INFO, compressed_depth(DEPTH, "32FC1; compressedDepth png")], "quantization"),
        ([TF, ("/scan", 10.0, M.scan(10.0, [1.0], increment=0.0))], "increment"),
        ([TF, ("/scan", 10.0, M.scan(10.0, [1.0] * 100, increment=0.1))], "one turn"),
        ([TF], "expected topics for depth, points, scan, color, found /tf_static"),
    ],
)
def test_what_is_wrong_is_named(tmp_path, entries, words):
    with pytest.raises(RecordingError, match=words) as caught:
        list(open_recording(bag(tmp_path, *entries)))
    assert str(tmp_path / "b") in str(caught.value)


@pytest.mark.parametrize(
    "option", [{"depth_topic": "/nothing"}, {"depth_topic": "/tf_static"}, {"scan_topic": "/scan"}]
)
def test_a_topic_that_is_not_there_is_named_with_those_that_are(tmp_path, option):
    with pytest.raises(RecordingError, match=r"_topic '/.*': expected one of (/d/depth/image|none)"):
        open_recording(bag(tmp_path, TF, INFO, depth_entry()), **option)


def test_the_calibration_may_come_from_elsewhere(tmp_path):
    path = bag(tmp_path, TF, ("/factory/info", 10.0, M.camera_info(10.0, f=7.0)), depth_entry())
    with pytest.raises(RecordingError, match="camera_info_topic="):
        open_recording(path)
    (image,) = only(open_recording(path, camera_info_topic="/factory/info"))
    assert image.camera.fx == 7.0
