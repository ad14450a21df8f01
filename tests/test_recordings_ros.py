"""ROS bags of every kind the readers claim, written for the purpose, and what is wrong with some."""

import gc
import struct
import zipfile

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

from bag_writer import Messages, write_bag
from voodoo.cli import app
from voodoo.errors import RecordingError
from voodoo.recordings import ColorImage, DepthImage, LaserScan, PointCloud, open_recording

M = Messages()
DEPTH = np.arange(12, dtype=np.uint16).reshape(3, 4) * 300
IDENTITY = (0, 0, 0, 1)
TF = (
    "/tf_static",
    9.9,
    M.tf((9.9, "base_link", "cam", (1, 2, 3), IDENTITY), (9.9, "cam", "laser", (0, 0, 1), IDENTITY)),
)
INFO = ("/d/depth/camera_info", 10.0, M.camera_info(10.0))


def depth_entry(stamp=10.0, data=DEPTH, encoding="16UC1", topic="/d/depth/image", **options):
    return (topic, stamp, M.image(stamp, data, encoding, **options))


def only(recording, kind=DepthImage):
    return [m for frame in recording for m in frame.measurements if isinstance(m, kind)]


def bag(tmp_path, *entries, **options):
    return write_bag(tmp_path / "b", entries, **options)


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
@pytest.mark.parametrize("bare", [False, True])
def test_both_storages_open_as_directory_and_as_file(tmp_path, storage, bare):
    path = bag(tmp_path, TF, INFO, depth_entry(), depth_entry(10.5), storage=storage)
    if bare:
        path = next(p for p in path.iterdir() if p.suffix in (".mcap", ".db3"))
    recording = open_recording(path)
    assert recording.info().loader == "ros2" and len(recording) == 2 and recording.root_frame == "base_link"
    first, second = only(recording)
    np.testing.assert_array_equal(first.image, DEPTH)
    np.testing.assert_allclose(first.root_from_sensor[:3, 3], (1, 2, 3))
    assert (first.stamp, second.stamp, first.metres_per_unit) == (10.0, 10.5, 0.001)


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
@pytest.mark.parametrize("fraction", [0.0, 0.1, 0.3, 0.5, 0.7, 0.9, 0.99])
def test_bags_cut_off_are_refused(tmp_path, storage, fraction):
    entries = [TF, INFO, *(depth_entry(10.0 + k / 10, np.full((3, 4), k, np.uint16)) for k in range(200))]
    path = next(p for p in bag(tmp_path, *entries, storage=storage).iterdir() if p.suffix in (".mcap", ".db3"))
    data = path.read_bytes()
    path.write_bytes(data[: int(fraction * len(data))])
    with pytest.raises(RecordingError, match=path.name):
        list(open_recording(path))


def test_fewer_messages_than_the_index_announces_are_not_taken_for_the_end(tmp_path):
    """The count of the first channel in the MCAP statistics (opcode 0x0B) is raised by one."""
    path = next(bag(tmp_path, depth_entry(), depth_entry(10.5), INFO).glob("*.mcap"))
    data = bytearray(path.read_bytes())
    channels = struct.pack("<IHQHQ", 20, 1, 2, 2, 1)
    at = data.rindex(channels)
    data[at : at + len(channels)] = struct.pack("<IHQHQ", 20, 1, 3, 2, 1)
    path.write_bytes(data)
    frames = iter(open_recording(path))
    assert [next(frames).stamp, next(frames).stamp] == [10.0, 10.5]
    with pytest.raises(RecordingError, match=r"expected 3 messages on /d/depth/image .* found 2"):
        next(frames)


@pytest.mark.parametrize("big", [False, True])
@pytest.mark.parametrize("padding", [0, 6])
@pytest.mark.parametrize("encoding", ["16UC1", "mono16", "32FC1"])
def test_raw_depth_in_any_layout(tmp_path, encoding, padding, big):
    data = DEPTH if encoding != "32FC1" else np.where(DEPTH > 0, DEPTH / 1000, np.nan).astype(np.float32)
    recording = open_recording(
        bag(tmp_path, TF, INFO, depth_entry(data=data, encoding=encoding, padding=padding, big=big))
    )
    (image,) = only(recording)
    np.testing.assert_array_equal(image.image, data)
    assert image.image.dtype == data.dtype and image.image.dtype.isnative
    assert image.metres_per_unit == (1.0 if encoding == "32FC1" else 0.001)


