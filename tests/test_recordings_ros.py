"""ROS bags of every storage the readers claim, whole, cut off and changed."""

import gc
import struct
import zipfile

import numpy as np
import pytest
from ruamel.yaml import YAML

from bag_writer import Messages, write_bag
from ros_bags import DEPTH, IDENTITY, INFO, TF, bag, depth_entry, only
from voodoo.errors import RecordingError
from voodoo.recordings import open_recording
from voodoo.recordings.left_out import LeftOut


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
    assert (first.stamp, second.stamp, first.meters_per_unit) == (10.0, 10.5, 0.001)


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_the_metadata_of_a_folder_are_parsed_once(tmp_path, monkeypatch, storage):
    parsed = []
    load = YAML.load

    def counted(self, text, *rest):
        parsed.append("rosbag2_bagfile_information" in str(text))
        return load(self, text, *rest)

    monkeypatch.setattr(YAML, "load", counted)
    recording = open_recording(bag(tmp_path, TF, INFO, depth_entry(), depth_entry(10.5), storage=storage))
    assert recording.info().frames == 2
    assert [[item.stamp for item in only(recording)] for _ in range(2)] == [[10.0, 10.5]] * 2
    assert sum(parsed) == 1


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


@pytest.mark.parametrize("storage", ["mcap", "sqlite3", "ros1"])
def test_messages_are_read_as_written_where_the_recorders_clock_was_set_back(tmp_path, storage):
    """Times of recording and stamps: 10.0 to 10.4 s, then 7.5 to 7.9 s. In the order of time the second half would come first."""
    stamps = [*np.arange(10.0, 10.45, 0.1), *np.arange(7.5, 7.95, 0.1)]
    if storage == "ros1":
        m1 = Messages(ros=1)
        tf = m1.tf((9.9, "base_link", "cam", (1, 2, 3), IDENTITY))
        entries = [("/tf_static", 9.9, tf), ("/d/depth/camera_info", 10.0, m1.camera_info(10.0))]
        entries += [("/d/depth/image", at, m1.image(at, DEPTH + number, "16UC1")) for number, at in enumerate(stamps)]
        path = write_bag(tmp_path / "b.bag", entries, ros=1)
    else:
        entries = [depth_entry(at, DEPTH + number) for number, at in enumerate(stamps)]
        path = bag(tmp_path, TF, INFO, *entries, storage=storage)
    left_out = LeftOut()
    found = only(open_recording(path, left_out=left_out))
    assert [int(item.image[0, 1]) - 300 for item in found] == [0, 1, 2, 3, 4, 6, 7, 8, 9]
    assert [item.stamp for item in found] == pytest.approx([*np.arange(10.0, 10.45, 0.1), *np.arange(10.6, 10.95, 0.1)])
    assert left_out.counts == {"with a stamp before the last one": 1} and len(left_out.notes) == 1
