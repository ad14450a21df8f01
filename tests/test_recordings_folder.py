"""Folders of images with a calibration file."""

import json

import cv2
import numpy as np
import pytest

import voodoo
from voodoo.errors import RecordingError
from voodoo.pipeline.start import Init
from voodoo.recordings import ColorImage, DepthImage, open_recording

CALIBRATION = """\
width = 4
height = 3
fx = 5.0
fy = 5.5
cx = 1.5
cy = 1.0
"""
COLOR = "[color]\nwidth = 8\nheight = 6\nfx = 10.0\nfy = 11.0\ncx = 3.5\ncy = 2.5\n"
MOUNT = "root_from_sensor = [[0, 0, 1, 0.1], [-1, 0, 0, 0], [0, -1, 0, 1.2], [0, 0, 0, 1]]\n"
STAMPS = ("1305031102.160407", "1305031102.194330", "1305031103.5")


@pytest.fixture
def folder(tmp_path):
    rng = np.random.default_rng(3)
    (tmp_path / "depth").mkdir()
    for index, stamp in enumerate(STAMPS):
        image = rng.integers(1, 20000, (3, 4)).astype(np.uint16)
        image[0, 0] = index
        cv2.imwrite(str(tmp_path / "depth" / f"{stamp}.png"), image)
    (tmp_path / "groundtruth.txt").write_text("# not used\n")
    (tmp_path / "calibration.toml").write_text(CALIBRATION)
    return tmp_path


def add_color(folder, names=("1305031102.1", "1305031102.2", "1305031102.3", "1305031109.0")):
    (folder / "rgb").mkdir()
    for name in names:
        cv2.imwrite(str(folder / "rgb" / f"{name}.png"), np.full((6, 8, 3), 7, np.uint8))
    (folder / "calibration.toml").write_text(CALIBRATION + COLOR)


def test_depth_images_in_the_order_of_their_names(folder):
    recording = open_recording(folder)
    frames = list(recording)
    assert [frame.stamp for frame in frames] == [float(stamp) for stamp in STAMPS]
    assert [frame.measurements[0].image[0, 0] for frame in frames] == [0, 1, 2]
    depth = frames[0].measurements[0]
    assert isinstance(depth, DepthImage) and depth.meters_per_unit == 1 / 5000 and depth.camera.fy == 5.5
    np.testing.assert_array_equal(depth.root_from_sensor, np.eye(4))
    assert recording.root_frame == "camera_depth_optical_frame"
    assert recording.start is None and recording.reference is None
    info = recording.info()
    assert (info.loader, info.frames) == ("folder", 3) and info.duration == pytest.approx(1.339593)


def test_a_root_frame_that_is_a_camera_is_said(folder):
    assert open_recording(folder).info().camera_root
    assert "(a camera, not level: y down, z forward)" in str(open_recording(folder).info())
    pose = "[[0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 1.2], [0, 0, 0, 1]]"
    for root in ("", 'root_frame = "base_link"\n'):
        (folder / "calibration.toml").write_text(f"{root}root_from_sensor = {pose}\n{CALIBRATION}")
        assert not open_recording(folder).info().camera_root


def test_the_list_file_counts_before_the_names(folder):
    (folder / "depth.txt").write_text(f"# timestamp filename\n1.0 depth/{STAMPS[2]}.png\n\n2.0 depth/{STAMPS[0]}.png\n")
    frames = list(open_recording(folder))
    assert [(frame.stamp, frame.measurements[0].image[0, 0]) for frame in frames] == [(1.0, 2), (2.0, 0)]


def test_color_joins_the_next_depth_image(folder):
    add_color(folder)
    recording = open_recording(folder)
    kinds = [[m.stamp for m in frame.measurements if isinstance(m, ColorImage)] for frame in recording]
    assert kinds == [[1305031102.1], [], [1305031102.2, 1305031102.3]]
    color = next(iter(recording)).measurements[0]
    assert color.image.shape == (6, 8, 3) and color.camera.fx == 10.0
    assert [sensor.kind for sensor in recording.info().sensors] == ["depth", "color"]


