"""A .mkv of an Azure Kinect: depth and color fit together by its calibration, and damage is named."""

import shutil

import cv2
import numpy as np
import pytest

from commands import run
from measurement_data import data_folder
from voodoo.errors import RecordingError
from voodoo.recordings import open_recording
from voodoo.recordings.left_out import LeftOut

av = pytest.importorskip("av", reason="pip install av, of the extra azure")


@pytest.fixture(scope="module")
def real(voodoo_data):
    return data_folder(voodoo_data, "real", "azure_mkv") / "recording.mkv"


def rewritten(real, path, *, frames=1, calibration=None, cut=None, mode=None):
    """The recording with its one frame repeated; another attachment (b"": none), depth cut at a frame, another mode."""
    source = av.open(str(real))
    film = av.open(str(path), "w", format="matroska", options={"allow_raw_vfw": "1"})
    tracks = {}
    for stream in source.streams.video:
        tracks[stream.index] = film.add_stream_from_template(stream)
        tracks[stream.index].metadata.update(dict(stream.metadata) | ({"K4A_DEPTH_MODE": mode} if mode else {}))
    (attached,) = (stream for stream in source.streams if stream.type == "attachment")
    content = bytes(attached.data) if calibration is None else calibration(bytes(attached.data))
    if content:
        film.add_attachment("calibration.json", "application/octet-stream", content)
    film.metadata.update(source.metadata)
    packets = [packet for packet in source.demux(source.streams.video) if packet.size]
    for number in range(frames):
        for packet in packets:
            whole = not (number == cut and packet.stream.index == 1)
            copy = av.Packet(bytes(packet) if whole else bytes(packet)[:1000])
            copy.stream, copy.time_base = tracks[packet.stream.index], packet.time_base
            copy.pts = copy.dts = packet.pts + 33_333 * number
            film.mux(copy)
    film.close()
    return path


def test_edges_in_depth_lie_on_edges_in_color(real):
    (frame,) = open_recording(real)
    color, depth = frame.measurements
    assert frame.stamp == depth.stamp == pytest.approx(0.463945 + 0.336277)
    image = depth.image * 0.001
    assert image.shape == (576, 640) and np.median(image[image > 0]) == pytest.approx(1.49, abs=0.01)
    behind = cv2.dilate(image, np.ones((5, 5)))
    edges = (image > 0.0) & (behind > image + 0.3)
    points = np.dstack([depth.camera.rays(), np.ones_like(image)])[edges] * image[edges][:, None]
    lens = color.camera
    color_from_root = np.linalg.inv(color.root_from_sensor)
    pixels, _ = cv2.projectPoints(
        points @ color_from_root[:3, :3].T + color_from_root[:3, 3], np.zeros(3), np.zeros(3),
        np.array([[lens.fx, 0, lens.cx], [0, lens.fy, lens.cy], [0, 0, 1]]), np.array(lens.distortion),
    )  # fmt: skip
    gray = cv2.GaussianBlur(cv2.cvtColor(color.image, cv2.COLOR_BGR2GRAY).astype(np.float32), (0, 0), 2.0)
    steep = np.hypot(cv2.Sobel(gray, cv2.CV_32F, 1, 0), cv2.Sobel(gray, cv2.CV_32F, 0, 1))
    column, row = pixels.reshape(-1, 2).T

    def strength(dx, dy):
        at = np.clip(np.round(row + dy), 0, 719).astype(int), np.clip(np.round(column + dx), 0, 1279).astype(int)
        return steep[at].mean()

    here = max(strength(dx, dy) for dx in (-3, 0, 3) for dy in (-3, 0, 3))
    away = max(strength(dx, dy) for dx, dy in ((-20, 0), (20, 0), (0, -20), (0, 20)))
    assert here > 1.5 * away


def test_stamps_and_a_cut_image(real, tmp_path):
    path = rewritten(real, tmp_path / "three frames.mkv", frames=3, cut=1)
    with pytest.raises(RecordingError, match=r"depth: expected 737280 bytes, found 1000"):
        list(open_recording(path))
    left_out = LeftOut()
    recording = open_recording(path, left_out=left_out)
    assert len(recording) == 3
    frames = list(recording)
    assert [frame.stamp for frame in frames] == pytest.approx([0.800, 0.867], abs=0.001)
    assert [len(frame.measurements) for frame in frames] == [2, 3]  # the color of the cut image goes with the next
    assert len(left_out) == 1


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"calibration": lambda content: b""}, r"expected the attachment calibration\.json, found none"),
        (
            {"calibration": lambda content: content[:2000]},
            "calibration.json: expected the calibration of an Azure Kinect",
        ),
        (
            {"calibration": lambda content: content.replace(b"PurposeDepth", b"PurposeDapth")},
            "calibration: expected CALIBRATION_CameraPurposeDepth with 14 parameters",
        ),
        (
            {"calibration": lambda content: content.replace(b"0.49290284514427185", b"-1")},
            "calibration: camera fx, fy: expected",
        ),
        (
            {"calibration": lambda content: content.replace(b'"Rotation":[0.99', b'"Rotation":[7.99')},
            "with a rigid transform from the depth camera",
        ),
        ({"mode": "NFOV_SIDEWAYS"}, "expected one of the modes NFOV_2X2BINNED.*found 'NFOV_SIDEWAYS'"),
    ],
    ids=["none", "cut", "no depth camera", "focal length", "rotation", "mode"],
)
def test_a_calibration_that_is_no_use_is_named(real, tmp_path, change, words):
    path = rewritten(real, tmp_path / "damaged.mkv", **change)
    with pytest.raises(RecordingError, match=words):
        open_recording(path)


def test_the_folder_of_the_only_file_is_opened(real, tmp_path):
    shutil.copy(real, tmp_path / "walk.mkv")
    (tmp_path / "notes.txt").write_text("of today")
    assert len(open_recording(tmp_path)) == len(open_recording(real)) == 1


def test_a_damaged_file_and_a_film_are_refused_without_a_result(real, tmp_path):
    (tmp_path / "half.mkv").write_bytes(real.read_bytes()[:600])
    film = av.open(str(tmp_path / "film.mkv"), "w")
    track = film.add_stream("mpeg4", rate=30)
    track.width, track.height = 64, 48
    film.mux(track.encode(av.VideoFrame.from_ndarray(np.zeros((48, 64, 3), np.uint8))))
    film.mux(track.encode(None))
    film.close()
    (tmp_path / "list.mkv").write_text("#EXTM3U\n#EXT-X-TARGETDURATION:1\n#EXTINF:1,\nrecording.mkv\n")
    for name, words in {
        "half.mkv": "expected a .mkv of an Azure Kinect",
        "film.mkv": "found a film without its depth track",
        "list.mkv": "found damage",  # not opened by another reader
    }.items():
        done = run("track", tmp_path / name, "--out", tmp_path / "pose.csv")
        assert done.exit_code == 1 and words in " ".join(done.stderr.split()) and not (tmp_path / "pose.csv").exists()
