"""`voodoo track --init auto` and `voodoo init` on recordings made here: they read no pose that lies beside them."""

import json
import shutil
from itertools import islice

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

import voodoo
from test_starts import AROUND, CAMERA, keypoints, person
from voodoo import cli
from voodoo.export import write_trc
from voodoo.export.track import Track
from voodoo.pipeline.front_end import FrontEnd
from voodoo.recordings import open_recording, sample_path
from voodoo.recordings.pose2sim import SITES
from voodoo.sensors.settings import FrontEndSettings

FRAMES, EMPTY = 6, 2
"""In the first EMPTY frames nobody is in view."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A Pose2Sim folder of three cameras; its .trc is half a meter off."""
    path = tmp_path_factory.mktemp("starts") / "people"
    path.mkdir()
    text = []
    for number, pose in enumerate(AROUND, start=1):
        turn, place = pose[:3, :3].T, -pose[:3, :3].T @ pose[:3, 3]
        text += [
            f"[cam_{number:02d}]", f'name = "cam_{number:02d}"', f"size = [{CAMERA.width}.0, {CAMERA.height}.0]",
            f"matrix = {CAMERA.matrix.tolist()}", "distortions = [0.0, 0.0, 0.0, 0.0]",
            f"rotation = {cv2.Rodrigues(turn)[0].ravel().tolist()}", f"translation = {place.tolist()}",
        ]  # fmt: skip
        images = path / "keypoints" / f"cam{number:02d}_json"
        images.mkdir(parents=True)
        for index in range(FRAMES):
            rows = keypoints(moved(index), pose, noise=1.0, seed=10 * number + index)
            people = [{"pose_keypoints_2d": rows.ravel().tolist()}] if index >= EMPTY else []
            (images / f"{index:04d}.json").write_text(json.dumps({"people": people}))
    (path / "Calib_test.toml").write_text("\n".join(text) + "\n")
    names = {site: marker for marker, site in SITES.items()}
    known = [name for name in moved(0) if name in names]
    places = np.array([[moved(index)[name] for name in known] for index in range(FRAMES)]) + (0.5, 0.0, 0.0)
    wrong = Track(
        np.arange(FRAMES) / 60.0, ("tracking",) * FRAMES, np.zeros(FRAMES), tuple(names[name] for name in known), places,
        (), np.empty((FRAMES, 0, 4, 4)),
    )  # fmt: skip
    write_trc(path / "people.trc", wrong)
    return path


def moved(index):
    return person((2.5 + 0.01 * index, 0.0))


@pytest.fixture
def run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def call(*words):
        done = CliRunner().invoke(cli.app, [str(word) for word in words], env={"COLUMNS": "200"})
        assert done.exit_code == 0, done.output
        return done

    return call


def error_of(result, index):
    truth = moved(index)
    names = [name for name in ("l_shoulder", "r_hip", "l_knee", "r_wrist", "l_ankle") if name in result.joint_names]
    return np.mean([np.linalg.norm(result.joints[index, result.joint_names.index(n)] - truth[n]) for n in names])


def test_auto_is_the_same_without_what_lies_beside(run, folder, tmp_path):
    bare = tmp_path / "people"
    shutil.copytree(folder, bare)
    (bare / "people.trc").unlink()
    run("track", folder, "--init", "auto", "--out", "with.csv", "--out", "with.npz")
    run("track", bare, "--init", "auto", "--out", "without.csv", "--out", "without.npz")
    assert (tmp_path / "with.csv").read_bytes() == (tmp_path / "without.csv").read_bytes()
    result, other = Track.load("with.npz"), Track.load("without.npz")
    assert np.array_equal(result.world_from_limb, other.world_from_limb, equal_nan=True)
    assert result.status[:EMPTY] == ("searching",) * EMPTY and "searching" not in result.status[EMPTY:]
    assert max(error_of(result, index) for index in range(EMPTY, FRAMES)) < 0.05
    # Where no start lies beside the recording it is looked for by default; where one does, it is taken.
    run("track", bare, "--out", "default.csv")
    assert (tmp_path / "default.csv").read_bytes() == (tmp_path / "with.csv").read_bytes()
    run("track", folder, "--out", "given.csv")
    given = Track.load("given.csv")
    assert "searching" not in given.status and error_of(given, 0) > 0.3


