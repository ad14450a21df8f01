"""From pictures alone to a result: what the command line says, writes and draws."""

import csv
import json
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest

import color_scene as scene
from bag_writer import write_bag
from commands import run
from voodoo.pipeline.front_end import FrontEnd
from voodoo.pipeline.start import start_tracker
from voodoo.recordings import open_recording
from voodoo.sensors.settings import FrontEndSettings

FRAMES = 10


def rows_of(path):
    with Path(path).open(newline="") as file:
        return list(csv.DictReader(file))


@pytest.fixture(scope="module")
def bag(tmp_path_factory):
    return scene.write_color_bag(tmp_path_factory.mktemp("bags") / "walk", FRAMES, later=0.002)


@pytest.fixture(scope="module")
def films(tmp_path_factory):
    return scene.write_videos(tmp_path_factory.mktemp("films") / "walk", FRAMES)


def test_regions_are_drawn_where_it_is_asked_for(tmp_path):
    bag = scene.write_color_bag(tmp_path / "walk", 2)
    drawn = {}
    for name, words in (("plain", ()), ("regions", ("--draw-regions",))):
        done = run("track", bag, "--out", tmp_path / "pose.csv", "--overlay", tmp_path / name, *words)
        assert done.exit_code == 0, done.stderr
        drawn[name] = [cv2.imread(str(picture)) for picture in sorted((tmp_path / name).iterdir())]
    assert len(drawn["regions"]) == 2
    for plain, regions in zip(drawn["plain"], drawn["regions"], strict=True):
        changed = (np.abs(plain.astype(int) - regions).max(axis=2) > 30).mean()
        assert 0.002 < changed < 0.5, changed