def test_color_without_calibration_is_left_out_and_reported_so(folder):
    add_color(folder)
    (folder / "calibration.toml").write_text(CALIBRATION)
    assert "no [color] table" in str(open_recording(folder).info())


@pytest.mark.parametrize("digits", [3, 4, 9])
def test_a_rotation_typed_with_few_digits_is_made_one(folder, digits):
    """The file was read and every frame refused."""
    pose = np.eye(4)
    pose[:3, :3], _ = cv2.Rodrigues(np.array([0.4, -1.2, 0.9]))
    typed = np.round(pose, digits)
    (folder / "calibration.toml").write_text(f"{CALIBRATION}root_from_sensor = {typed.tolist()}\n")
    depth = next(iter(open_recording(folder))).measurements[0]
    voodoo.Frame(stamp=0.0).add_depth(depth.image, camera=depth.camera, world_from_sensor=depth.root_from_sensor)
    np.testing.assert_allclose(depth.root_from_sensor, pose, atol=10.0**-digits)


def test_the_calibration_file_reports_where_the_camera_is(folder):
    (folder / "calibration.toml").write_text(CALIBRATION + MOUNT + 'root_frame = "base_link"\ndepth_factor = 1000\n')
    recording = open_recording(folder)
    depth = next(iter(recording)).measurements[0]
    np.testing.assert_array_equal(depth.root_from_sensor @ [0, 0, 2, 1], [2.1, 0, 1.2, 1])
    assert recording.root_frame == "base_link" and depth.meters_per_unit == 0.001


def test_the_calibration_file_may_lie_elsewhere(folder):
    (folder / "calibration.toml").rename(folder / "mine.toml")
    assert len(open_recording(folder, calibration=folder / "mine.toml")) == 3


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "width: expected an entry, found none.*cy: "),
        (CALIBRATION + "fxx = 1\n", "fxx: unknown key; known are width, .* outside .color. depth_factor"),
        (CALIBRATION.replace("5.0", '"five"'), "fx: expected a number"),
        (CALIBRATION.replace("5.0", "-5.0"), "focal lengths above zero"),
        (CALIBRATION + "distortion = 0.1\n", "list of numbers"),
        (CALIBRATION + "distortion = [0.1]\n", "0, 4 or 5"),
        (CALIBRATION + 'model = "x"\n', "plumb_bob"),
        (CALIBRATION + "depth_factor = 0\n", "depth_factor"),
        (CALIBRATION + "root_frame = 1\n", "root_frame"),
        (CALIBRATION + MOUNT.replace("1.2", '"a"'), "root_from_sensor"),
        (CALIBRATION + MOUNT.replace("-1, 0, 0, 0", "1, 0, 0, 0"), "rigid"),
        (CALIBRATION + MOUNT.replace("[0, 0, 0, 1]", "[0, 0, 0, 2]"), "rigid"),
        (CALIBRATION + "color = 3\n", "color: expected an object, found 3"),
        (CALIBRATION + "[color]\nwidth = 3\n", r"color\.height: expected an entry"),
        (CALIBRATION + "[[", "TOML"),
    ],
)
def test_a_wrong_calibration_file_is_refused(folder, text, words):
    (folder / "calibration.toml").write_text(text)
    with pytest.raises(RecordingError, match=words) as caught:
        open_recording(folder)
    assert "calibration.toml" in str(caught.value)


