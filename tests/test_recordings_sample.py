"""The bundled recording: its facts, and what damage to it does."""

import json
import shutil
from collections import Counter
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
import pytest

from voodoo.errors import RecordingError
from voodoo.recordings import ColorImage, DepthImage, LaserScan, open_recording, sample_path
from voodoo.recordings.pictures import decode_color

MCAP = sample_path() / "bag" / "bag.mcap"


@pytest.fixture(scope="module")
def sample():
    return open_recording(sample_path())


@pytest.fixture(scope="module")
def frames(sample):
    return list(sample)


def depth_of(frame) -> DepthImage:
    (depth,) = (m for m in frame.measurements if isinstance(m, DepthImage))
    return depth


def depth_points(depth: DepthImage) -> np.ndarray:
    """(H, W, 3) in the root frame, NaN where nothing came back."""
    z = depth.image * depth.meters_per_unit
    points = np.dstack([depth.camera.rays() * z[..., None], z])
    points[depth.image == 0] = np.nan
    return points @ depth.root_from_sensor[:3, :3].T + depth.root_from_sensor[:3, 3]


def contents(path: Path, **options) -> list:
    """Everything a recording yields, comparable."""
    out = []
    for frame in open_recording(path, **options):
        out.append(frame.stamp)
        for m in frame.measurements:
            array = m.ranges if isinstance(m, LaserScan) else m.image
            camera = None if isinstance(m, LaserScan) else m.camera
            out.append((type(m).__name__, m.stamp, array.tobytes(), m.root_from_sensor.tobytes(), camera))
    return out


@pytest.fixture(scope="module")
def untouched():
    return contents(MCAP)


def test_counts_and_rates(sample, frames):
    assert len(sample) == len(frames) == 90
    kinds = Counter(type(m) for frame in frames for m in frame.measurements)
    assert kinds == {DepthImage: 90, ColorImage: 89, LaserScan: 45}
    stamps = np.array([frame.stamp for frame in frames])
    np.testing.assert_allclose(np.diff(stamps), 1 / 30, atol=1e-6)
    info = sample.info()
    assert (info.loader, info.frames, info.root_frame, info.name) == ("ros2", 90, "base_link", "bend_scoop")
    assert info.rate_hz == pytest.approx(30.0, abs=1e-3)
    rates = {sensor.kind: sensor.rate_hz for sensor in info.sensors}
    assert rates == pytest.approx({"depth": 30.0, "scan": 15.0, "color": 30.0}, abs=1e-2)
    for words in ("base_link", "/scan", "30.00 Hz", "19 joints", "exact"):
        assert words in str(info)


def test_the_recording_fits_the_package():
    assert sum(file.stat().st_size for file in sample_path().rglob("*")) < 4_000_000


def test_each_measurement_keeps_its_own_stamp(frames):
    for before, frame in pairwise(frames):
        assert depth_of(frame).stamp == frame.stamp == frame.measurements[-1].stamp
        assert all(before.stamp < m.stamp <= frame.stamp for m in frame.measurements)


def test_truth_has_the_stamps_of_the_depth_images(sample, frames):
    assert sample.reference.exact and sample.reference.positions.shape == (90, 19, 3)
    np.testing.assert_allclose(sample.reference.stamps, [frame.stamp for frame in frames], atol=1e-6)


def test_start_is_the_first_row_of_truth(sample):
    assert sample.start["height_m"] == 1.76
    for name, position in zip(sample.reference.names, sample.reference.positions[0], strict=True):
        np.testing.assert_allclose(sample.start["joints"][name], position)


def test_the_floor_is_at_zero(frames):
    points = depth_points(depth_of(frames[0]))
    floor = points[-6:, 100:].reshape(-1, 3)
    assert np.isfinite(floor).all(axis=1).sum() > 300
    assert abs(np.nanmedian(floor[:, 2])) < 0.01


