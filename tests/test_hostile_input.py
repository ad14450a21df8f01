"""What a stranger or an adversary gives: an error of our own that names it, at once, and nothing else."""

import json
import os
import signal
import struct
import subprocess
import sys
import time
import zipfile
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest
import scipy.io
from typer.testing import CliRunner

import voodoo
from bag_writer import Messages, write_bag
from scene import standing_joints
from voodoo import ik
from voodoo.batch.storage import find_sources
from voodoo.cli import app
from voodoo.errors import BodyError, CameraError, ConfigError, MeasurementError, RecordingError, VoodooError
from voodoo.evaluation.report import markdown
from voodoo.evaluation.score import Score
from voodoo.export.track import Track
from voodoo.model.camera import MOST_PIXELS
from voodoo.pipeline.start import Init
from voodoo.recordings import open_recording, ros_bag, sample_path
from voodoo.recordings.films import _opened
from voodoo.recordings.matlab import read_mat
from voodoo.recordings.people_truth import read_people_truth
from voodoo.recordings.pictures import decode_color, decode_depth_png, picture_size
from voodoo.recordings.truth import read_start, read_truth
from voodoo.visualization.image_writer import PictureWriter, save_picture

BODY = voodoo.Body.human()
FAR = standing_joints(BODY) | {"l_wrist": (1e300, 0.0, 0.0)}
M = Messages()


def run(*arguments):
    return CliRunner().invoke(app, [str(argument) for argument in arguments], env={"COLUMNS": "200"})


def refused(done, *words):
    assert done.exit_code == 1, done.output
    assert done.stderr.startswith("voodoo: ") and done.stderr.count("\n") == 1 and len(done.stderr) < 1000, done.stderr
    for word in words:
        assert word in done.stderr, done.stderr


# Arguments of the wrong kind


@pytest.mark.parametrize(
    ("call", "error", "words"),
    [
        (lambda: voodoo.Body.load(None), BodyError, "path: expected a file or folder, found NoneType"),
        (lambda: voodoo.Config.load(None), ConfigError, "path: expected a file or folder, found NoneType"),
        (lambda: Track.load(None), VoodooError, "path: expected a file or folder, found NoneType"),
        (lambda: voodoo.Body.human(height="x"), BodyError, "height: expected a stature in metres, found 'x'"),
        (lambda: voodoo.Body.human(height=None), BodyError, "height: expected a stature in metres, found None"),
        (lambda: voodoo.Body.human(height=10**400), BodyError, "height: expected a stature in metres, found 1000"),
        (lambda: voodoo.Body.human(model=3), BodyError, "'3'|3"),
        (lambda: BODY.scaled("x"), BodyError, "factor: expected a number, found 'x'"),
        (lambda: ik.Options(bones=0), MeasurementError, "bones: expected a list of .site, site, radius., found 0"),
        (lambda: ik.Chain(BODY, limbs=None), MeasurementError, "limbs: expected a list of names, found None"),
        (lambda: ik.Chain(BODY, limbs=[3]), MeasurementError, "limbs: expected a list of names"),
        (lambda: ik.Chain(None), BodyError, "body: expected a voodoo.Body, found NoneType"),
        (lambda: voodoo.Frame(stamp="x"), MeasurementError, "stamp: expected a number, found 'x'"),
        (lambda: frame().add_position("vc7", (0, 0, 1), weight="x"), MeasurementError, "weight: expected a number"),
        (lambda: frame().add_position(3, (0, 0, 1)), MeasurementError, "site: expected a name, found 3"),
        (lambda: frame().set_ground(normal=(0, 0, 1), offset=None), MeasurementError, "offset: expected a number"),
        (lambda: frame().add_points(np.zeros((1, 3)), weight=[]), MeasurementError, "weight: expected a number"),
        (lambda: voodoo.TaperedEllipticCylinder("x", 1, 1, 1, 1), BodyError, "length: expected metres, found 'x'"),
        (lambda: voodoo.Tracker(BODY).step(None), MeasurementError, "frame: expected a voodoo.Frame, found NoneType"),
        (lambda: voodoo.Tracker(BODY).scale("x"), BodyError, "factor: expected a number, found 'x'"),
        (lambda: voodoo.Tracker(BODY).set_shape("head", 2), BodyError, "shape: expected a voodoo.TaperedElliptic"),
        (lambda: voodoo.Tracker(BODY).remove_limb(None), BodyError, "name: expected a name, found NoneType"),
        (
            lambda: voodoo.Tracker(BODY).add_limb("box", parent="head", shape=None, joint=None),
            BodyError,
            "shape: expected a voodoo.TaperedEllipticCylinder, found NoneType",
        ),
        (
            lambda: voodoo.Tracker(BODY).reset(joints=FAR),
            MeasurementError,
            r"joints\[l_wrist\]: expected finite metres, 1e9 at most",
        ),
        (lambda: open_recording("a\0b"), RecordingError, "path: expected a file or folder, found a name with a NUL"),
        (lambda: open_recording("~nobody-of-that-name/x"), RecordingError, "found the home of an unknown user"),
        (lambda: voodoo.Body.load("a\0b"), BodyError, "found a name with a NUL"),
        (lambda: Init.load(Path("a\0b")), VoodooError, "found a name with a NUL"),
        (lambda: find_sources(["~nobody-of-that-name/x"]), VoodooError, "found the home of an unknown user"),
    ],
)
def test_arguments_are_refused_by_name(call, error, words):
    with pytest.raises(error, match=words):
        call()