def test_metres_per_unit_can_be_told(tmp_path):
    (image,) = only(open_recording(bag(tmp_path, TF, INFO, depth_entry()), metres_per_unit=0.00025))
    assert image.metres_per_unit == 0.00025


def compressed_depth(data, fmt="16UC1; compressedDepth png", header=b"\0" * 12, stamp=10.0):
    png = cv2.imencode(".png", data)[1].tobytes()
    return ("/d/depth/image/compressedDepth", stamp, M.compressed(stamp, header + png, fmt))


@pytest.mark.parametrize("header", [b"\0" * 12, b""])
def test_compressed_depth(tmp_path, header):
    (image,) = only(open_recording(bag(tmp_path, TF, INFO, compressed_depth(DEPTH, header=header))))
    np.testing.assert_array_equal(image.image, DEPTH)


def test_compressed_float_depth_is_quantized_inverse_depth(tmp_path):
    """compressed_depth_image_transport: q = A / depth + B."""
    a, b = 1000.0, 50.0
    depth = np.array([[1.0, 2.0, 4.0, 0.5]] * 3)
    quantized = np.round(a / depth + b).astype(np.uint16)
    quantized[0, 0] = 0
    header = struct.pack("<iff", 0, a, b)
    entry = compressed_depth(quantized, "32FC1; compressedDepth png", header)
    (image,) = only(open_recording(bag(tmp_path, TF, INFO, entry)))
    assert np.isnan(image.image[0, 0]) and image.metres_per_unit == 1.0 and image.image.dtype == np.float32
    np.testing.assert_allclose(image.image[1:], depth[1:], rtol=1e-3)


def test_the_raw_depth_is_preferred_to_its_compressed_copy(tmp_path):
    recording = open_recording(bag(tmp_path, TF, INFO, depth_entry(), compressed_depth(DEPTH)))
    assert recording.info().sensors[0].name == "/d/depth/image"


PNG = cv2.imencode(".png", np.random.default_rng(1).integers(0, 9000, (3, 4)).astype(np.uint16))[1].tobytes()


@pytest.mark.parametrize("cut", range(0, len(PNG), 3))
def test_a_cut_png_is_refused(tmp_path, cut):
    entry = (
        "/d/depth/image/compressedDepth",
        10.0,
        M.compressed(10.0, b"\0" * 12 + PNG[:cut], "16UC1; compressedDepth"),
    )
    with pytest.raises(RecordingError, match=r"compressedDepth, stamp 10\.0+: expected"):
        list(open_recording(bag(tmp_path, TF, INFO, entry)))


@pytest.mark.parametrize("position", range(0, len(PNG), 2))
def test_a_changed_png_is_refused(tmp_path, position):
    data = bytearray(b"\0" * 12 + PNG)
    data[12 + position] ^= 0x55
    entry = ("/d/depth/image/compressedDepth", 10.0, M.compressed(10.0, bytes(data), "16UC1; compressedDepth"))
    with pytest.raises(RecordingError, match="compressedDepth"):
        list(open_recording(bag(tmp_path, TF, INFO, entry)))


LAYOUTS = {
    "float": (np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4")]), [("x", 0, 7), ("y", 4, 7), ("z", 8, 7)]),
    "mixed": (
        np.dtype([("rgb", "<u4"), ("z", "<f8"), ("gap", "V3"), ("y", "<f4"), ("x", "<i2"), ("end", "V5")]),
        [("rgb", 0, 6), ("z", 4, 8), ("y", 15, 7), ("x", 19, 3)],
    ),
}


@pytest.mark.parametrize("height", [1, 2])
@pytest.mark.parametrize("row_padding", [0, 7])
@pytest.mark.parametrize("layout", LAYOUTS)
def test_clouds_of_any_layout_without_their_nan_rows(tmp_path, layout, row_padding, height):
    dtype, fields = LAYOUTS[layout]
    table = np.zeros(6, dtype)
    table["x"], table["y"], table["z"] = np.arange(6), np.arange(6) / 2, -np.arange(6) / 4
    table["z"][2] = np.nan
    table["y"][4] = np.inf
    message = M.cloud(10.0, table, fields, row_padding=row_padding, height=height)
    recording = open_recording(bag(tmp_path, TF, ("/points", 10.0, message)))
    (cloud,) = only(recording, PointCloud)
    k = np.array([0, 1, 3, 5])
    np.testing.assert_allclose(cloud.points, np.column_stack([k, k / 2, -k / 4]))
    assert cloud.root_from_sensor[2, 3] == 3 and recording.root_frame == "base_link"


def test_a_big_endian_cloud(tmp_path):
    table = np.array([(1, 2, 3)], np.dtype([("x", ">f4"), ("y", ">f4"), ("z", ">f4")]))
    message = M.cloud(10.0, table, LAYOUTS["float"][1], big=True)
    (cloud,) = only(open_recording(bag(tmp_path, TF, ("/points", 10.0, message))), PointCloud)
    np.testing.assert_array_equal(cloud.points, [[1, 2, 3]])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"point_step": 8}, "leaves the point"),
        ({"width": 100}, "100 points"),
        ({"row_step": 4}, "rows of 4"),
        ({"fields": []}, "fields x, y, z"),
    ],
)
def test_clouds_whose_numbers_do_not_fit_are_refused(tmp_path, change, words):
    message = M.cloud(10.0, np.zeros(6, LAYOUTS["float"][0]), LAYOUTS["float"][1])
    vars_ = {name: getattr(message, name) for name in message.__dataclass_fields__ if name != "__msgtype__"}
    changed = type(message)(**{**vars_, **change})
    with pytest.raises(RecordingError, match=words):
        list(open_recording(bag(tmp_path, TF, ("/points", 10.0, changed))))