def test_the_scan_is_level_at_its_height(frames):
    scan = next(m for frame in frames for m in frame.measurements if isinstance(m, LaserScan))
    points = scan.points() @ scan.root_from_sensor[:3, :3].T + scan.root_from_sensor[:3, 3]
    assert len(points) > 100
    np.testing.assert_allclose(points[:, 2], 0.35, atol=1e-6)


def test_joints_lie_in_the_body_that_the_camera_sees(sample, frames):
    """A joint in view lies less than 25 cm behind the surface in front of it, and not before it."""
    behind = []
    for index in (0, 20, 40, 60, 80):
        depth = depth_of(frames[index])
        sensor_from_root = np.linalg.inv(depth.root_from_sensor)
        joints = sample.reference.positions[index] @ sensor_from_root[:3, :3].T + sensor_from_root[:3, 3]
        for (u, v), z in zip(np.round(depth.camera.project(joints)), joints[:, 2], strict=True):
            if 0 <= u < 176 and 0 <= v < 144 and depth.image[int(v), int(u)]:
                behind.append(z - depth.image[int(v), int(u)] * depth.meters_per_unit)
    assert len(behind) > 80
    assert 0.0 < np.median(behind) < 0.15 and np.mean(np.abs(behind) < 0.25) > 0.95


def test_left_is_the_persons_own_left(sample, frames):
    """He faces the camera: his left is on the image's right."""
    depth = depth_of(frames[0])
    sensor_from_root = np.linalg.inv(depth.root_from_sensor)
    joints = sample.reference.positions[0] @ sensor_from_root[:3, :3].T + sensor_from_root[:3, 3]
    u = dict(zip(sample.reference.names, depth.camera.project(joints)[:, 0], strict=True))
    assert u["l_shoulder"] > u["r_shoulder"] + 10 and u["l_hip"] > u["r_hip"]


def test_iterating_again_and_at_the_same_time_gives_the_same(sample, frames):
    for (a, b), first in zip(zip(sample, sample, strict=True), frames[:5], strict=False):
        assert a.stamp == b.stamp == first.stamp
        np.testing.assert_array_equal(depth_of(a).image, depth_of(b).image)
        np.testing.assert_array_equal(depth_of(a).image, depth_of(first).image)


def test_color_is_decoded_once_and_only_when_asked_for(frames):
    image = next(m for m in frames[1].measurements if isinstance(m, ColorImage))
    assert "image" not in vars(image)
    assert image.image.shape == (240, 320, 3) and image.image.dtype == np.uint8
    assert image.image is image.image


def test_use_selects_and_the_first_kind_makes_the_frames():
    scans = open_recording(sample_path(), use=("scan",))
    assert len(scans) == 45
    assert all(isinstance(m, LaserScan) for frame in scans for m in frame.measurements)
    color = open_recording(sample_path(), use=("color",))
    assert len(color) == 89


def test_another_root_frame_moves_everything_along(sample, frames):
    camera = open_recording(sample_path(), root_frame="camera_depth_optical_frame")
    root_from_sensor = depth_of(frames[0]).root_from_sensor
    moved = camera.reference.positions @ root_from_sensor[:3, :3].T + root_from_sensor[:3, 3]
    np.testing.assert_allclose(moved, sample.reference.positions, atol=1e-9)
    np.testing.assert_allclose(depth_of(next(iter(camera))).root_from_sensor, np.eye(4), atol=1e-12)
    hip = np.array(camera.start["joints"]["humanoid_root"])
    np.testing.assert_allclose(
        root_from_sensor[:3, :3] @ hip + root_from_sensor[:3, 3], sample.start["joints"]["humanoid_root"]
    )


def test_it_opens_by_any_of_its_paths(untouched):
    for path in (sample_path(), sample_path() / "bag"):
        recording = open_recording(path)
        assert recording.name == "bend_scoop" and recording.start and recording.reference
        assert contents(path) == untouched