def test_a_missing_calibration_file_is_named(folder):
    (folder / "calibration.toml").unlink()
    with pytest.raises(RecordingError, match=r"calibration\.toml: expected a calibration file"):
        open_recording(folder)


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        (lambda data: data[: len(data) // 2], "complete PNG"),
        (lambda data: data[:-12], "complete PNG"),
        (lambda data: data[:45] + bytes([data[45] ^ 1]) + data[46:], "checksum"),
        (lambda data: b"", "expected a PNG"),
        (lambda data: cv2.imencode(".png", np.zeros((3, 4), np.uint8))[1].tobytes(), "16-bit single-channel"),
        (lambda data: cv2.imencode(".png", np.zeros((3, 4, 3), np.uint16))[1].tobytes(), "16-bit single-channel"),
        (lambda data: cv2.imencode(".png", np.zeros((3, 5), np.uint16))[1].tobytes(), "expected 4x3 px"),
    ],
)
def test_a_damaged_depth_image_is_refused_after_those_before_it(folder, damage, words):
    path = folder / "depth" / f"{STAMPS[1]}.png"
    path.write_bytes(damage(path.read_bytes()))
    frames = iter(open_recording(folder))
    assert next(frames).stamp == float(STAMPS[0])
    with pytest.raises(RecordingError, match=words) as caught:
        next(frames)
    assert path.name in str(caught.value)


def test_a_damaged_color_image_is_refused_when_checked(folder):
    add_color(folder)
    path = folder / "rgb" / "1305031102.1.png"
    path.write_bytes(path.read_bytes()[:50])
    color = next(iter(open_recording(folder))).measurements[0]
    with pytest.raises(RecordingError, match=r"1305031102\.1\.png: expected a complete PNG"):
        color.image  # noqa: B018


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("1.0\n", "line 1: expected 'stamp file'"),
        ("one depth/a.png\n", "line 1: expected a stamp"),
        ("nan depth/a.png\n", "line 1: expected a stamp"),
        ("2.0 depth/a.png\n1.0 depth/b.png\n", "rising stamps, found 1.000000 after 2.0"),
        ("# nothing\n", "found none"),
    ],
)
def test_a_wrong_list_file_is_refused(folder, text, words):
    (folder / "depth.txt").write_text(text)
    with pytest.raises(RecordingError, match=words):
        open_recording(folder)


def test_names_that_are_no_stamps_and_files_that_are_gone_are_named(folder):
    (folder / "depth" / "last.png").write_bytes(b"")
    with pytest.raises(RecordingError, match=r"last\.png: expected a stamp"):
        open_recording(folder)
    (folder / "depth.txt").write_text("1.0 depth/gone.png\n")
    with pytest.raises(RecordingError, match=r"gone\.png"):
        list(open_recording(folder))


def test_truth_and_start_beside_the_images_are_read_unless_nothing_beside_is(folder):
    (folder / "truth.csv").write_text(
        "stamp_s,l_wrist_x,l_wrist_y,l_wrist_z\n1305031102.16,1.0,2.0,3.0\n1305031103.5,,,\n"
    )
    (folder / "init.json").write_text('{"height_m": 1.7, "joints": {"l_wrist": [1.0, 2.0, 3.0]}}')
    recording = open_recording(folder)
    assert recording.reference.exact and recording.reference.names == ("l_wrist",)
    np.testing.assert_array_equal(recording.reference.positions[:, 0], [[1.0, 2.0, 3.0], [np.nan] * 3])
    assert recording.start == {"height_m": 1.7, "joints": {"l_wrist": (1.0, 2.0, 3.0)}}
    assert "exact" in recording.info().reference
    bare = open_recording(folder, bare=True)
    assert bare.reference is None and bare.start is None
    start = {"joints": {"l_wrist": [1.0, 2.0, 3.0]}, "stamp_s": recording.info().start_stamp}
    (folder / "init.json").write_text(json.dumps(start))
    assert open_recording(folder).start == {"joints": {"l_wrist": (1.0, 2.0, 3.0)}}
    (folder / "init.json").write_text(json.dumps({**start, "stamp_s": start["stamp_s"] + 2.0}))
    with pytest.raises(RecordingError, match=r"init\.json: expected the pose in the first frame.*--init FILE takes it"):
        open_recording(folder)
    assert Init.load(folder / "init.json").stamp_s == start["stamp_s"] + 2.0
    (folder / "truth.csv").write_text("nothing\n")
    open_recording(folder, bare=True)
    with pytest.raises(RecordingError, match=r"truth\.csv"):
        open_recording(folder)


