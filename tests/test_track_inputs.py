"""`voodoo track` on the bundled recording with everything it can read and write."""

import csv
import json
import re
from dataclasses import replace
from itertools import islice
from pathlib import Path

import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from typer.testing import CliRunner

import voodoo
from test_exports import read_bvh
from voodoo import cli
from voodoo.cli import running
from voodoo.errors import RecordingError, VoodooError
from voodoo.export import write_trc
from voodoo.export.track import Track
from voodoo.pipeline.inputs import join
from voodoo.pipeline.run import track
from voodoo.pipeline.start import start_tracker
from voodoo.recordings import ColorImage, DepthImage, KeypointImage, MarkerSet, Recording, open_recording, sample_path
from voodoo.recordings.joined import Joined
from voodoo.recordings.keypoint_layouts import layout_of
from voodoo.recordings.marker_files import MarkerMap, MarkerRecording
from voodoo.recordings.marker_trajectories import read_trc
from voodoo.sensors.pixels import in_sensor
from voodoo.sensors.settings import FrontEndSettings

FRAMES = 8
COLOR = "/camera/color/image_raw/compressed"


class Short(Recording):
    """The first frames of another recording."""

    def __init__(self, recording, frames=FRAMES):
        self.recording, self.frames = recording, frames
        for name in ("path", "name", "root_frame", "start", "reference"):
            setattr(self, name, getattr(recording, name))

    def __len__(self):
        return self.frames

    def __iter__(self):
        return islice(iter(self.recording), self.frames)

    def info(self):
        return replace(self.recording.info(), frames=self.frames, duration=(self.frames - 1) / 30.0)


