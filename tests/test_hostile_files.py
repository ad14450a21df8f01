"""Files that a stranger or an adversary gives: an error of our own that names file and key, at once, and nothing else."""

import json
import os
import struct
import zipfile
import zlib

import cv2
import numpy as np
import pytest
import scipy.io

import voodoo
from bag_writer import Messages, write_bag
from commands import refused, run
from voodoo.errors import BodyError, ConfigError, RecordingError, VoodooError
from voodoo.export.track import Track
from voodoo.pipeline.start import Init
from voodoo.recordings import open_recording, ros_bag, sample_path
from voodoo.recordings.pictures import decode_color, decode_depth_png, picture_size
from voodoo.recordings.truth import read_people_truth, read_start, read_truth
from voodoo.recordings.utd_mhad import read_mat

M = Messages()


# Text files


DEEP = "a = " + "[" * 5000
LONG = "threads = " + "9" * 5000


@pytest.mark.parametrize("text", [DEEP, LONG, "a = 1\n" * 2, "threads = " + "9" * 400, "\0", "a." * 5000 + "a = 1"])
def test_toml_that_breaks_parsers_is_one_error(tmp_path, text):
    path = tmp_path / "x.toml"
    path.write_text(text)
    for load, error in ((voodoo.Config.load, ConfigError), (voodoo.Body.load, BodyError)):
        with pytest.raises(error, match=r"x\.toml: "):
            load(path)
    (tmp_path / "depth").mkdir()
    cv2.imwrite(str(tmp_path / "depth" / "0.0.png"), np.ones((3, 4), np.uint16))
    (tmp_path / "calibration.toml").write_text(text)
    refused(run("info", tmp_path), "calibration.toml")
    refused(run("track", sample_path(), "--config", path), "x.toml")


def test_toml_files_have_a_greatest_size(tmp_path):
    path = tmp_path / "x.toml"
    path.write_bytes(b"#" * 1_100_000)
    with pytest.raises(ConfigError, match="found 1100000 bytes"):
        voodoo.Config.load(path)


@pytest.mark.parametrize(
    "size", ["[1e5, 1e5]", "[1e12, 1e12]", "[1e300, 2]", "[" + "9" * 400 + ", 1]", "[-1, 2]", "['a', 1]"]
)
def test_sizes_in_a_pose2sim_calibration_are_checked(tmp_path, size):
    table = (
        "matrix = [[1, 0, 1], [0, 1, 1], [0, 0, 1]]\ndistortions = []\nrotation = [0, 0, 0]\ntranslation = [0, 0, 0]\n"
    )
    (tmp_path / "Calib_x.toml").write_text(f"[cam]\nsize = {size}\n{table}")
    (tmp_path / "keypoints" / "a_json").mkdir(parents=True)
    (tmp_path / "keypoints" / "a_json" / "0.json").write_text('{"people": []}')
    refused(run("info", tmp_path), "Calib_x.toml, [cam]", "expected")


def test_results_with_stamps_that_are_dates_are_refused(tmp_path):
    good = {
        "status": np.array(["tracking"] * 3), "residual": np.zeros(3), "joint_names": np.array(["a"]),
        "joints": np.zeros((3, 1, 3)), "limb_names": np.array([], dtype=str), "world_from_limb": np.zeros((3, 0, 4, 4)),
    }  # fmt: skip
    for wrong in (np.arange(3).astype("datetime64[s]"), np.array(["a", "b", "c"]), np.zeros(3, dtype=complex)):
        np.savez(tmp_path / "x.npz", stamps=wrong, **good)
        with pytest.raises(VoodooError, match=r"x\.npz: stamps: expected an array of numbers, found"):
            Track.load(tmp_path / "x.npz")
        refused(run("track", sample_path(), "--init", tmp_path / "x.npz"), "x.npz", "stamps")


