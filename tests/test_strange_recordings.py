"""Recordings of real cameras: what their tools write is read, or it is said what to do."""

import json
import struct
from pathlib import Path

import cv2
import numpy as np
import pytest

import voodoo
import voodoo.pipeline.start
from bag_writer import Messages, write_bag
from commands import run
from voodoo.errors import CameraError, RecordingError
from voodoo.export.track import Track
from voodoo.recordings import ColorImage, DepthImage, open_recording
from voodoo.recordings.camera_files import read_calibration
from voodoo.recordings.left_out import LeftOut
from voodoo.recordings.pictures import decode_rvl

REALSENSE = Path(__file__).parent / "data" / "realsense"
M = Messages()
DEPTH = np.array([[0, 1, 2, 3], [400, 500, 600, 0], [800, 9000, 0, 65535]], np.uint16)


# RealSense


@pytest.mark.parametrize("name", ["recorded_2_55.bag", "recorded_2_59.db3"])
def test_what_librealsense_records_is_read(name):
    recording = open_recording(REALSENSE / name)
    frames = list(recording)
    assert len(frames) == 6
    (depth,) = [item for item in frames[1].measurements if isinstance(item, DepthImage)]
    # Its writing ends half a picture later than the depth image's, so it belongs to the next frame.
    color = next(item for item in frames[1].measurements if isinstance(item, ColorImage))
    assert depth.meters_per_unit == 0.001 and not depth.camera.distorted
    assert (depth.image[:, 8:] == 2001).all() and not depth.image[:, :8].any()
    assert (depth.camera.fx, depth.camera.cx, depth.camera.cy) == (60.0, 32.0, 23.25)
    assert color.camera.model == "inverse_plumb_bob" and color.camera.distortion == pytest.approx(
        (0.05, -0.02, 0.001, -0.001, 0.0)
    )
    assert color.image[0, 0].tolist() == [0, 0, 200]
    color_from_depth = np.eye(4)
    color_from_depth[:2, :2] = [[np.cos(0.1), -np.sin(0.1)], [np.sin(0.1), np.cos(0.1)]]
    color_from_depth[:3, 3] = (0.015, -0.002, 0.001)
    found = np.linalg.inv(color.root_from_sensor) @ depth.root_from_sensor
    np.testing.assert_allclose(found, color_from_depth, atol=1e-6)


def test_the_unit_of_depth_is_the_recordings(tmp_path):
    copy = tmp_path / "r.db3"
    copy.write_bytes((REALSENSE / "recorded_2_59.db3").read_bytes().replace(b"\x000.001000\x00", b"\x000.000100\x00"))
    images = [item for frame in open_recording(copy) for item in frame.measurements if isinstance(item, DepthImage)]
    assert {item.meters_per_unit for item in images} == {0.0001}


def test_the_stamps_of_a_bag_are_the_cameras_own():
    stamps = [frame.stamp for frame in open_recording(REALSENSE / "recorded_2_55.bag")]
    np.testing.assert_allclose(stamps, 100.0 + np.arange(6) / 30.0, atol=1e-6)
    (image, *_) = next(iter(open_recording(REALSENSE / "recorded_2_55.bag", meters_per_unit=0.0001))).measurements
    assert image.meters_per_unit == 0.0001


def test_an_inverse_lens_undistorts_by_the_polynomial_and_projects_back():
    k1, k2, p1, p2 = 0.05, -0.02, 0.001, -0.001
    camera = voodoo.Camera(80, 60, 75.0, 75.0, 40.0, 29.25, (k1, k2, p1, p2, 0.0), "inverse_plumb_bob")
    u, v = np.meshgrid(np.arange(80.0), np.arange(60.0))
    x, y = (u - 40.0) / 75.0, (v - 29.25) / 75.0  # as rs2_deproject_pixel_to_point has it
    r2 = x * x + y * y
    f = 1.0 + k1 * r2 + k2 * r2 * r2
    expected = np.stack(
        [x * f + 2 * p1 * x * y + p2 * (r2 + 2 * x * x), y * f + 2 * p2 * x * y + p1 * (r2 + 2 * y * y)], axis=-1
    )
    np.testing.assert_allclose(camera.rays(), expected, atol=1e-6)
    points = np.column_stack([expected.reshape(-1, 2), np.ones(4800)]) * 2.0
    np.testing.assert_allclose(camera.project(points), np.column_stack([u.ravel(), v.ravel()]), atol=1e-3)
    for name in ("Brown Conrady", "Modified Brown Conrady", "None"):
        assert voodoo.Camera.from_camera_info(width=4, height=3, k=np.eye(3), model=name).model == "plumb_bob"
    with pytest.raises(CameraError, match="F-Theta"):
        voodoo.Camera.from_camera_info(width=4, height=3, k=np.eye(3), d=(1.0,) * 5, model="F-Theta")