@pytest.mark.parametrize(
    "names",
    [
        ["depth_0009", "depth_0010", "depth_0011"],
        ["frame-000003.depth", "frame-000004.depth", "frame-000005.depth"],
        ["cam2_image10", "cam2_image11", "cam2_image12"],
        ["depth_2.0", "depth_10.0", "depth_11.5"],
    ],
)
@pytest.mark.parametrize("flat", [False, True])
@pytest.mark.parametrize("suffix", [".png", ".pgm"])
def test_names_with_numbers_formats_and_folders_of_other_programs(folder, names, flat, suffix):
    before = [frame.measurements[0].image for frame in open_recording(folder)]
    for name, file, image in zip(names, sorted((folder / "depth").iterdir()), before, strict=True):
        file.unlink()
        cv2.imwrite(str((folder if flat else folder / "depth") / f"{name}{suffix}"), image)
        if flat:
            cv2.imwrite(str(folder / f"{name.replace('depth', 'color')}_color.png"), np.zeros((3, 4, 3), np.uint8))
    if flat:
        (folder / "depth").rmdir()
    frames = list(open_recording(folder, rate=10.0))
    gaps = [2.0 - 0.2, 8.0, 1.5] if "2.0" in names[0] else [0.1, 0.1, 0.1]
    np.testing.assert_allclose(np.diff([frame.stamp for frame in frames]), gaps[1:], atol=1e-9)
    for frame, image in zip(frames, before, strict=True):
        np.testing.assert_array_equal(frame.measurements[0].image, image)


def test_a_pgm_that_is_cut_off_and_pictures_of_eight_bits_are_named(folder):
    (folder / "depth" / f"{STAMPS[0]}.png").unlink()
    (folder / "depth" / f"{STAMPS[0]}.pgm").write_bytes(b"P5\n# comment\n4 3\n65535\n" + bytes(23))
    with pytest.raises(RecordingError, match="complete PGM"):
        list(open_recording(folder))
    (folder / "depth" / f"{STAMPS[0]}.pgm").write_bytes(b"P5\n# comment\n4 3\n255\n" + bytes(range(12)))
    with pytest.raises(RecordingError, match="found 8 bits and 1 channel with values from 0 to 11"):
        list(open_recording(folder))


def test_mirrored_images_are_flipped_back(folder):
    before = [frame.measurements[0].image for frame in open_recording(folder)]
    (folder / "calibration.toml").write_text("mirrored = true\n" + CALIBRATION)
    for frame, image in zip(open_recording(folder), before, strict=True):
        np.testing.assert_array_equal(frame.measurements[0].image, image[:, ::-1])
    (folder / "calibration.toml").write_text("mirrored = 1\n" + CALIBRATION)
    with pytest.raises(RecordingError, match="mirrored: expected true or false, found 1"):
        open_recording(folder)


ROS_YAML = """image_width: 4
image_height: 3
camera_name: depth
camera_matrix: {rows: 3, cols: 3, data: [5.0, 0.0, 1.5, 0.0, 5.5, 1.0, 0.0, 0.0, 1.0]}
distortion_model: plumb_bob
distortion_coefficients: {rows: 1, cols: 5, data: [0.1, 0.0, 0.0, 0.0, 0.0]}
"""
OPENCV_YAML = """%YAML:1.0
---
image_width: 4
image_height: 3
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 5., 0., 1.5, 0., 5.5, 1., 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 1
   cols: 5
   dt: d
   data: [ 1.0e-01, 0., 0., 0., 0. ]
"""