def test_init_gives_the_first_pose_and_track_takes_it(run, folder, tmp_path):
    message = run("init", folder, "--out", "start.json")
    assert "pose at 0.033 s; wrote start.json" in message.stdout
    start = json.loads((tmp_path / "start.json").read_text())
    truth = moved(EMPTY)
    assert start["stamp_s"] == pytest.approx(EMPTY / 60.0) and start["frame"] == "world"
    assert np.mean([np.linalg.norm(np.subtract(start["joints"][n], truth[n])) for n in ("l_hip", "r_knee")]) < 0.05
    assert 1.6 < start["height_m"] < 1.9
    later = json.loads(run("init", folder, "--at", 0.06).stdout)
    assert later["stamp_s"] == pytest.approx(4 / 60.0)
    run("track", folder, "--init", "start.json", "--out", "pose.csv")
    result = Track.load("pose.csv")
    assert result.status[:EMPTY] == ("searching",) * EMPTY and error_of(result, FRAMES - 1) < 0.05
    run("track", folder, "--init", "pose.csv", "--out", "again.csv")
    again = Track.load("again.csv")
    assert again.status[:EMPTY] == ("searching",) * EMPTY and error_of(again, FRAMES - 1) < 0.05


def test_markers_are_measurements_not_a_start_beside(run, tmp_path):
    names = [name for name in moved(0) if not name.endswith(("toe", "hand"))]
    joints = np.array([[moved(index)[name] for name in names] for index in range(FRAMES)])
    gaps = joints.copy()
    gaps[:EMPTY, [names.index("l_hip"), names.index("r_hip"), names.index("vc7")]] = np.nan
    gaps[:EMPTY, [names.index("humanoid_root"), names.index("l_shoulder")]] = np.nan
    stamps = np.arange(FRAMES) / 60.0
    track = Track(
        stamps, ("tracking",) * FRAMES, np.zeros(FRAMES), tuple(names), joints, (), np.empty((FRAMES, 0, 4, 4))
    )
    write_trc("m.trc", track)
    text = (tmp_path / "m.trc").read_text().splitlines()
    for index in range(EMPTY):
        cells = text[6 + index].split("\t")
        for column, gap in enumerate(np.isnan(gaps[index]).ravel()):
            cells[2 + column] = "" if gap else cells[2 + column]
        text[6 + index] = "\t".join(cells)
    (tmp_path / "m.trc").write_text("\n".join(text) + "\n")
    assert open_recording("m.trc").start is not None and open_recording("m.trc", bare=True).start is None
    run("track", "m.trc", "--init", "auto", "--out", "pose.csv")
    result = Track.load("pose.csv")
    assert result.status[:EMPTY] == ("searching",) * EMPTY and "searching" not in result.status[EMPTY:]
    assert error_of(result, FRAMES - 1) < 0.03


def test_depth_alone_auto_initializes(run, tmp_path):
    """The bundled recording, with and without what lies beside it."""
    whole, bare = tmp_path / "rec", tmp_path / "bare" / "rec"
    shutil.copytree(sample_path(), whole)
    shutil.copytree(sample_path() / "bag", bare / "bag")
    for folder, name in ((whole, "with"), (bare, "without")):
        run("track", folder, "--init", "auto", "--use", "depth", "--out", f"{name}.csv")
    assert (tmp_path / "with.csv").read_bytes() == (tmp_path / "without.csv").read_bytes()
    result = Track.load("with.csv")
    assert "searching" not in result.status[5:] and result.status[-1] != "lost"


@pytest.mark.parametrize("box", [None, ((0.5, -3.0, -1.0), (6.0, 3.0, 3.0))])
def test_nobody_is_found_in_a_box_that_is_left_out(box):
    recording = open_recording(sample_path(), bare=True, use=("depth",))
    front_end = FrontEnd(
        voodoo.Tracker(voodoo.Body.human()), settings=FrontEndSettings(exclude=() if box is None else (box,))
    )
    found = [str(front_end.step(recorded).status) != "searching" for recorded in islice(recording, 3)]
    assert found[-1] == (box is None)