def frame():
    return voodoo.Frame(stamp=0.0)


def test_what_is_far_beyond_the_world_is_refused_without_a_trace():
    tracker = voodoo.Tracker(BODY)
    before = tracker.reset(joints=standing_joints(BODY)).joint_positions.copy()
    for make in (
        lambda f: f.add_position("vc7", (1e300, 0, 0)),
        lambda f: f.add_ray("vc7", origin=(1e12, 0, 0), direction=(1, 0, 0)),
        lambda f: f.add_points(np.full((3, 3), 1e10)),
        lambda f: f.add_points(np.full((3, 3), 1e30, np.float32)),
        lambda f: f.add_points(np.zeros((3, 3)), world_from_sensor=np.eye(4) + np.eye(4, k=3) * 1e200),
    ):
        wrong = voodoo.Frame(stamp=1.0)
        make(wrong)
        with pytest.raises(MeasurementError):
            tracker.step(wrong)
    np.testing.assert_array_equal(tracker.estimate.joint_positions, before)


@pytest.mark.parametrize(
    "size", [(100_000, 100_000), (2**31 - 1, 1), (2**31 - 1, 2**31 - 1), (10**400, 1), (8192, 4097)]
)
def test_cameras_have_a_greatest_size(size):
    with pytest.raises(CameraError, match=r"camera size: expected at most 33554432 pixels"):
        voodoo.Camera(*size, 500.0, 500.0, 0.0, 0.0)
    assert voodoo.Camera(8192, 4096, 500.0, 500.0, 0.0, 0.0).width * 4096 == MOST_PIXELS


def test_rays_of_a_large_lens_are_those_of_its_parts(monkeypatch):
    """They are found strip by strip, or a large camera would take gigabytes."""
    monkeypatch.setattr("voodoo.model.camera._STRIP", 1000)
    bent = voodoo.Camera(150, 101, 90.0, 90.0, 74.5, 49.5, (0.1, -0.05, 0.0, 0.0))
    u, v = np.meshgrid(np.arange(150.0), np.arange(101.0))
    wanted = bent.undistorted(np.stack([u, v], axis=-1).reshape(-1, 2)).reshape(101, 150, 2)
    np.testing.assert_array_equal(bent.rays(), wanted.astype(np.float32))


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
    path.write_bytes(b"#" * 11_000_000)
    with pytest.raises(ConfigError, match="found 11000000 bytes"):
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
    monkeypatch.setattr(ros_bag, "_LITTLE", 2**20)
    monkeypatch.setattr(ros_bag.shutil, "copyfileobj", lambda *_: pytest.fail("it was unpacked"))
    refused(run("info", tmp_path / "bomb.zip"), "bomb.zip: expected an archive that unpacks to at most")
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
    monkeypatch.setattr("voodoo.recordings.matlab._MOST", 2**20)
    scipy.io.savemat(tmp_path / "x.mat", {"d_depth": np.zeros((240, 320, 50), np.uint16)}, do_compression=True)
    with pytest.raises(RecordingError, match=r"x\.mat: .* expected 1048576 bytes at most"):
        read_mat(tmp_path / "x.mat")


# The command line


def test_numpy_does_not_talk_to_users(tmp_path):
    code = (
        "import sys, numpy as np\nfrom voodoo.cli.common import clear_errors\n"
        "with clear_errors():\n    np.float64(1e300) * np.float64(1e300)\n    np.array([1.0]) / np.array([0.0])\n"
    )
    quiet = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert quiet.stderr == ""
    loud = subprocess.run([sys.executable, "-W", "always", "-c", code], capture_output=True, text=True, check=True)
    assert "RuntimeWarning" in loud.stderr


@pytest.mark.parametrize("path", ["~nobody-of-that-name/x.csv", "a\0b", "a\0b.json", "x" * 5000])
@pytest.mark.parametrize(
    "command",
    [
        ("track",),
        ("info",),
        ("init",),
        ("ik",),
        ("eval",),
        ("batch", "--out", "o"),
        *(("track", sample_path(), option) for option in ("--init", "--config", "--body", "--with")),
    ],
    ids=lambda words: f"{words[0]} {words[-1]}",
)
def test_paths_that_cannot_be_are_refused_in_a_line(tmp_path, monkeypatch, command, path):
    monkeypatch.chdir(tmp_path)
    done = run(*command, path)
    assert isinstance(done.exception, SystemExit), done.exception
    assert done.exit_code in (1, 2) and done.stderr and "Traceback" not in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_results_of_a_batch_have_a_path_that_can_be():
    refused(run("batch", sample_path(), "--out", "~nobody-of-that-name/x"), "found the home of an unknown user")