@pytest.mark.parametrize("number", [10**400, float("nan"), float("inf")])
def test_a_start_beyond_all_numbers_is_refused(tmp_path, number):
    file = tmp_path / "init.json"
    file.write_text(json.dumps({"joints": {"l_wrist": [number, 0.0, 0.0]}}))
    with pytest.raises(RecordingError, match=r"init\.json: joints\.l_wrist\.0: .*finite number"):
        read_start(file, lambda frame: np.eye(4), first=0.0)
    with pytest.raises(VoodooError, match=r"init\.json: joints\.l_wrist\.0: .*finite number"):
        Init.load(file)


@pytest.mark.parametrize("cell", ["9" * 400, "1e400", "-inf", "1e300", "0.5", "\0"])
def test_truths_beyond_all_numbers_are_refused(tmp_path, cell):
    alone, people = tmp_path / "truth.csv", tmp_path / "truth_people.csv"
    alone.write_text(f"stamp_s,l_hip_x,l_hip_y,l_hip_z\n{cell},1,2,3\n0.1,1,2,3\n")
    with pytest.raises(RecordingError, match=r"truth\.csv"):
        read_truth(alone, lambda stamp: np.eye(4))
    people.write_text(f"stamp_s,person,in_view,l_hip_x,l_hip_y,l_hip_z\n0.1,{cell},1,1,2,3\n")
    with pytest.raises(RecordingError, match=r"truth_people\.csv"):
        read_people_truth(people, lambda stamp: np.eye(4))


def test_people_who_never_meet_take_no_gigabytes(tmp_path):
    path = tmp_path / "truth_people.csv"
    rows = "".join(f"{number},{number},1,1,2,3\n" for number in range(1, 5000))
    path.write_text("stamp_s,person,in_view,l_hip_x,l_hip_y,l_hip_z\n" + rows)
    with pytest.raises(RecordingError, match="expected people who are there together, found 4999 at 4999 stamps"):
        read_people_truth(path, lambda stamp: np.eye(4))


# Pictures


