"""The page of a result, looked at in Chromium: nothing fails, nothing is fetched, and play turns the skeleton."""

import itertools
import math
import os
import shutil
from dataclasses import replace

import cv2
import numpy as np
import pytest

import color_scene
import voodoo
from browser import needs_chromium, told_by
from commands import refused, run
from test_doors import track_of
from test_exports import with_gaps
from voodoo.export.people import PeopleTrack
from voodoo.export.track import Track
from voodoo.recordings import open_recording, sample_path
from voodoo.visualization import image_writer
from voodoo.visualization.report_page import playable

pytest.importorskip("plotly", reason="pip install plotly, of the extra report")
PLAY = """<script>setTimeout(() => {
  const plot = document.querySelectorAll(".js-plotly-plot")[1], first = plot._fullData[0].x[0];
  plot.querySelector(".updatemenu-button").dispatchEvent(new MouseEvent("click"));
  setTimeout(() => fetch("/", {method: "POST", body: JSON.stringify([
    plot.layout.sliders[0].active, plot._fullData[0].x[0] !== first, plot.layout.shapes[0].x0,
    performance.getEntriesByType("resource").map((one) => one.name).filter((name) => !name.endsWith("favicon.ico"))])}), 1500);
}, 500)</script>"""


@needs_chromium
def test_a_page_plays_without_network(tmp_path):
    body = voodoo.Body.human()
    track = with_gaps(track_of(body))
    sure = np.where(track.found[:, None, None, None], 1e-4 * np.eye(3), np.nan)
    track = replace(
        track,
        joint_names=("</script><script>boom()</script>", *track.joint_names[1:]),
        covariance=np.tile(sure, (1, len(track.joint_names), 1, 1)),
        limb_status={limb: ("", "measured") * 12 + ("",) for limb in body.limb_names},
    )
    PeopleTrack(track.stamps, {1: track, 2: track.of_frames(track.found)}).save(tmp_path / "all <b>.npz")
    done = run("report", tmp_path / "all <b>.npz", "--out", tmp_path / "all.html")
    assert done.exit_code == 0, done.stderr
    page = (tmp_path / "all.html").read_text(encoding="utf-8")
    (slider, moved, cursor, fetched), console = told_by(page + PLAY, tmp_path)
    assert slider > 0 and moved and cursor > 0.0 and fetched == [] and console == []
    assert "<script>boom()" not in page
    assert "<h1>all &lt;b&gt;</h1>" in page and "12 tracking" in page and "13 searching" in page


FILM = """<script>setTimeout(() => {
  const film = document.getElementById("film"), plot = document.querySelector(".js-plotly-plot");
  plot.querySelector(".updatemenu-button").dispatchEvent(new MouseEvent("click"));
  setTimeout(() => fetch("/", {method: "POST", body: JSON.stringify([film.videoWidth, film.duration, film.currentTime,
    plot._fullData.filter((one) => one.fill === "toself").length])}), 1500);
}, 800)</script>"""


@needs_chromium
def test_the_film_goes_with_the_timeline_and_angles_have_deviations(tmp_path):
    result, film = tmp_path / "pose.npz", tmp_path / "look.mp4"
    assert run("track", sample_path(), "--use", "depth", "--out", result, "--overlay", film).exit_code == 0
    track = Track.load(result)
    assert track.angle_sigma.shape == track.angles.shape
    known = track.angle_sigma[np.isfinite(track.angle_sigma)]
    assert len(known) > 0.8 * track.angles.size and math.radians(0.1) < np.median(known) < math.radians(20.0)
    done = run("report", result, "--film", film, "--out", tmp_path / "r.html")
    assert done.exit_code == 0, done.stderr
    page = (tmp_path / "r.html").read_text(encoding="utf-8")
    (width, duration, at, bands), console = told_by(page + FILM, tmp_path)
    assert 800 < width < cv2.VideoCapture(str(film)).get(cv2.CAP_PROP_FRAME_WIDTH) and console == []
    assert duration == pytest.approx(len(track) / 30.0, abs=0.2) and 0.1 < at <= duration
    assert bands == len(track.angle_names) and "Left out: nothing" in page
    refused(run("report", result, "--film", result, "--out", tmp_path / "none.html"), "expected a video")


