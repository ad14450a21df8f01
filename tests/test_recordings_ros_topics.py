"""Which topics, frames and calibrations of a ROS bag are used, and what is wrong with some."""

import cv2
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


def png_of(image, suffix=".png"):
    return cv2.imencode(suffix, image)[1].tobytes()


@pytest.mark.parametrize("topic", ["/oak/stereo/image_raw", "/distance/image", "/mirror/image_raw"])
@pytest.mark.parametrize(
    "encoding", ["16UC1", "mono16", "32FC1", "16UC1; png compressed ", "mono16; png compressed", "png"]
)
def test_depth_is_what_its_encoding_says_whatever_the_topic(tmp_path, topic, encoding):
    data = DEPTH.astype(np.float32) if encoding == "32FC1" else DEPTH
    entry = depth_entry(10.2, data, encoding, topic)
    if "png" in encoding:
        entry = (f"{topic}/compressed", 10.2, M.compressed(10.2, png_of(DEPTH), encoding))
    info = (topic.rsplit("/", 1)[0] + "/camera_info", 10.0, M.camera_info(10.0))
    (image,) = only(open_recording(bag(tmp_path, TF, info, entry)))
    np.testing.assert_array_equal(image.image, data)


@pytest.mark.parametrize("name", ["infra1/image", "ir/image", "stereo/disparity", "stereo/confidence", "left_ir/image"])
def test_images_named_as_something_else_are_no_depth_unless_the_user_says_so(tmp_path, name):
    info = (f"/{name.rsplit('/', 1)[0]}/camera_info", 10.0, M.camera_info(10.0))
    path = bag(tmp_path, TF, info, INFO, depth_entry(10.1), depth_entry(10.2, encoding="mono16", topic=f"/{name}"))
    assert [one.sensor for one in only(open_recording(path))] == ["/d/depth/image"]
    assert [one.sensor for one in only(open_recording(path, depth_topic=f"/{name}"))] == [f"/{name}"]


def test_of_depth_as_jpeg_it_is_said_that_the_distances_are_gone(tmp_path):
    jpeg = png_of((DEPTH // 20).astype(np.uint8), ".jpg")
    lossy = ("/d/depth/image/compressed", 10.2, M.compressed(10.2, jpeg, "16UC1; jpeg compressed "))
    with pytest.raises(RecordingError, match=r"JPEG, in which the distances are lost; record .*compressedDepth"):
        open_recording(bag(tmp_path, TF, INFO, lossy))
    with pytest.raises(RecordingError, match="distances are lost"):
        list(open_recording(write_bag(tmp_path / "chosen", [TF, INFO, lossy]), depth_topic=lossy[0]))
    scan = ("/scan", 10.2, M.scan(10.2, [1.0]))
    recording = open_recording(write_bag(tmp_path / "other", [TF, INFO, lossy, scan]))
    assert [sensor.name for sensor in recording.info().sensors] == ["/scan"]
    assert any("distances are lost" in why for _, why in recording.info().unused)


def test_a_topic_chosen_for_a_kind_is_guessed_for_no_other(tmp_path):
    entry = ("/d/depth/image/compressed", 10.2, M.compressed(10.2, png_of(DEPTH), "png"))
    (image,) = only(open_recording(bag(tmp_path, TF, INFO, entry), depth_topic=entry[0]))
    np.testing.assert_array_equal(image.image, DEPTH)
    gray = depth_entry(10.2, (DEPTH // 20).astype(np.uint8), "mono8", "/d/left/image")
    other = ("/d/left/camera_info", 10.0, M.camera_info(10.0))
    path = write_bag(tmp_path / "c", [TF, INFO, other, depth_entry(10.2), gray])
    with pytest.raises(RecordingError, match="depth encoding"):
        list(open_recording(path, depth_topic="/d/left/image"))  # and not the depth that would be guessed


@pytest.mark.parametrize("command", ["track", "info", "init", "ik", "live", "eval", "batch"])
def test_every_command_that_reads_a_recording_has_its_options(tmp_path, command):
    if command == "batch":
        pytest.importorskip("distributed")
    path = bag(tmp_path, TF, INFO, depth_entry(10.2))
    how = {"track": ["--out", "x.csv"], "batch": ["--out", str(tmp_path / "o"), "--workers", "1"]}.get(command, [])
    options = ["--topic", "depth=/nowhere", "--option", "meters_per_unit=0.001", "--frame", "cam"]
    found = CliRunner().invoke(app, [command, str(path), *options, *how], env={"COLUMNS": "200"})
    assert found.exit_code == 1 and "depth_topic '/nowhere': expected one of /d/depth/image" in found.output