@pytest.mark.parametrize("fraction", np.linspace(0.0, 0.9999, 30).round(4))
def test_a_bag_cut_anywhere_is_refused(tmp_path, fraction):
    data = MCAP.read_bytes()
    path = tmp_path / "cut.mcap"
    path.write_bytes(data[: int(fraction * len(data))])
    with pytest.raises(RecordingError, match=r"cut\.mcap.*expected"):
        list(open_recording(path))


@pytest.mark.parametrize("missing", range(1, 60, 4))
def test_a_bag_that_lost_its_last_bytes_is_refused(tmp_path, missing):
    path = tmp_path / "cut.mcap"
    path.write_bytes(MCAP.read_bytes()[:-missing])
    with pytest.raises(RecordingError, match=r"cut\.mcap.*expected"):
        list(open_recording(path))


@pytest.mark.parametrize("seed", range(40))
def test_a_changed_byte_is_refused_or_changes_nothing(tmp_path, untouched, seed):
    """Bytes nobody reads (a library's name, padding) may change; a measurement may not."""
    rng = np.random.default_rng(seed)
    data = bytearray(MCAP.read_bytes())
    # half of them in the index at the end, where the structure is
    start = 0 if seed % 2 else len(data) - 9000
    position = int(rng.integers(start, len(data)))
    data[position] ^= int(rng.integers(1, 256))
    path = tmp_path / "changed.mcap"
    path.write_bytes(data)
    try:
        found = contents(path)
    except RecordingError as error:
        assert "changed.mcap" in str(error)
    else:
        assert found == untouched


def test_a_renamed_topic_in_the_summary_breaks_its_checksum(tmp_path):
    data = bytearray(MCAP.read_bytes())
    at = data.rindex(b"/scan")
    data[at : at + 5] = b"/scam"
    path = tmp_path / "changed.mcap"
    path.write_bytes(data)
    with pytest.raises(RecordingError, match="wrong checksum"):
        open_recording(path)


@pytest.mark.parametrize("length", [2**63, 2**64 - 1, 10_000_000])
def test_a_record_that_leaves_the_file_is_named_by_its_place(tmp_path, length):
    data = bytearray(MCAP.read_bytes())
    data[9:17] = length.to_bytes(8, "little")
    path = tmp_path / "changed.mcap"
    path.write_bytes(data)
    with pytest.raises(RecordingError, match=rf"record of {length} bytes at byte 8"):
        open_recording(path)


@pytest.fixture
def copy(tmp_path):
    return Path(shutil.copytree(sample_path(), tmp_path / "copy"))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("message_count: 90", "message_count: 91", "expected 90 messages.*found 91"),
        ("message_count: 90", "message_count: many", "index of a ROS bag"),
        ("storage_identifier: mcap", "storage_identifier: paper", "paper"),
        ("- bag.mcap", "- bog.mcap", "missing"),
        ("version: 9", "version: 99", "99"),
        ("rosbag2_bagfile_information:", "rosbag2: [", "YAML"),
        ("type: sensor_msgs/msg/Image", "type: sensor_msgs/msg/Imago", "Imag"),
    ],
)
def test_a_changed_metadata_file_is_refused(copy, old, new, words):
    metadata = copy / "bag" / "metadata.yaml"
    text = metadata.read_text()
    assert old in text
    metadata.write_text(text.replace(old, new, 1))
    with pytest.raises(RecordingError, match=words):
        list(open_recording(copy, use=("depth", "scan")))