def test_a_film_in_a_page_is_small_and_still_shows_the_picture(tmp_path):
    pytest.importorskip("av", reason="pip install av, of the extra film")
    depths = (frame.measurements[0] for frame in itertools.islice(open_recording(sample_path(), use=("depth",)), 12))
    pictures = [
        cv2.resize(
            cv2.applyColorMap(np.nan_to_num(60.0 * depth.meters()).clip(0, 255).astype(np.uint8), cv2.COLORMAP_JET),
            (1840, 720),
        )
        for depth in depths
    ]
    color_scene.write_video(tmp_path / "look.avi", pictures)
    shown = tmp_path / "film.webm"
    shown.write_bytes(playable(tmp_path / "look.avi"))
    # A page of 300 frames has 8 MB then, of which Plotly has 5.
    assert shown.stat().st_size < len(pictures) * 10_000
    small = cv2.VideoCapture(str(shown))
    for picture in pictures:
        also, found = small.read()
        size = found.shape[1::-1]
        assert also and size[0] * size[1] <= 600_000 and size[0] / size[1] == pytest.approx(1840 / 720, rel=0.01)
        assert cv2.PSNR(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), found) > 30.0
    assert not small.read()[0]


@pytest.mark.parametrize("encoder", ["PyAV", "OpenCV"])
def test_a_film_of_any_size_is_made_playable(tmp_path, monkeypatch, encoder):
    if encoder == "OpenCV":
        monkeypatch.setattr(image_writer, "_SMALL", {"none": {}})
    color_scene.write_video(tmp_path / "look.avi", [np.full((50, 66, 3), 90, np.uint8)] * 3)
    (tmp_path / "film.webm").write_bytes(playable(tmp_path / "look.avi"))
    shown = cv2.VideoCapture(str(tmp_path / "film.webm"))
    assert shown.read()[1].shape == (50, 66, 3) and shown.get(cv2.CAP_PROP_FPS) == pytest.approx(30.0)
    track_of(voodoo.Body.human()).save(tmp_path / "pose.npz")
    done = run("report", tmp_path / "pose.npz", "--film", tmp_path / "look.avi", "--out", tmp_path / "a.html")
    assert done.exit_code == 0 and ("voodoo-tracker[film]" in done.stderr) == (encoder == "OpenCV")


def test_what_is_no_result_leaves_no_page(tmp_path):
    (tmp_path / "pose.csv").write_text("stamp_s,status\n")
    refused(run("report", tmp_path / "pose.csv", "--out", tmp_path / "a.html"), "pose.csv")
    refused(run("report", tmp_path / "none.npz", "--out", tmp_path / "a.html"), "none.npz", "no such file")
    refused(run("report", tmp_path / "pose.csv", "--out", tmp_path / "a.pdf"), "a.pdf", ".html")
    assert [path.name for path in tmp_path.iterdir()] == ["pose.csv"]


def test_a_film_that_opencv_cannot_read_or_write_is_an_error_that_names_it(tmp_path, monkeypatch):
    result, film = tmp_path / "pose.npz", tmp_path / os.fsdecode(b"a\xff.avi")
    track_of(voodoo.Body.human()).save(result)
    color_scene.write_video(tmp_path / "look.avi", [np.zeros((48, 64, 3), np.uint8)] * 3)
    shutil.copy(tmp_path / "look.avi", film)
    refused(run("report", result, "--film", film, "--out", tmp_path / "a.html"), "expected a name in UTF-8")

    class Closed:
        fourcc = staticmethod(lambda *_: 0)

        def __init__(self, *_):
            self.isOpened = self.write = self.release = lambda *_: False

    monkeypatch.setattr("cv2.VideoWriter", Closed)
    monkeypatch.setattr(image_writer, "_SMALL", {"none": {}})
    refused(run("report", result, "--film", tmp_path / "look.avi", "--out", tmp_path / "a.html"), "look.avi", "VP8")