@pytest.fixture
def run(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(running, "open_recording", lambda path, **options: Short(open_recording(path)))

    def call(*arguments):
        return CliRunner().invoke(cli.app, ["track", str(sample_path()), *map(str, arguments)], env={"COLUMNS": "200"})

    return call


def truth_as_track(names):
    reference = open_recording(sample_path()).reference
    columns = [reference.names.index(name) for name in names]
    count = len(reference.stamps)
    return Track(
        reference.stamps, ("tracking",) * count, np.zeros(count), tuple(names), reference.positions[:, columns], (),
        np.empty((count, 0, 4, 4)),
    )  # fmt: skip


def errors_of(result, name):
    reference = open_recording(sample_path()).reference
    truth = reference.positions[: len(result), reference.names.index(name)]
    return np.linalg.norm(result.joints[:, result.joint_names.index(name)] - truth, axis=1)


def test_every_format_reports_the_same_to_an_independent_reader(run):
    outputs = ["p.csv", "p.npz", "p.bvh", "p.trc", "p.mcap", "bag"]
    done = run(*(word for path in outputs for word in ("--out", path)))
    assert done.exit_code == 0, done.stderr
    arrays = np.load("p.npz", allow_pickle=False)
    names = arrays["joint_names"].tolist()
    with Path("p.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == FRAMES
    wrist = arrays["joints"][:, names.index("l_wrist")]
    assert np.array([[float(row[f"l_wrist_{axis}"]) for axis in "xyz"] for row in rows]) == pytest.approx(
        wrist, abs=1e-5
    )
    angles = dict(zip(arrays["angle_names"].tolist(), arrays["angles"].T, strict=True))
    assert "l_elbow_flexion" in angles
    for name, values in angles.items():
        assert np.array([float(row[f"{name}_rad"]) for row in rows]) == pytest.approx(values, abs=1e-5)
    markers = read_trc("p.trc")
    assert markers.positions[:, markers.names.index("l_wrist")][:, [2, 0, 1]] == pytest.approx(wrist, abs=1e-5)
    assert read_bvh(Path("p.bvh"))
    for bag in (Path("p.mcap"), Path("bag")):
        with AnyReader([bag]) as reader:
            tf = [reader.deserialize(raw, c.msgtype) for c, _, raw in reader.messages() if c.topic == "/tf"]
        assert len(tf) == FRAMES
        assert tf[0].transforms[0].header.frame_id == "base_link"
        assert tf[0].transforms[0].child_frame_id == "body_p1"


def test_outputs_are_refused_before_the_work(run):
    Path("bag").mkdir()
    for words, message in (
        (("--out", "bag"), "found one that exists"),
        (("--out", "p.fbx"), ".bvh"),
        (("--use", "sonar"), "sonar"),
        (("--keypoints", "nothing"), "SENSOR=FOLDER"),
        (("--keypoints", "x=nothing"), "folder of OpenPose"),
        (("--with", "nothing"), "nothing"),
        (("--marker-map", "nothing.toml"), "nothing.toml"),
    ):
        done = run(*words)
        assert done.exit_code == 1, words
        assert message in done.stderr, done.stderr
    assert [path.name for path in Path().iterdir()] == ["bag"]


def test_a_marker_file_beside_the_recording(run):
    write_trc("m.trc", truth_as_track(["l_wrist", "r_wrist"]))
    done = run("--with", "m.trc", "--out", "p.npz")
    assert done.exit_code == 1
    assert "--offset" in done.stderr  # its clock starts at zero
    start = open_recording(sample_path()).info().start_stamp
    assert run("--with", "m.trc", "--offset", start, "--out", "with.npz").exit_code == 0
    assert run("--use", "depth", "--out", "depth.npz").exit_code == 0
    fused, alone = Track.load(Path("with.npz")), Track.load(Path("depth.npz"))
    for side in "lr":
        assert errors_of(fused, f"{side}_wrist").mean() < 0.7 * errors_of(alone, f"{side}_wrist").mean() + 0.002


def test_a_marker_file_alone_and_a_marker_on_a_limb(tmp_path):
    names = [name for name in open_recording(sample_path()).reference.names if not name.endswith("toe")]
    path = tmp_path / "m.trc"
    write_trc(path, truth_as_track(names))
    recording = open_recording(path)
    assert isinstance(recording, MarkerRecording)
    result = Track.of([step.estimate for step in track(Short(recording), start_tracker(recording))])
    assert np.mean([errors_of(result, name) for name in ("l_wrist", "r_ankle", "l_knee")]) < 0.03
    (tmp_path / "map.toml").write_text('limbs = { l_wrist = { limb = "l_forearm", position = [0.0, 0.0, 0.25] } }')
    with pytest.raises(VoodooError, match="l_wrist"):  # the name is taken
        start_tracker(recording, markers=MarkerMap.load(tmp_path / "map.toml"))
    (tmp_path / "map.toml").write_text("sigma_m = -1.0")
    with pytest.raises(RecordingError, match=r"map.toml: sigma_m"):
        MarkerMap.load(tmp_path / "map.toml")
    with pytest.raises(RecordingError, match="BACK"):
        MarkerRecording(path, MarkerMap(sites={"BACK": "vc7"}))


def keypoint_files(folder, recording, skip=0):
    """OpenPose files of the true joints in each color image."""
    folder.mkdir()
    layout = layout_of("body25b")
    reference = recording.reference
    pictures = [item for frame in recording for item in frame.measurements if isinstance(item, ColorImage)]
    for number, item in enumerate(pictures[skip:]):
        row = int(np.argmin(np.abs(reference.stamps - item.stamp)))
        rows = np.zeros((layout.count, 3))
        for part in layout.parts:
            if part.site in reference.names and len(part.weights) == 1:
                place = reference.positions[row, reference.names.index(part.site)]
                u, v = item.camera.project(in_sensor(item.root_from_sensor, [place]))[0]
                rows[next(iter(part.weights))] = u, v, 0.9
        person = {"pose_keypoints_2d": rows.ravel().tolist()}
        (folder / f"{number:04d}.json").write_text(json.dumps({"people": [person]}))


def test_keypoints_of_the_recordings_own_camera(run, tmp_path):
    recording = open_recording(sample_path())
    keypoint_files(tmp_path / "few", recording, skip=1)
    with pytest.raises(RecordingError, match="found 88"):
        join(recording, keypoints={COLOR: tmp_path / "few"})
    with pytest.raises(RecordingError, match="'/rear'"):
        join(recording, keypoints={"/rear": tmp_path / "few"})
    keypoint_files(tmp_path / "all", recording)
    (tmp_path / "all" / "0002.json").unlink()  # the others keep their images
    joined = join(recording, keypoints={COLOR: tmp_path / "all"})
    observed = [item for frame in Short(joined) for item in frame.measurements if isinstance(item, KeypointImage)]
    assert observed and [len(item.people) for item in observed] == [index != 2 for index in range(len(observed))]
    assert f"{COLOR}/keypoints" in str(joined.info())
    tracker = start_tracker(joined)
    steps = list(track(Short(joined), tracker, settings=FrontEndSettings.of(joined, use=("depth", "keypoints"))))
    given, matched, residual = steps[-2].estimate.sources[f"{COLOR}/keypoints"]
    assert given >= 8 and matched >= 0.8 * given and residual < 0.05


def test_keypoint_files_of_which_none_is_usable_are_refused(run, tmp_path):
    folder = tmp_path / "kept"
    keypoint_files(folder, open_recording(sample_path()))
    asked = ("--keypoints", f"{COLOR}={folder}", "--out", "p.csv")
    done = run(*asked, "--layout", "coco17")
    assert done.exit_code == 1 and "expected 17 keypoints for coco17, found 25" in done.stderr
    for file in folder.iterdir():
        file.write_text("")
    done = run(*asked)
    assert done.exit_code == 1 and f"{folder}: expected keypoint files with people" in done.stderr
    for file in folder.iterdir():
        file.write_text('{"people": []}')
    done = run(*asked)
    assert done.exit_code == 0 and f"{folder}: nobody is in these keypoint files" in done.stderr
    for file in folder.iterdir():
        file.unlink()
    done = run(*asked)
    assert done.exit_code == 1 and "found 0" in done.stderr


def test_keypoints_of_one_camera_need_depth_or_a_pose_and_their_layout_is_said(run, tmp_path):
    keypoint_files(tmp_path / "all", open_recording(sample_path()))
    asked = ("--keypoints", f"{COLOR}={tmp_path / 'all'}")
    for words in (("--init", "auto"), ("--people", "any")):
        done = run(*asked, "--use", "keypoints", *words, "--out", "p.csv")
        assert done.exit_code == 1 and "need depth beside them, or a second camera" in " ".join(done.stderr.split())
    done = run(*asked, "--use", "keypoints,depth", "--init", "auto", "--out", "p.csv")
    assert done.exit_code == 0 and "25 keypoints, taken for body25b; --layout says another" in done.stderr


@pytest.mark.parametrize(("times", "words"), [(0.5, "160x120 pixels (0.5 times"), (3.0, "960x720 pixels (3 times")])
def test_keypoints_beside_the_person_in_depth_are_refused(tmp_path, times, words):
    recording = open_recording(sample_path())
    keypoint_files(tmp_path / "other", recording)
    for file in (tmp_path / "other").iterdir():
        content = json.loads(file.read_text())
        rows = np.array(content["people"][0]["pose_keypoints_2d"]).reshape(-1, 3)
        rows[:, :2] *= times
        content["people"][0]["pose_keypoints_2d"] = rows.ravel().tolist()
        file.write_text(json.dumps(content))
    with pytest.raises(RecordingError, match=rf"on a person.*{re.escape(words)}"):
        join(recording, keypoints={COLOR: tmp_path / "other"})


def test_several_depth_cameras_count_by_their_names():
    recording = open_recording(sample_path())

    class Second(Short):
        def __iter__(self):
            for frame in super().__iter__():
                items = [replace(i, sensor="second") for i in frame.measurements if isinstance(i, DepthImage)]
                yield replace(frame, measurements=tuple(items))

    joined = Joined(Short(recording), [Second(recording)])
    frames = list(joined)
    assert all(sum(isinstance(item, DepthImage) for item in frame.measurements) == 2 for frame in frames)
    assert all(frame.measurements[-1].sensor == "/camera/depth/image_rect_raw" for frame in frames)
    settings = FrontEndSettings.of(joined, use=("depth",))
    for step in track(joined, start_tracker(joined), settings=settings):
        assert {"second", "/camera/depth/image_rect_raw"} <= set(step.estimate.sources)


def test_sensors_of_joined_recordings_have_names_of_their_own():
    recording = Short(open_recording(sample_path()))
    own = [sensor.name for sensor in recording.info().sensors]
    joined = Joined(recording, [recording, recording])
    names = [sensor.name for sensor in joined.info().sensors]
    assert names == [*own, *(f"bend_scoop{name}" for name in own), *(f"3/bend_scoop{name}" for name in own)]
    frames = [[item.sensor for item in frame.measurements] for frame in joined]
    assert {name for frame in frames for name in frame} == set(names)
    assert all(len(set(frame)) == len(frame) for frame in frames)


def test_depth_alone_is_the_same_frame_as_by_hand():
    """The front end adds nothing of its own to depth images: no filter, weight 1, the known floor."""
    recording = Short(open_recording(sample_path()))
    by_hand = start_tracker(recording)
    for step in track(recording, start_tracker(recording), settings=FrontEndSettings.of(recording, use=("depth",))):
        frame = voodoo.Frame(stamp=step.recorded.stamp)
        frame.set_ground(normal=(0.0, 0.0, 1.0))
        for item in step.recorded.measurements:
            if isinstance(item, DepthImage):
                frame.add_depth(
                    item.image,
                    camera=item.camera,
                    meters_per_unit=item.meters_per_unit,
                    world_from_sensor=item.root_from_sensor,
                    source=item.sensor,
                )
        assert np.array_equal(by_hand.step(frame).joint_positions, step.estimate.joint_positions)


def test_an_unknown_site_of_a_marker_is_left_out():
    recording = open_recording(sample_path())
    frame = next(iter(recording))
    odd = MarkerSet("suit", frame.stamp, {"tail": np.zeros(3), "l_wrist": recording.reference.positions[0, 0]})
    tracker = start_tracker(recording)
    settings = FrontEndSettings(use=("markers",))
    step = next(track(_One(recording, replace(frame, measurements=(odd,))), tracker, settings=settings))
    assert step.estimate.sources["suit"][0] == 1


class _One(Short):
    def __init__(self, recording, frame):
        super().__init__(recording, 1)
        self.frame = frame

    def __iter__(self):
        yield self.frame
