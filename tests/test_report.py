"""The page of a result, looked at in Chromium: nothing fails, nothing is fetched, and play turns the skeleton."""

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
from voodoo.recordings import sample_path

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
    assert width == cv2.VideoCapture(str(film)).get(cv2.CAP_PROP_FRAME_WIDTH) and console == []
    assert duration == pytest.approx(len(track) / 30.0, abs=0.2) and 0.1 < at <= duration
    assert bands == len(track.angle_names) and "Left out: nothing" in page
    refused(run("report", result, "--film", result, "--out", tmp_path / "none.html"), "expected a video")


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
    refused(run("report", result, "--film", tmp_path / "look.avi", "--out", tmp_path / "a.html"), "look.avi", "VP8")