LATIN = os.fsdecode(b"caf\xe9")
"""As files of old are named: OpenCV ends the process for one."""


def test_names_of_other_bytes_do_not_reach_opencv(tmp_path):
    picture = np.zeros((16, 16, 3), np.uint8)
    for make in (
        lambda: PictureWriter(tmp_path / f"{LATIN}.mp4", rate_hz=30.0),
        lambda: PictureWriter(tmp_path / LATIN, rate_hz=30.0),
        lambda: save_picture(tmp_path / f"{LATIN}.png", picture),
    ):
        with pytest.raises(VoodooError, match=r"caf.*: expected a name in UTF-8, found other bytes"):
            make()
    if sys.platform == "linux":  # others have no such files
        (tmp_path / f"{LATIN}.avi").touch()
        with pytest.raises(RecordingError, match="expected a name in UTF-8"):
            _opened(tmp_path / f"{LATIN}.avi")


@pytest.mark.skipif(sys.platform != "linux", reason="no such names here")
def test_names_of_other_bytes_are_read_and_told(tmp_path):
    folder = tmp_path / LATIN
    (folder / "depth").mkdir(parents=True)
    (folder / "calibration.toml").write_text("width=4\nheight=3\nfx=5\nfy=5\ncx=1\ncy=1\n")
    (folder / "depth" / "1.0.png").write_bytes(cv2.imencode(".png", np.ones((3, 4), np.uint16))[1].tobytes())
    command = [sys.executable, "-c", "from voodoo.cli import main; main()", "info", folder]
    utf8 = {**os.environ, "LC_ALL": "C.UTF-8", "PYTHONUTF8": "0", "PYTHONIOENCODING": "utf-8:strict"}
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=utf8)
    assert done.returncode == 0 and done.stderr == "" and r"caf\udce9" in done.stdout


def test_a_failure_stands_below_the_table():
    text = markdown([Score("walk", Path("walk"), failure="walk: expected | a\nrecording, found\nnone " + "x" * 300)])
    rows = [line for line in text.splitlines() if line.startswith("| walk")]
    assert rows == ["| walk | - | - | failed, see below | | | | | |"]
    assert "walk: walk: expected | a recording, found none xxx" in text


@pytest.mark.skipif(not hasattr(os, "killpg"), reason="no process groups here")
def test_ctrl_c_ends_an_evaluation_at_once_and_keeps_what_is_done(tmp_path):
    (tmp_path / "all").mkdir()
    for number in range(300):
        (tmp_path / "all" / f"r{number:03d}").symlink_to(sample_path())
    # A shell's background job ignores the signal, and what it starts does, too.
    listen = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)"
    command = [
        sys.executable,
        "-c",
        f"{listen}; from voodoo.cli import main; main()",
        "eval",
        "all",
        "--use",
        "depth",
        "--jobs",
        "2",
        "--out",
        "report",
    ]
    pipe = subprocess.PIPE
    with subprocess.Popen(
        command, cwd=tmp_path, stdout=pipe, stderr=pipe, text=True, start_new_session=True, env={**os.environ}
    ) as running:
        time.sleep(5.0)
        began = time.perf_counter()
        os.killpg(running.pid, signal.SIGINT)  # as a terminal does: the workers get it, too
        try:
            out, err = running.communicate(timeout=60)
        finally:
            if running.poll() is None:
                os.killpg(running.pid, signal.SIGKILL)
        took = time.perf_counter() - began
    assert running.returncode == 130, err
    done = int(err.split("interrupted: ")[1].split(" of 300")[0])
    rows = out.split("| sequence |")[1].splitlines()[2:] if done else []
    assert sum(row.startswith("| ") for row in rows) == done, out
    assert took < 2.0, f"{took:.1f} s"  # on an idle machine 0.3 s
    if done:
        assert len((tmp_path / "report" / "sequences.csv").read_text().splitlines()) == 1 + done


@pytest.mark.parametrize("number", [10**400, float("nan"), float("inf")])
def test_a_start_beyond_all_numbers_is_refused(tmp_path, number):
    file = tmp_path / "init.json"
    file.write_text(json.dumps({"joints": {"l_wrist": [number, 0.0, 0.0]}}))
    with pytest.raises(RecordingError, match=r"joint l_wrist: expected \[x, y, z\] in metres"):
        read_start(file, lambda frame: np.eye(4))
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