def test_a_bag_directory_without_metadata_opens_by_its_only_file(copy, untouched):
    (copy / "bag" / "metadata.yaml").unlink()
    assert contents(copy) == untouched


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        (lambda text: text[: len(text) // 2], "expected 58 cells"),
        (lambda text: text.replace("stamp_s", "time", 1), "columns stamp_s"),
        (lambda text: text.replace("3.08853", "three", 1), "line 2: expected numbers"),
        (lambda text: text.replace("1700201000.066666667", "1700201000.000000001", 1), "rising stamps"),
        (lambda text: text.splitlines()[0], "at least one row"),
        (lambda text: text.replace("1.50315", "inf", 1), "finite"),
        (lambda text: "\x00\xff", "columns stamp_s"),
    ],
)
def test_a_damaged_truth_file_is_refused(copy, damage, words):
    truth = copy / "truth.csv"
    truth.write_text(damage(truth.read_text()))
    with pytest.raises(RecordingError, match=words) as caught:
        open_recording(copy)
    assert "truth.csv" in str(caught.value)


def test_an_empty_cell_of_truth_is_a_missing_joint(copy):
    truth = copy / "truth.csv"
    truth.write_text(truth.read_text().replace("3.08853,-0.08661,0.94472", ",,", 1))
    reference = open_recording(copy).reference
    assert np.isnan(reference.positions[0, 0]).all() and np.isfinite(reference.positions[1:]).all()


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("{", "JSON"),
        ("[]", "expected an object, found"),
        (json.dumps({"joints": {}}), "joints: expected at least 1 entries, found"),
        (json.dumps({"joints": {"l_hip": [1, 2]}}), "l_hip"),
        (json.dumps({"joints": {"l_hip": [1, 2, "x"]}}), "l_hip"),
        (json.dumps({"joints": {"l_hip": [1, 2, float("nan")]}}), "l_hip"),
        (
            json.dumps({"joints": {"l_hip": [1, 2, 3]}, "height_m": 176}),
            "height_m: expected a number below 3, found 176",
        ),
    ],
)
def test_a_damaged_start_file_is_refused(copy, content, words):
    (copy / "init.json").write_text(content)
    with pytest.raises(RecordingError, match=words) as caught:
        open_recording(copy)
    assert "init.json" in str(caught.value)


def test_a_cut_color_image_is_refused_when_checked(frames):
    image = next(m for m in frames[1].measurements if isinstance(m, ColorImage))
    data = cv2.imencode(".jpg", image.image)[1].tobytes()
    assert decode_color(data, "x", (320, 240)).shape == (240, 320, 3)
    for damaged in (data[: len(data) // 2], b"", b"GIF89a", data[:3] + b"\xff\xd9"):
        with pytest.raises(RecordingError, match="x: expected"):
            decode_color(damaged, "x", (320, 240))
    with pytest.raises(RecordingError, match="320x200"):
        decode_color(data, "x", (320, 200))


def test_loaders_options_and_paths_that_do_not_exist_are_named(tmp_path):
    with pytest.raises(RecordingError, match="ros2, ros1, utd-mhad, folder"):
        open_recording(sample_path(), loader="vhs")
    with pytest.raises(RecordingError, match=r"option of the loader ros2.*depth_topic.*found depht_topic"):
        open_recording(sample_path(), depht_topic="/x")
    with pytest.raises(RecordingError, match="no such file"):
        open_recording(tmp_path / "nothing")
    with pytest.raises(RecordingError, match=r"ros2: .*ros1: .*utd-mhad: .*folder: "):
        open_recording(tmp_path)
    (tmp_path / "film.mp4").write_bytes(b"")
    expected = r"film\.mp4: expected depth, or a folder with the films of several cameras.*, found a film"
    with pytest.raises(RecordingError, match=expected):
        open_recording(tmp_path / "film.mp4")
    with pytest.raises(RecordingError, match="use: expected"):
        open_recording(sample_path(), use=("smell",))
    with pytest.raises(RecordingError, match="meters_per_unit"):
        open_recording(sample_path(), meters_per_unit=0.0)


@pytest.mark.parametrize("loader", ["ros1", "utd-mhad", "folder"])
def test_another_loader_reports_what_it_expected(loader):
    with pytest.raises(RecordingError, match="expected"):
        open_recording(MCAP, loader=loader)