@pytest.mark.parametrize("text", [ROS_YAML, OPENCV_YAML])
def test_a_calibration_in_yaml(folder, text):
    (folder / "calibration.toml").unlink()
    (folder / "camera.yaml").write_text(text)
    item = next(iter(open_recording(folder))).measurements[0]
    camera = item.camera
    assert (camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy) == (4, 3, 5.0, 5.5, 1.5, 1.0)
    assert camera.distortion[0] == 0.1 and item.meters_per_unit == 0.001


@pytest.mark.parametrize(
    ("written", "model"),
    [("fisheye", "equidistant"), ("kannala_brandt4", "equidistant"), ("radtan", "plumb_bob"), ("omni", None)],
)
def test_a_lens_in_yaml_is_the_one_it_names(folder, written, model):
    (folder / "calibration.toml").unlink()
    text = ROS_YAML.replace("plumb_bob", written).replace("cols: 5", "cols: 4").replace("0.0, 0.0]}", "0.0]}")
    (folder / "camera.yaml").write_text(text)
    if model is None:
        with pytest.raises(RecordingError, match=r"camera\.yaml, \[depth\]: .*model.*omni"):
            open_recording(folder)
    else:
        assert next(iter(open_recording(folder))).measurements[0].camera.model == model


def renamed(folder, names):
    for name, file in zip(names, sorted((folder / "depth").iterdir()), strict=True):
        file.rename(file.with_name(f"{name}.png"))


def stamped(folder, stamps, *, listed):
    """Writes other stamps into the list of images, or into their names."""
    if listed:
        lines = [f"{stamp} depth/{name}.png\n" for stamp, name in zip(stamps, STAMPS, strict=True)]
        (folder / "depth.txt").write_text("".join(lines))
    else:
        renamed(folder, stamps)


@pytest.mark.parametrize(
    "stamps",
    [
        ("1305031102160", "1305031102193", "1305031102227"),
        ("1305031102160.4", "1305031102193.7", "1305031102227.1"),
        ("1305031102160407000", "1305031102193741000", "1305031102227074000"),
    ],
)
@pytest.mark.parametrize("listed", [False, True])
def test_times_since_1970_tell_their_unit_in_names_and_lists(folder, stamps, listed):
    stamped(folder, stamps, listed=listed)
    found = [frame.stamp for frame in open_recording(folder)]
    np.testing.assert_allclose(np.subtract(found, 1305031102.0), (0.16, 0.193, 0.227), atol=1e-3)


@pytest.mark.parametrize("listed", [False, True])
@pytest.mark.parametrize("texts", [("1000", "1033", "1067"), ("1000.0", "1033.4", "1066.7")])
def test_the_unit_of_stamps_can_be_told(folder, listed, texts):
    stamped(folder, texts, listed=listed)
    recording = open_recording(folder, seconds_per_unit=0.001)
    np.testing.assert_allclose([frame.stamp for frame in recording], (1.0, 1.033, 1.067), atol=1e-3)
    assert recording.assumed == ()
    with pytest.raises(RecordingError, match="seconds_per_unit: expected seconds > 0, found -1"):
        open_recording(folder, seconds_per_unit=-1)


@pytest.mark.parametrize(
    ("step", "words"),
    [(1, ""), (2, ""), (33, "milliseconds, --option seconds_per_unit=0.001"), (33333, "microseconds")],
)
def test_numbers_that_rise_like_a_clock_are_doubted(folder, step, words):
    renamed(folder, [f"{100 + index * step:06d}" for index in range(3)])
    (said,) = open_recording(folder).assumed
    assert f"the numbers rise by {step:d}: if they are times in {words}" in said if words else "rise" not in said
    (said,) = open_recording(folder, rate=15.0).assumed
    assert said == "depth/ is numbered, and taken for 15 images/s", "who gives a rate knows what they count"