def test_a_cloud_of_the_depth_camera_is_not_counted_twice(tmp_path):
    cloud = ("/d/points", 10.0, M.cloud(10.0, np.zeros(6, LAYOUTS["float"][0]), LAYOUTS["float"][1]))
    path = bag(tmp_path, TF, INFO, cloud, depth_entry())
    recording = open_recording(path)
    assert not only(recording, PointCloud) and "/d/points" in str(recording.info())
    assert len(only(open_recording(path, points_topic="/d/points"), PointCloud)) == 1


def test_scans_give_valid_points_only(tmp_path):
    scan = ("/scan", 10.0, M.scan(10.0, [1.0, np.inf, 0.05], increment=0.1))
    recording = open_recording(bag(tmp_path, TF, scan))
    (scan,) = only(recording, LaserScan)
    np.testing.assert_allclose(scan.points(), [[np.cos(-0.1), np.sin(-0.1), 0.0]], atol=1e-7)
    np.testing.assert_allclose(scan.root_from_sensor[:3, 3], (1, 2, 4))


def test_without_base_link_the_depth_camera_is_the_root_and_without_it_the_laser(tmp_path):
    path = bag(tmp_path, INFO, depth_entry())
    recording = open_recording(path)
    assert recording.root_frame == "cam"
    np.testing.assert_array_equal(only(recording)[0].root_from_sensor, np.eye(4))
    path = write_bag(tmp_path / "c", [("/scan", 10.0, M.scan(10.0, [1.0]))])
    assert open_recording(path).root_frame == "laser"


@pytest.mark.parametrize("encoding", ["rgb8", "bgr8", "bgra8", "rgba8"])
def test_raw_colour_becomes_bgr(tmp_path, encoding):
    blue, green, red = 10, 20, 30
    pixel = [red, green, blue, 255] if encoding.startswith("rgb") else [blue, green, red, 255]
    data = np.tile(np.array(pixel[: 4 if "a" in encoding else 3], np.uint8), (3, 4, 1))
    entries = [
        TF,
        ("/c/camera_info", 10.0, M.camera_info(10.0)),
        ("/c/image", 10.0, M.image(10.0, data, encoding, padding=1)),
    ]
    (image,) = only(open_recording(bag(tmp_path, *entries)), ColorImage)
    np.testing.assert_array_equal(image.image, np.tile(np.array([10, 20, 30], np.uint8), (3, 4, 1)))


def test_colour_without_calibration_is_left_out_and_said_so(tmp_path):
    jpeg = cv2.imencode(".jpg", np.zeros((3, 4, 3), np.uint8))[1].tobytes()
    path = bag(tmp_path, TF, INFO, ("/c/image/compressed", 10.0, M.compressed(10.0, jpeg, "jpeg")), depth_entry())
    assert "calibration of /c/image/compressed" in str(open_recording(path).info())
    with pytest.raises(RecordingError, match="calibration of /c/image/compressed"):
        open_recording(path, color_topic="/c/image/compressed")


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