def blank_png(width, height, depth=16):
    """A PNG of zeros: small, and gigabytes when it is decoded."""

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    packer = zlib.compressobj(9)
    row = b"\0" * (1 + width * depth // 8)
    rows = b"".join(packer.compress(row) for _ in range(height)) + packer.flush()
    head = struct.pack(">IIBBBBB", width, height, depth, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", rows) + chunk(b"IEND", b"")


def test_pictures_are_measured_before_they_are_decoded(monkeypatch):
    large = blank_png(30_000, 300)
    monkeypatch.setattr(cv2, "imdecode", lambda *_: pytest.fail("it was decoded"))
    with pytest.raises(RecordingError, match="expected 640x480 px as calibrated, found 30000x300"):
        decode_depth_png(large, "x", (640, 480))
    with pytest.raises(RecordingError, match="expected 640x480 px as calibrated, found 30000x300"):
        decode_color(large, "x", (640, 480))


@pytest.mark.parametrize("suffix", [".png", ".jpg"])
@pytest.mark.parametrize("size", [(3, 4), (480, 641), (1, 1)])
def test_sizes_of_pictures_are_read_from_their_headers(suffix, size):
    data = cv2.imencode(suffix, np.zeros((*size, 3), np.uint8))[1].tobytes()
    assert picture_size(data, "x") == size[::-1]
    for cut in range(0, min(len(data), 300), 7):
        try:
            assert picture_size(data[:cut], "x") == size[::-1]
        except RecordingError:
            pass


# Files that are none, and archives


def test_lists_name_files_inside_their_folder(tmp_path):
    (tmp_path / "depth").mkdir()
    (tmp_path / "calibration.toml").write_text("width=4\nheight=3\nfx=5\nfy=5\ncx=1\ncy=1\n")
    for name in ("/etc/passwd", "../secret.png", "depth/../../x.png"):
        (tmp_path / "depth.txt").write_text(f"1.0 {name}\n")
        refused(run("info", tmp_path), "depth.txt, line 1: expected a file inside the folder")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no FIFOs here")
def test_fifos_and_devices_are_no_pictures(tmp_path):
    (tmp_path / "depth").mkdir()
    calibration = tmp_path / "calibration.toml"
    calibration.write_text("width=4\nheight=3\nfx=5\nfy=5\ncx=1\ncy=1\n")
    os.mkfifo(tmp_path / "depth" / "1.0.png")
    with pytest.raises(RecordingError, match=r"1\.0\.png: expected a readable picture, found no regular file"):
        list(open_recording(tmp_path))
    (tmp_path / "depth" / "1.0.png").unlink()
    (tmp_path / "depth" / "1.0.png").symlink_to("/dev/zero")
    with pytest.raises(RecordingError, match="found no regular file"):
        list(open_recording(tmp_path))
    os.mkfifo(tmp_path / "x.trc")
    refused(run("info", tmp_path / "x.trc"), "x.trc")
    os.mkfifo(tmp_path / "x.bag")
    refused(run("info", tmp_path / "x.bag"), "x.bag")
    os.mkfifo(tmp_path / "x.json")
    refused(run("track", sample_path(), "--init", tmp_path / "x.json"), "x.json", "found no regular file")


def test_archives_have_a_limit_and_errors_name_them(tmp_path, monkeypatch):
    with zipfile.ZipFile(tmp_path / "bomb.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("x.bag", b"\0" * 30_000_000)
    monkeypatch.setattr("voodoo.unpacking._LITTLE", 2**20)
    monkeypatch.setattr(ros_bag.shutil, "copyfileobj", lambda *_: pytest.fail("it was unpacked"))
    refused(run("info", tmp_path / "bomb.zip"), "bomb.zip: ", "that unpack to at most", "found 30000000")
    monkeypatch.undo()
    bag = write_bag(tmp_path / "b", [("/scan", 10.0, M.scan(10.0, [1.0]))])
    part = next(bag.glob("*.mcap"))
    with zipfile.ZipFile(tmp_path / "cut.zip", "w") as archive:
        archive.writestr("b/x.mcap", part.read_bytes()[:200])
    done = run("info", tmp_path / "cut.zip")
    refused(done, "cut.zip", "cut off")
    assert "voodoo-" not in done.stderr.replace("voodoo: ", "")


# Compiled readers


def test_matlab_files_are_read_as_scipy_reads_them(tmp_path):
    arrays = {
        "a": np.arange(24, dtype=np.uint16).reshape(2, 3, 4), "b": np.linspace(0, 1, 7).reshape(1, 7),
        "whole": np.arange(5.0).reshape(1, 5), "single": np.ones((2, 2), np.float32), "long_name_of_an_array": np.eye(3),
    }  # fmt: skip
    for packed in (True, False):
        scipy.io.savemat(tmp_path / "x.mat", {**arrays, "text": "abc", "c": 1j * np.eye(2)}, do_compression=packed)
        theirs, ours = scipy.io.loadmat(tmp_path / "x.mat"), read_mat(tmp_path / "x.mat")
        assert set(ours) == set(arrays)
        for name in arrays:
            np.testing.assert_array_equal(ours[name], theirs[name])
            assert ours[name].dtype == theirs[name].dtype
    scipy.io.savemat(tmp_path / "old.mat", {"a": np.eye(2)}, format="4")
    with pytest.raises(RecordingError, match=r"old\.mat: expected a MATLAB file of level 5, found another file"):
        read_mat(tmp_path / "old.mat")


def test_an_array_that_unpacks_to_gigabytes_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("voodoo.unpacking._LITTLE", 2**20)
    scipy.io.savemat(tmp_path / "x.mat", {"d_depth": np.zeros((240, 320, 50), np.uint16)}, do_compression=True)
    with pytest.raises(RecordingError, match=r"x\.mat: .* that unpack to at most \d+, found more"):
        read_mat(tmp_path / "x.mat")