def test_a_bag_of_color_topics_and_a_folder_of_videos_give_rows(bag, films, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for folder, first in ((bag, scene.START), (films, 0.0)):
        done = run("track", folder, "--out", "pose.csv", "--overlay", "look")
        assert done.exit_code == 0, done.stderr
        rows = rows_of("pose.csv")
        assert [float(row["stamp_s"]) for row in rows] == pytest.approx(
            [first + k / scene.RATE for k in range(FRAMES)], abs=1e-6
        )
        truth = scene.sequence(FRAMES).truth(0.0)[1]
        at = np.array([float(rows[0][f"l_knee_{axis}"]) for axis in "xyz"])
        assert np.linalg.norm(at - truth["l_knee"]) < 0.10, "where it was put, in the frame `world`"
        pictures = sorted(Path("look").iterdir())
        picture = cv2.imread(str(pictures[0]))
        height, width = picture.shape[:2]
        assert len(pictures) == FRAMES and abs(width / height - 4 / 3) < 0.01, "two by two"
        # What the cameras saw is there: red shirts in every quarter.
        for part in (picture[: height // 2], picture[height // 2 :]):
            for quarter in np.hsplit(part, 2):
                blue, green, red = (quarter[..., channel].astype(int) for channel in range(3))
                assert ((red > 110) & (blue < 90) & (green < 90)).sum() > 100
        shutil.rmtree("look")


def test_info_reports_what_is_there(bag, films):
    for folder, loader in ((bag, "ros2"), (films, "videos")):
        done = run("info", folder)
        assert done.exit_code == 0, done.stderr
        for words in (
            loader,
            "root frame world",
            "12 joints, 10 stamps, exact",
            "pictures of the empty scene",
            "240x180",
        ):
            assert words in done.stdout


def test_eval_measures_joints_and_angles(films, tmp_path):
    done = run("eval", films, "--out", tmp_path / "report")
    assert done.exit_code == 0, done.stderr
    assert "mean joint error" in done.stdout and "error of the joint angles" in done.stdout
    (row,) = rows_of(tmp_path / "report" / "sequences.csv")
    assert row["failure"] == "" and int(row["frames"]) == FRAMES
    assert float(row["error_m"]) < 0.015 and float(row["within_10cm"]) == 1.0
    assert float(row["angle_error_deg"]) < 4.0 and float(row["lost_share"]) == 0.0


def test_errors_report_what_is_needed(films, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    plain = shutil.copytree(films, tmp_path / "plain")
    (plain / "init.json").unlink()
    done = run("track", plain)
    assert done.exit_code == 1 and "by color alone the body 'human' is not found" in done.stderr
    assert "--init FILE" in done.stderr and "'world'" in done.stderr
    done = run("track", plain, "--init", "auto")
    assert done.exit_code == 1 and "--init FILE" in done.stderr
    done = run("track", plain, "--init", films / "init.json", "--out", "p.csv")
    assert done.exit_code == 0 and len(rows_of("p.csv")) == FRAMES
    done = run("track", plain, "--init", films / "init.json", "--background", "nothing", "--out", "p.csv")
    assert done.exit_code == 1 and "expected pictures NAME.png" in done.stderr
    done = run("track", plain, "--people", "any", "--out", "p.csv")
    assert done.exit_code == 1 and "several people are found in depth images" in done.stderr
    (plain / "Calib_scene.toml").unlink()
    done = run("track", plain)
    assert done.exit_code == 1 and "the calibration of the cameras" in done.stderr and "[cam3]" in done.stderr


def test_cameras_are_chosen_by_topic_and_pictures_by_use(bag, films, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = run(
        "track", films, "--topic", "color=cam_1", "--topic", "color=cam_2", "--overlay", "look", "--out", "p.csv"
    )
    assert done.exit_code == 0, done.stderr
    height, width = cv2.imread(str(next(Path("look").iterdir()))).shape[:2]
    assert width / height == pytest.approx(8 / 3, abs=0.01)
    # A bag that has depth too: with --use color a row is a picture's, and depth is not read.
    entries = scene.bag_entries(3, 2)
    depth = np.full((scene.CAMERA.height, scene.CAMERA.width), 2000, np.uint16)
    entries.append(("/d/depth/camera_info", scene.START, scene.info_of(scene.START, 0)))
    entries.append(
        ("/d/depth/image", scene.START, scene.M.image(scene.START, depth, "16UC1", frame="cam_0_optical_frame"))
    )
    write_bag(tmp_path / "both", entries)
    init = bag / "init.json"
    assert run("track", "both", "--init", init, "--use", "color", "--out", "c.csv").exit_code == 0
    assert run("track", "both", "--init", init, "--out", "d.csv").exit_code == 0
    assert (len(rows_of("c.csv")), len(rows_of("d.csv"))) == (3, 1)


def test_damaged_pictures_cost_no_recording(bag, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    entries, rest = [], scene.bag_entries(FRAMES, 4)
    for index, (topic, time, message) in enumerate(rest):
        if topic == "/cam_1/image_raw/compressed" and index > 40:
            message.data = message.data[: len(message.data) // 2]
        if topic.endswith("compressed") and time == pytest.approx(scene.START + 5 / scene.RATE):
            message.data = message.data[:3]  # no camera saw this instant
        entries.append((topic, time, message))
    write_bag(tmp_path / "b", entries)
    done = run("track", "b", "--init", bag / "init.json", "--out", "p.csv")
    assert done.exit_code == 0, done.stderr
    rows = rows_of("p.csv")
    assert len(rows) == FRAMES and "left out" in done.stderr and rows[5]["residual_m"] == ""
    truth = scene.sequence(FRAMES).truth((FRAMES - 1) / scene.RATE)[1]
    assert (
        np.linalg.norm([float(rows[-1][f"l_knee_{axis}"]) - truth["l_knee"][k] for k, axis in enumerate("xyz")]) < 0.05
    )
    assert run("track", "b", "--init", bag / "init.json", "--out", "p.csv", "--strict").exit_code == 1


class Recorder:
    """A frame that keeps what it is given."""

    def __init__(self, stamp):
        self.stamp, self.colors = stamp, []

    def add_color(self, image, **about):
        self.colors.append((image, about))


def test_the_front_end_hands_over_pinhole_pictures_with_their_own_stamps(bag, monkeypatch):
    import voodoo.pipeline.front_end as module

    recording = open_recording(bag)
    tracker = start_tracker(recording)
    displayed = []
    monkeypatch.setattr(
        type(tracker), "set_background", lambda _, source, images: displayed.append((source, len(images)))
    )
    monkeypatch.setattr(module, "Frame", Recorder)
    front_end = FrontEnd(tracker, settings=FrontEndSettings.of(recording))
    frames = [front_end.frame(recorded) for recorded in list(recording)[:2]]
    assert sorted(displayed) == [(f"/cam_{n}/image_raw/compressed", 2) for n in range(4)], "once a camera"
    for frame in frames:
        reported = {about["source"]: about for _, about in frame.colors}
        for n in range(4):
            about = reported[f"/cam_{n}/image_raw/compressed"]
            assert about["stamp"] == pytest.approx(frame.stamp + 0.002 * n, abs=1e-6)
            assert not about["camera"].distorted
            np.testing.assert_allclose(about["world_from_sensor"], scene.pose(n), atol=1e-9)
    assert json.loads((bag / "init.json").read_text())["height_m"] == 1.75