# RVL


def encode_rvl(image):
    """The compressor of Wilson's paper, line by line."""
    nibbles = []

    def number(value):
        while True:
            nibble, value = value & 7, value >> 3
            nibbles.append(nibble | (8 if value else 0))
            if not value:
                return

    row, at, previous = [int(value) for value in image.ravel()], 0, 0
    while at < len(row):
        zeros = at
        while at < len(row) and row[at] == 0:
            at += 1
        number(at - zeros)
        observed = at
        while at < len(row) and row[at] != 0:
            at += 1
        number(at - observed)
        for value in row[observed:at]:
            delta, previous = value - previous, value
            number((delta << 1) ^ (delta >> 31))
    nibbles += [0] * (-len(nibbles) % 8)
    words = [int("".join(f"{nibble:x}" for nibble in nibbles[k : k + 8]), 16) for k in range(0, len(nibbles), 8)]
    return struct.pack(f"<II{len(words)}I", image.shape[1], image.shape[0], *words)


def scene(seed):
    rng = np.random.default_rng(seed)
    image = (2000 + 300 * np.sin(np.arange(64 * 48) / 20) + rng.normal(0, 20, 64 * 48)).astype(np.uint16)
    image[rng.random(image.size) < 0.1 * seed] = 0
    image[rng.integers(0, image.size, 9)] = 65535
    return image.reshape(48, 64)


@pytest.mark.parametrize("seed", range(5))
def test_rvl_gives_the_image_back(seed):
    image = scene(seed) if seed else np.zeros((48, 64), np.uint16)
    np.testing.assert_array_equal(decode_rvl(encode_rvl(image), "x", (64, 48)), image)


def test_damaged_rvl_is_refused_or_another_image():
    good = encode_rvl(scene(1))
    for cut in (0, 5, 8, 40, len(good) // 2):
        with pytest.raises(RecordingError, match="x: expected"):
            decode_rvl(good[:cut], "x", (64, 48))
    with pytest.raises(RecordingError, match="expected 32x48 px as calibrated, found 64x48"):
        decode_rvl(good, "x", (32, 48))
    rng = np.random.default_rng(0)
    for _ in range(200):
        bad = bytearray(good)
        bad[int(rng.integers(8, len(bad)))] ^= int(rng.integers(1, 256))
        try:
            assert decode_rvl(bytes(bad), "x", (64, 48)).shape == (48, 64)
        except RecordingError:
            pass


def test_rvl_in_a_bag(tmp_path):
    image = scene(2)
    info = ("/d/depth/camera_info", 10.0, M.camera_info(10.0, width=64, height=48, f=60.0))
    raw = M.compressed(10.0, b"\0" * 12 + encode_rvl(image), "16UC1; compressedDepth rvl")
    bag = write_bag(tmp_path / "b", [info, ("/d/depth/image/compressedDepth", 10.0, raw)])
    (frame,) = open_recording(bag)
    np.testing.assert_array_equal(frame.measurements[0].image, image)


# Folders of images


def folder(path, names, *, calibration="width = 4\nheight = 3\nfx = 5.0\nfy = 5.0\ncx = 1.5\ncy = 1.0\n", image=DEPTH):
    (path / "depth").mkdir(parents=True)
    for name in names:
        cv2.imwrite(str(path / "depth" / f"{name}.png"), image)
    if calibration:
        (path / "calibration.toml").write_text(calibration)
    return path


def test_numbered_images_have_a_rate_and_it_is_reported(tmp_path):
    path = folder(tmp_path / "f", [f"{number:05d}" for number in range(4)])
    assert [frame.stamp for frame in open_recording(path)] == pytest.approx([0.0, 1 / 30, 2 / 30, 3 / 30])
    assert "numbered, and taken for 30 images/s; --option rate=N" in run("info", path).stdout
    assert [frame.stamp for frame in open_recording(path, rate=15.0)] == pytest.approx([0.0, 1 / 15, 2 / 15, 3 / 15])
    reported = run("info", path, "--option", "rate=15").stdout
    assert "taken for 15 images/s" in reported and "--option" not in reported
    with pytest.raises(RecordingError, match="rate: expected images per second"):
        open_recording(path, rate=0.0)


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (("1700000000123", "1700000000223"), (1700000000.123, 1700000000.223)),
        (("1700000000123456789", "1700000001123456789"), (1700000000.123456789, 1700000001.123456789)),
        (("1305031102", "1305031103"), (1305031102.0, 1305031103.0)),
        (("0.0", "0.5"), (0.0, 0.5)),
    ],
)
def test_names_that_are_stamps_stay_stamps(tmp_path, names, expected):
    recording = open_recording(folder(tmp_path / "f", names))
    assert [frame.stamp for frame in recording] == pytest.approx(expected, abs=1e-6) and recording.assumed == ()