class TestTransforms:
    @staticmethod
    def entries(*moves):
        """The sensor at x = value from each stamp on, on /tf."""
        return [("/tf", stamp, M.tf((stamp, "base_link", "cam", (x, 0, 0), IDENTITY))) for stamp, x in moves]

    def x_of(self, path, **options):
        return [m.root_from_sensor[0, 3] for m in only(open_recording(path, **options))]

    def test_one_that_changes_is_interpolated_whenever_it_arrived(self, tmp_path):
        moves = self.entries((9.9, 1.0), (10.1, 2.0), (10.3, 3.0))
        depth = [depth_entry(stamp) for stamp in (9.9, 10.0, 10.1, 10.25, 10.4)]
        np.testing.assert_allclose(self.x_of(bag(tmp_path, INFO, *depth, *moves)), [1.0, 1.5, 2.0, 2.75, 3.0])

    def test_it_turns_evenly_between_two_stamps(self, tmp_path):
        turns = [(10.0, 0.0), (10.2, 0.8)]
        tf = [
            ("/tf", stamp, M.tf((stamp, "base_link", "cam", (0, 0, 1), (0, 0, np.sin(a / 2), np.cos(a / 2)))))
            for stamp, a in turns
        ]
        (image,) = only(open_recording(bag(tmp_path, INFO, depth_entry(10.05), *tf)))
        c, s = np.cos(0.2), np.sin(0.2)
        np.testing.assert_allclose(image.root_from_sensor[:3, :3], [[c, -s, 0], [s, c, 0], [0, 0, 1]], atol=1e-9)

    def test_across_a_gap_the_latest_one_counts(self, tmp_path):
        moves = self.entries((10.0, 1.0), (12.0, 2.0))
        assert self.x_of(bag(tmp_path, INFO, depth_entry(10.4), *moves)) == [1.0]
        with pytest.raises(RecordingError, match="before it"):
            self.x_of(bag(tmp_path / "late", INFO, depth_entry(11.8), *moves))

    @pytest.mark.parametrize(
        ("frame", "far", "root"), [("odom", 0.3, "odom"), ("map", 0.3, "map"), ("odom", 0.01, "base_link")]
    )
    def test_where_the_robot_moves_the_frame_it_moves_in_is_the_root(self, tmp_path, frame, far, root):
        fixed = ("/tf_static", 9.0, M.tf((0, "base_link", "cam", (0, 0, 1), IDENTITY)))
        moves = [("/tf", 10.0 + k, M.tf((10.0 + k, frame, "base_link", (k * far, 0, 0), IDENTITY))) for k in range(2)]
        path = bag(tmp_path, INFO, fixed, depth_entry(10.0), depth_entry(10.5), depth_entry(11.0), *moves)
        recording = open_recording(path)
        assert recording.root_frame == root
        expected = [0.0, far / 2, far] if root == frame else [0.0] * 3
        np.testing.assert_allclose([m.root_from_sensor[0, 3] for m in only(recording)], expected, atol=1e-12)
        assert open_recording(path, root_frame="base_link").root_frame == "base_link"

    def test_one_that_never_changes_holds_always(self, tmp_path):
        moves = self.entries((50.0, 1.0), (51.0, 1.0))
        assert self.x_of(bag(tmp_path, INFO, depth_entry(10.0), *moves)) == [1.0]

    def test_standing_still_before_moving_is_not_taken_for_silence(self, tmp_path):
        moves = self.entries(*((10.0 + k / 10, 1.0) for k in range(20)), (12.0, 2.0))
        assert self.x_of(bag(tmp_path, INFO, depth_entry(11.55), *moves)) == [1.0]

    @pytest.mark.parametrize(("stamp", "words"), [(9.0, "after it"), (11.0, "before it")])
    def test_a_changing_one_may_not_be_far_away(self, tmp_path, stamp, words):
        path = bag(tmp_path, INFO, depth_entry(stamp), *self.entries((10.0, 1.0), (10.1, 2.0)))
        with pytest.raises(RecordingError, match=words + r".*tf_max_age"):
            list(open_recording(path))
        assert len(self.x_of(path, tf_max_age=2.0)) == 1

    def test_chains_are_walked_in_both_directions(self, tmp_path):
        turn = (0, 0, np.sqrt(0.5), np.sqrt(0.5))  # a quarter turn about z
        tf = M.tf((0, "mast", "base_link", (0, 0, -1), IDENTITY), (0, "mast", "cam", (1, 0, 0), turn))
        (image,) = only(open_recording(bag(tmp_path, ("/tf_static", 9.0, tf), INFO, depth_entry())))
        expected = [[0, -1, 0, 1], [1, 0, 0, 0], [0, 0, 1, 1], [0, 0, 0, 1]]
        np.testing.assert_allclose(image.root_from_sensor, expected, atol=1e-12)

    def test_a_missing_one_is_named_with_the_frames_there_are(self, tmp_path):
        tf = M.tf((0, "base_link", "arm", (0, 0, 0), IDENTITY))
        with pytest.raises(RecordingError, match=r"'base_link' from 'cam'.*arm, base_link"):
            open_recording(bag(tmp_path, ("/tf_static", 9.0, tf), INFO, depth_entry()))

    def test_an_unknown_root_frame_is_refused(self, tmp_path):
        with pytest.raises(RecordingError, match=r"'moon' from 'cam'"):
            open_recording(bag(tmp_path, TF, INFO, depth_entry()), root_frame="moon")

    @pytest.mark.parametrize("q", [(0, 0, 0, 0), (0, 0, 0, 2), (np.nan, 0, 0, 1)])
    def test_a_rotation_that_is_none_is_refused(self, tmp_path, q):
        tf = M.tf((0, "base_link", "cam", (0, 0, 0), q))
        with pytest.raises(RecordingError, match="unit quaternion"):
            open_recording(bag(tmp_path, ("/tf_static", 9.0, tf), INFO, depth_entry()))


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