def test_a_missing_calibration_answers_with_a_template(tmp_path):
    path = folder(tmp_path / "f", ["0.0"], calibration="")
    done = run("info", path)
    assert done.exit_code == 1 and "calibration.toml: expected a calibration file" in done.stderr.splitlines()[0]
    _, template = done.stderr.split("camera:\n\n")
    (path / "calibration.toml").write_text(template)
    found = read_calibration(path / "calibration.toml")
    assert (found.depth.camera.width, found.depth.camera.height, found.depth_factor) == (4, 3, 1000.0)
    assert len(list(open_recording(path))) == 1


def test_millimeters_under_the_default_factor_get_a_hint(tmp_path):
    image = np.linspace(1500, 4000, 12).reshape(3, 4).astype(np.uint16)
    path = folder(tmp_path / "f", ["0.0", "0.1"], image=image)
    reported = run("info", path).stdout
    assert "leave no room for a person: is the unit right?" in reported
    joints = {"l_hip": [0, 0, 2], "r_hip": [0.2, 0, 2], "l_shoulder": [0, -0.5, 2], "r_shoulder": [0.2, -0.5, 2]}
    (tmp_path / "start.json").write_text(json.dumps({"joints": joints}))
    done = run("track", path, "--init", tmp_path / "start.json", "--out", tmp_path / "pose.csv")
    assert done.exit_code == 0, done.output
    if not {"tracking", "degraded"} & set(Track.load(tmp_path / "pose.csv").status):
        assert "leave no room for a person" in done.stderr
    else:
        pytest.fail(done.output)
    (path / "calibration.toml").write_text((path / "calibration.toml").read_text() + "depth_factor = 1000.0\n")
    assert "leave no room" not in run("info", path).stdout


def test_damaged_images_of_a_folder_are_left_out(tmp_path):
    path = folder(tmp_path / "f", ["1.0", "2.0", "3.0", "4.0", "5.0"])
    data = (path / "depth" / "2.0.png").read_bytes()
    (path / "depth" / "2.0.png").write_bytes(data[:40])
    cv2.imwrite(str(path / "depth" / "3.0.png"), np.zeros((3, 4), np.uint16))
    cv2.imwrite(str(path / "depth" / "4.0.png"), np.ones((6, 8), np.uint16))
    (path / "depth.txt").write_text(
        "".join(
            f"{stamp} depth/{name}.png\n" for stamp, name in enumerate(("1.0", "2.0", "3.0", "4.0", "5.0", "gone"), 1)
        )
        + "6.0 depth/1.0.png\n3.5 depth/1.0.png\n7.0 depth/1.0.png\n"
    )
    left_out = LeftOut()
    assert [frame.stamp for frame in open_recording(path, left_out=left_out)] == [1.0, 5.0, 7.0]
    assert left_out.counts == {
        "with a repeated stamp": 1,
        "with a stamp before the last one": 1,
        "that cannot be read": 2,
        "that are blank": 1,
        "of another size than calibrated": 1,
    }
    with pytest.raises(RecordingError, match="expected rising stamps"):
        open_recording(path)


def test_images_turned_against_their_calibration_are_called_so(tmp_path):
    path = folder(tmp_path / "f", ["0.0"], image=np.ascontiguousarray(DEPTH.T))
    with pytest.raises(RecordingError, match=r"expected 4x3 px as calibrated, found 3x4, as of images .* turned by 90"):
        list(open_recording(path))


def test_a_list_of_images_whose_clock_was_set_back_goes_on(tmp_path):
    path = folder(tmp_path / "f", ["a", "b", "c", "d", "e"])
    stamps = (100.0, 100.1, 50.0, 50.1, 50.2)
    lines = (f"{stamp} depth/{name}.png\n" for stamp, name in zip(stamps, "abcde", strict=True))
    (path / "depth.txt").write_text("".join(lines))
    left_out = LeftOut()
    recording = open_recording(path, left_out=left_out)
    assert [frame.stamp for frame in recording] == pytest.approx([100.0, 100.1, 100.3, 100.4])
    assert left_out.counts == {"with a stamp before the last one": 1}
    (said,) = recording.assumed
    assert "was set back from 100.100000 to 50.000000 s" in said and "moved on by 50.200000 s" in said


def test_what_is_not_read_reports_what_to_do(tmp_path):
    for name, words in {
        "a.mkv": "an Azure Kinect",
        "a.oni": "OpenNI",
        "a.svo": "ZED",
        "film.mp4": "depth, or a folder with the films of several cameras and their calibration",
    }.items():
        (tmp_path / name).touch()
        done = run("track", tmp_path / name)
        assert done.exit_code == 1 and words in done.stderr and "docs/how-to/cameras.md" in done.stderr
    (tmp_path / "rgb").mkdir()
    done = run("info", tmp_path)
    assert done.exit_code == 1 and "found color alone" in done.stderr
    page = (Path(__file__).parents[1] / "docs" / "how-to" / "cameras.md").read_text(encoding="utf-8")
    titles = " ".join(line for line in page.splitlines() if line.startswith("#"))
    for name in ("RealSense", "Orbbec", "OAK", "Azure Kinect", "OpenNI", "MediaPipe", "OpenPose"):
        assert name in titles, name
    assert page.count("voodoo track") > 3


# A start beside a recording


JOINTS = {"l_hip": [1, 2, 3], "r_hip": [1.2, 2, 3], "l_shoulder": [1, 2, 3.5]}


def placed(tmp_path, root, content):
    info = ("/d/depth/camera_info", 10.0, M.camera_info(10.0))
    edges = [] if root is None else [("/tf_static", 10.0, M.tf((10.0, root, "cam", (0, 0, 1), (0, 0, 0, 1))))]
    bag = write_bag(tmp_path / "b", [*edges, info, ("/d/depth/image", 10.0, M.image(10.0, DEPTH, "16UC1"))])
    (tmp_path / "init.json").write_text(json.dumps(content))
    return bag


@pytest.mark.parametrize("root", ["base_link", "world", None])
def test_a_start_is_in_the_recordings_own_root_frame(tmp_path, root):
    recording = open_recording(placed(tmp_path, root, {"joints": JOINTS}))
    assert recording.root_frame == (root or "cam")
    assert recording.start["joints"] == {name: pytest.approx(place) for name, place in JOINTS.items()}


def test_a_start_may_name_its_frame(tmp_path):
    bag = placed(tmp_path, "world", {"joints": JOINTS, "frame": "cam"})
    assert open_recording(bag).start["joints"]["l_hip"] == pytest.approx((1.0, 2.0, 4.0))
    init = voodoo.pipeline.start.Init.model_validate({"joints": JOINTS, "frame": "cam"})
    assert init.in_root_frame(open_recording(bag)).joints["l_hip"] == pytest.approx((1.0, 2.0, 4.0))


@pytest.mark.parametrize("content", [{"joints": JOINTS, "frame": "base_link"}, {"joints": {"l_hip": "x"}}, [], "{"])
def test_a_start_that_does_not_fit_stops_neither_info_nor_an_explicit_one(tmp_path, content):
    bag = placed(tmp_path, "world", content)
    with pytest.raises(RecordingError, match=r"base_link|init\.json"):
        open_recording(bag)
    done = run("info", bag)
    assert done.exit_code == 0 and "init.json is not used" in done.stdout
    (tmp_path / "own.json").write_text(json.dumps({"joints": JOINTS}))
    done = run("track", bag, "--init", tmp_path / "own.json", "--out", tmp_path / "pose.csv")
    assert done.exit_code == 0 and "init.json" not in done.stderr, done.output
    (tmp_path / "own.json").write_text(json.dumps({"joints": JOINTS, "frame": "kitchen"}))
    done = run("track", bag, "--init", tmp_path / "own.json", "--out", tmp_path / "pose.csv")
    assert done.exit_code == 1 and "'kitchen'" in done.stderr


def test_a_truth_is_in_the_recordings_own_root_frame(tmp_path):
    bag = placed(tmp_path, "world", {"joints": JOINTS})
    (tmp_path / "truth.csv").write_text("stamp_s,l_hip_x,l_hip_y,l_hip_z\n10.0,1,2,3\n")
    assert open_recording(bag).reference.positions[0, 0].tolist() == [1.0, 2.0, 3.0]