def ros1_bag(tmp_path):
    m1 = Messages(ros=1)
    entries = [
        ("/tf", 9.9, m1.tf((9.9, "/base_link", "/cam", (1, 2, 3), IDENTITY))),
        ("/d/depth/camera_info", 10.0, m1.camera_info(10.0, frame="/cam", d=(0.1, 0, 0, 0, 0))),
        *(("/d/depth/image", 10.0 + k, m1.image(10.0 + k, DEPTH, "16UC1", frame="/cam")) for k in range(5)),
    ]
    return write_bag(tmp_path / "b.bag", entries, ros=1)


def test_ros1_bags_open_plain_zipped_and_in_a_folder(tmp_path):
    path = ros1_bag(tmp_path)
    with zipfile.ZipFile(tmp_path / "b.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.write(path, "some/folder/b.bag")
    for place in (path, tmp_path / "b.zip", tmp_path):
        recording = open_recording(place)
        assert recording.info().loader == "ros1" and len(recording) == 5 and recording.root_frame == "base_link"
        images = only(recording)
        assert [m.stamp for m in images] == [10.0, 11.0, 12.0, 13.0, 14.0]
        assert images[0].camera.distortion == (0.1, 0, 0, 0, 0)
        np.testing.assert_array_equal(images[4].image, DEPTH)


@pytest.mark.parametrize("fraction", np.linspace(0.0, 0.999, 12).round(3))
@pytest.mark.parametrize("zipped", [False, True])
def test_cut_ros1_bags_and_zips_are_refused(tmp_path, fraction, zipped):
    path = ros1_bag(tmp_path)
    if zipped:
        with zipfile.ZipFile(tmp_path / "b.zip", "w", zipfile.ZIP_DEFLATED) as archive:
            archive.write(path, "b.bag")
        path = tmp_path / "b.zip"
    data = path.read_bytes()
    path.write_bytes(data[: int(fraction * len(data))])
    with pytest.raises(RecordingError, match=path.name):
        list(open_recording(path))


@pytest.mark.parametrize("seed", range(40))
def test_a_changed_byte_in_a_ros1_bag_never_ends_in_a_raw_error(tmp_path, seed):
    """The format has no checksums: a changed pixel goes unseen, but structure must not fail in odd ways."""
    path = ros1_bag(tmp_path)
    data = bytearray(path.read_bytes())
    rng = np.random.default_rng(seed)
    body = [k for k in range(len(data)) if data[k] != 0x20]  # the header is padded with blanks
    data[body[int(rng.integers(len(body)))]] ^= int(rng.integers(1, 256))
    path.write_bytes(data)
    try:
        assert len(list(open_recording(path))) == 5
    except RecordingError as error:
        assert "b.bag" in str(error)


def test_what_was_unpacked_goes_with_the_recording(tmp_path, monkeypatch):
    path = ros1_bag(tmp_path)
    with zipfile.ZipFile(tmp_path / "b.zip", "w") as archive:
        archive.write(path, "b.bag")
    place = tmp_path / "temporary"
    place.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(place))
    recording = open_recording(tmp_path / "b.zip")
    assert len(list(place.iterdir())) == 1
    del recording
    gc.collect()
    assert not list(place.iterdir())


def test_a_zip_without_a_bag_is_refused(tmp_path):
    with zipfile.ZipFile(tmp_path / "b.zip", "w") as archive:
        archive.writestr("readme.txt", "nothing")
    with pytest.raises(RecordingError, match=r"b\.zip: found no loader"):
        open_recording(tmp_path / "b.zip")
