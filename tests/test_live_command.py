"""`voodoo live` with played recordings and growing folders: files, reports, signals, and what is read again."""

import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import cv2
import numpy as np
import pytest
import typer.testing

import voodoo
from live_rig import Rig, depth_of, follower_of
from voodoo.cli import app
from voodoo.cli.common import NO_POSE
from voodoo.errors import VoodooError
from voodoo.export.people import PeopleTrack
from voodoo.export.track import Track
from voodoo.live import FAULTS, Follower
from voodoo.live.assembly import LiveFrame
from voodoo.live.clock import HostClock
from voodoo.live.follow import Step
from voodoo.live.recorder import Recorder
from voodoo.live.session import Output, Session
from voodoo.live.source import Faults
from voodoo.live.sources.growing import GrowingSource
from voodoo.live.sources.played import PlayedSource
from voodoo.measurements import LaserScan, MarkerSet
from voodoo.recordings import open_recording, sample_path
from voodoo.recordings.left_out import LeftOut

ROOT = Path(__file__).resolve().parent.parent
FAST = ("--use", "depth")


def live(*words):
    result = typer.testing.CliRunner().invoke(app, ["live", *map(str, words)])
    return result


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """One run with everything."""
    folder = tmp_path_factory.mktemp("live")
    files = [folder / name for name in ("pose.csv", "pose.npz", "pose.bvh", "pose.trc")]
    words = [word for file in files for word in ("--out", file)]
    result = live(sample_path(), "--rate", "2", *words, "--record", folder / "take.mcap", "--report", folder / "r.json")
    assert result.exit_code == 0, result.output
    return folder, result


def test_the_report_counts_every_frame(run):
    report = json.loads((run[0] / "r.json").read_text())
    assert report["received"] == 90
    assert report["published"] + report["dropped"] + report["refused"] == 90
    assert report["published"] > 10
    assert report["faults"] == {}
    assert 0.0 < report["latency_ms"]["p50"] <= report["latency_ms"]["p99"] <= report["latency_ms"]["max"]
    assert 5.0 < report["rate_hz"] < 65.0
    assert report["latency_from"] == "when the frame was due"
    assert "Hz; latency" in run[1].output


def test_all_files_report_the_same(run):
    track = Track.load(run[0] / "pose.npz")
    report = json.loads((run[0] / "r.json").read_text())
    assert len(track) == report["processed"] and track.found.sum() == report["tracked"] > 0
    assert (np.diff(track.stamps) > 0).all()
    np.testing.assert_allclose(Track.load(run[0] / "pose.csv").joints, track.joints, atol=1e-6)
    assert (run[0] / "pose.bvh").read_text().startswith("HIERARCHY")
    assert {path.name for path in run[0].iterdir() if path.name.startswith(".")} == set()
    stamps = {depth_of(frame).stamp for frame in open_recording(sample_path(), use=("depth",))}
    assert set(track.stamps.tolist()) <= stamps, "stamps are those of the data"


def test_what_was_recorded_is_tracked_again(run):
    recording = open_recording(run[0] / "take.mcap")
    assert recording.root_frame == "base_link"
    before = {depth_of(frame).stamp: depth_of(frame) for frame in open_recording(sample_path(), use=("depth",))}
    assert len(recording) == len(Track.load(run[0] / "pose.npz"))
    for frame in recording:
        again, first = depth_of(frame), before[frame.stamp]
        assert np.array_equal(again.image, first.image)
        assert again.camera == first.camera
        np.testing.assert_allclose(again.root_from_sensor, first.root_from_sensor, atol=1e-12)
    assert {sensor.kind for sensor in recording.info().sensors} == {"depth", "scan", "color"}
    names = {topic.name for topic in recording._bag.topics}
    assert {"/tf", "/humans/bodies/p1/joint_states", "/humans/bodies/p1/markers"} <= names


def test_measurements_of_classes_of_ones_own_are_recorded_as_what_they_are(tmp_path):
    class Own(LaserScan):
        """Adapters accept it."""

    recorder = Recorder(tmp_path / "take.mcap", root_frame=lambda: "base_link")
    own = Own("laser", 1.0, np.full(5, 2.0, np.float32), -0.2, 0.1, 0.1, 10.0, np.eye(4))
    markers = MarkerSet("suit", 1.0, {})
    frame = LiveFrame(1.0, (own, markers), number=0, taken=1.0, arrived=1.0, breaks=False)
    recorder.publish(Step(frame, estimates={}, bodies={}, seconds=0.0))
    recorder.close()
    (frame,) = open_recording(tmp_path / "take.mcap")
    assert [item.sensor for item in frame.measurements] == ["/laser/scan"]


def test_it_reports_that_it_stores_pictures_of_people(run):
    assert "stores pictures of people" in run[1].output


def test_poses_are_those_of_the_recording(run):
    """Every frame one after the other, without drops: bit by bit what the front end says of the recording."""
    recording = open_recording(sample_path(), use=("depth", "scan"), bare=True)
    rig = Rig(follower_of(), source=PlayedSource(recording))
    rig.live.sources[0].open(rig.clock, rig.live.faults)
    for number, _ in zip(range(25), recording, strict=False):
        rig.clock.at = 1_700_000_000.0 + number / 30 + 1e-6
        rig.deliver(*rig.live.sources[0].read(0.0))
    from voodoo.pipeline.front_end import FrontEnd, FrontEndSettings
    from voodoo.pipeline.pairing import paired

    settings = FrontEndSettings(use=("depth", "points", "scan"), ground_z=0.0)
    front_end = FrontEnd(voodoo.Tracker(voodoo.Body.human()), settings=settings)
    for recorded, step in zip(paired(recording), rig.steps, strict=False):
        expected = front_end.step(recorded)
        assert step.stamp == expected.stamp
        assert np.array_equal(step.estimates[1].joint_positions, expected.joint_positions)
    assert len(rig.steps) == 25
    assert rig.counts == {}


def test_damage_in_a_recording_is_a_fault(tmp_path):
    """Of a copy of the first images as PNG files one is cut off; the others are tracked."""
    frames = list(open_recording(sample_path(), use=("depth",)))[:12]
    (tmp_path / "cut" / "depth").mkdir(parents=True)
    (tmp_path / "cut" / "calibration.toml").write_text(calibration_of(depth_of(frames[0])))
    for path, data, number in grown(tmp_path / "cut", frames):
        path.write_bytes(data[:500] if number == 7 else data)
    result = live(tmp_path / "cut", "--report", tmp_path / "r.json")
    assert result.exit_code == 0, result.output
    report = json.loads((tmp_path / "r.json").read_text())
    assert report["faults"] == {"unreadable message": 1}
    assert report["received"] == 11
    assert "unreadable message" in result.output


def test_what_a_recording_assumes_and_notes_is_reported_once(tmp_path):
    frames = list(open_recording(sample_path(), use=("depth",)))[:3]
    (tmp_path / "walk" / "depth").mkdir(parents=True)
    (tmp_path / "walk" / "calibration.toml").write_text(calibration_of(depth_of(frames[0])))
    for path, data, number in grown(tmp_path / "walk", frames):
        path.with_stem(f"{number:05d}").write_bytes(data)
    left_out, messages = LeftOut(), []
    source = PlayedSource(
        open_recording(tmp_path / "walk", left_out=left_out), rate=1000.0, loop=True, left_out=left_out
    )
    source.open(HostClock(), Faults(messages.append))
    left_out.notes["the clock was set back"] = None
    for _ in range(20):
        source.read(0.1)
    assert [words.partition(";")[0] for words in messages] == [
        "depth/ is numbered, and taken for 30 images/s",
        "walk: the clock was set back",
    ]


def test_several_people_have_ids(tmp_path):
    # At its own pace: who moves four times as fast, in the few frames that a busy machine has time for, is nobody.
    result = live(sample_path(), "--people", "any", "--out", tmp_path / "all.csv", *FAST)
    assert result.exit_code == 0, result.output
    assert set(PeopleTrack.load(tmp_path / "all.csv").tracks) == {1}


def test_a_loop_goes_on_in_time(tmp_path):
    words = ("--rate", "8", "--loop", "--duration", "1.2", *FAST)
    result = live(sample_path(), *words, "--out", tmp_path / "p.csv", "--report", tmp_path / "r.json")
    assert result.exit_code == 0, result.output
    stamps = Track.load(tmp_path / "p.csv").stamps
    assert (np.diff(stamps) > 0).all()
    assert stamps[-1] - stamps[0] > 5.0, "longer than the recording"
    assert json.loads((tmp_path / "r.json").read_text())["faults"] == {}


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM], ids=["SIGINT", "SIGTERM"])
def test_signals_finish_files(tmp_path, number):
    often = "import voodoo.cli.live_run as run; run._LINE_S = 0.2"
    code = f"import sys; {often}; from voodoo.cli import main; sys.argv[0] = 'voodoo'; main()"
    words = ["live", str(sample_path()), "--loop", "--out", "p.csv", "--record", "t.mcap", "--report", "r.json", *FAST]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    with subprocess.Popen(
        [sys.executable, "-c", code, *words], cwd=tmp_path, env=environment, stderr=subprocess.PIPE, text=True
    ) as process:
        for line in process.stderr:
            if "Hz" in line:
                break
        process.send_signal(number)
        messages = process.communicate(timeout=20)[1]
    assert process.returncode == {signal.SIGINT: 130, signal.SIGTERM: 143}[number], messages
    report = json.loads((tmp_path / "r.json").read_text())
    assert len(Track.load(tmp_path / "p.csv")) == report["processed"] > 0
    assert len(open_recording(tmp_path / "t.mcap")) == report["processed"]
    assert "wrote p.csv" in messages


@pytest.mark.parametrize(
    ("words", "messages"),
    [
        (["nowhere"], "expected a recording, realsense, oak, orbbec, ros2:TOPIC or grow:FOLDER, found no such file"),
        (["ros2:,"], "ros2:TOPIC"),
        (
            ["ros2:/depth", "--topic", "depth=/depth"],
            "ros2:/depth: expected no depth_topic, found some; options: frame, meters_per",
        ),
        (["grow:.", "--loop", "--frame", "odom"], "grow:.: expected no frame, loop, found some; options: none"),
        ([sample_path(), "--rate", "0"], "rate: expected a number above 0"),
        ([sample_path(), "--out", "pose.xyz"], "expected a name that ends in"),
        ([sample_path(), "--calibration", "a.toml"], "a recording brings its own"),
        ([sample_path(), "--record", "take.bag"], "expected a name that ends in .mcap"),
        ([sample_path(), "--calibration", "a.toml", "--calibration", "b.toml"], "one for each source at most"),
    ],
    ids=str,
)
def test_what_cannot_be_is_refused_in_a_line(words, messages):
    result = live(*words, "--duration", "0.1")
    assert result.exit_code in (1, 2), result.output
    assert messages in " ".join(result.output.split())
    assert "Traceback" not in result.output


class Nowhere(Output):
    """A place to which poses are sent."""

    def publish(self, step):
        pass


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("ros2:/depth",), ["ros2://"]),
        (("ros2:/depth", "--no-publish"), []),
        (("ros2:/depth", "--to", "ros2://"), ["ros2://"]),
        (("ros2:/depth", "--to", "vmc://here"), ["vmc://here", "ros2://"]),
        ((sample_path(), "--use", "depth"), []),
        ((sample_path(), "--use", "depth", "--publish"), ["ros2://"]),
    ],
    ids=lambda words: " ".join(str(word) for word in words if word != sample_path()),
)
def test_what_comes_from_ros_is_published_there_by_default(monkeypatch, words, expected):
    addresses, source = [], played(8.0)

    def sink(address, **how):
        addresses.append(address)
        return Nowhere()

    monkeypatch.setattr("voodoo.cli.live_run.sink_of", sink)
    monkeypatch.setattr("voodoo.live.open", lambda *sources, **how: source)
    result = live(*words, "--duration", "0.1")
    assert result.exit_code in (0, NO_POSE), result.output
    assert addresses == expected


def test_a_box_around_everybody_leaves_nobody(tmp_path):
    result = live(sample_path(), "--rate", "8", *FAST, "--exclude", "0,-9,-9,9,9,9", "--report", tmp_path / "r.json")
    assert result.exit_code == NO_POSE and "nobody was found" in result.output
    report = json.loads((tmp_path / "r.json").read_text())
    assert report["tracked"] == report["with_pose"] == 0 < report["processed"]


@pytest.mark.parametrize("word", ["browser", "0", "127.0.0.1", "65535", "host:"])
def test_an_address_of_a_viewer_without_a_port_is_refused(word):
    from voodoo.visualization.rerun_server import Server

    with pytest.raises(VoodooError, match="expected PORT or HOST:PORT"):
        Server(word)


def test_missing_libraries_are_named():
    for word, extra, module in (
        ("realsense", "realsense", "pyrealsense2"),
        ("oak", "oak", "depthai"),
        ("orbbec", "orbbec", "pyorbbecsdk"),
        ("ros2:/depth", "ros2", "cyclonedds"),
    ):
        try:
            __import__(module)
        except ImportError:
            result = live(word, "--duration", "0.1")
            assert result.exit_code == 1
            assert f"voodoo-tracker[{extra}]" in result.output


# Stages


class Slow(Output):
    """Takes its time."""

    name = "slow"
    waiting = 1

    def __init__(self, seconds, *, waits=True, error=None):
        self.seconds, self.waits, self.error, self.stamps, self.closed = seconds, waits, error, [], False

    def publish(self, step):
        time.sleep(self.seconds)
        if self.error is not None:
            raise self.error
        self.stamps.append(step.stamp)

    def close(self):
        self.closed = True


def played(rate, **options):
    recording = open_recording(sample_path(), use=("depth",), bare=True)
    return voodoo.live.open(PlayedSource(recording, rate=rate), **options)


def follower(_frame):
    return Follower(voodoo.Tracker(voodoo.Body.human()))


def test_a_slow_viewer_holds_nobody_up():
    slow = Slow(0.4)
    with played(4.0) as source:
        session = Session(source, follower, outputs=[slow])
        while session.wait(0.05):
            pass
        session.finish()
    assert session.published > 2 * len(slow.stamps)
    # On a busy machine the source stalls, and what is said of that may come late as well.
    report = session.report()
    late = report["late_outputs"]["slow"] - (session.published - len(slow.stamps))
    assert 0 <= late <= 5 + report["faults"].get("stalled", 0)
    assert slow.closed


def test_a_frame_that_the_tracker_refuses_is_the_only_loss():
    class Refuses(Follower):
        asked = 0

        def step(self, frame):
            self.asked += 1
            if self.asked == 5:
                raise VoodooError("not this one")
            return super().step(frame)

    with played(6.0) as source:
        session = Session(source, lambda _: Refuses(voodoo.Tracker(voodoo.Body.human())))
        while session.wait(0.05):
            pass
        session.finish()
    report = session.report()
    assert report["refused"] == 1 and report["first_faults"]["refused"] == "not this one"
    assert session.published == report["received"] - report["dropped"] - 1 > 10


def test_an_output_that_fails_ends_the_session():
    failing = Slow(0.0, waits=False, error=VoodooError("disk full"))
    with played(3.0) as source:
        session = Session(source, follower, outputs=[failing])
        with pytest.raises(VoodooError, match="disk full"):
            while session.wait(0.05):
                pass
        session.live.stop()
        with pytest.raises(VoodooError, match="disk full"):
            session.finish()
    assert failing.closed


def test_in_overload_latency_stays_below_two_processing_times():
    """Four times as many images as can be published; a frame that waits is replaced by the next one, not queued."""
    busy_s = 0.044
    slow = Slow(busy_s, waits=False)
    with played(3.0) as source:
        session = Session(source, follower, outputs=[slow])
        while session.wait(0.05):
            pass
        session.finish()
    report = session.report()
    assert report["received"] == 90
    assert report["dropped"] > 45
    assert report["published"] + report["dropped"] == 90
    assert (np.diff(slow.stamps) > 0).all()
    # In a queue the latency would grow to the end: half of the frames would wait for more than a second.
    assert report["latency_ms"]["p50"] < 2e3 * busy_s + 150.0


# A folder that grows


def grown(folder, frames, *, start=0):
    for number, frame in enumerate(frames, start=start):
        item = depth_of(frame)
        suffix = (".png", ".pgm")[number % 2]
        done, data = cv2.imencode(suffix, item.image)
        assert done
        yield folder / "depth" / f"{item.stamp:.6f}{suffix}", data.tobytes(), number


def calibration_of(item):
    rows = ", ".join(str([float(value) for value in row]) for row in item.root_from_sensor)
    camera = item.camera
    return (
        f"width = {camera.width}\nheight = {camera.height}\nfx = {camera.fx}\nfy = {camera.fy}\ncx = {camera.cx}\n"
        f'cy = {camera.cy}\ndepth_factor = 1000.0\nroot_frame = "base_link"\nroot_from_sensor = [{rows}]\n'
    )


def test_new_images_of_a_folder_are_tracked(tmp_path):
    frames = list(open_recording(sample_path(), use=("depth",)))[:12]
    (tmp_path / "depth").mkdir()
    (tmp_path / "calibration.toml").write_text(calibration_of(depth_of(frames[0])))
    (tmp_path / "depth" / "1.000000.png").write_bytes(b"what lay there before is left")
    rig = Rig(follower_of(), source=GrowingSource(tmp_path))
    source = rig.live.sources[0]
    source.open(rig.clock, rig.live.faults)
    for path, data, number in grown(tmp_path, frames):
        half = len(data) // 2
        if number % 3 == 0:  # it is looked at while it is written
            path.write_bytes(data[:half])
            rig.deliver(*source.read(0.0))
        path.write_bytes(data)
        rig.clock.at += 1 / 30
        rig.deliver(*source.read(0.0))
    assert [frame.stamp for frame in rig.frames] == pytest.approx([depth_of(frame).stamp for frame in frames], abs=1e-6)
    for one, frame in zip(rig.frames, frames, strict=True):
        assert np.array_equal(one.measurements[-1].image, depth_of(frame).image)
    assert rig.counts == {}
    assert str(rig.steps[-1].estimates[1].status) == "tracking"
    (tmp_path / "depth" / "1700201009.000000.png").write_bytes(b"no picture")
    rig.deliver(*source.read(0.0))
    rig.clock.at += 1.0
    rig.deliver(*source.read(0.0))
    assert rig.counts["damaged picture"] == 1


def test_a_folder_may_come_later_and_go(tmp_path):
    messages, frames = [], list(open_recording(sample_path(), use=("depth",)))[:4]
    folder = tmp_path / "later"
    with voodoo.live.open(f"grow:{folder}", on_message=messages.append) as source:
        assert source.next(0.05) is None
        assert source.status == "waiting"
        (folder / "depth").mkdir(parents=True)
        (folder / "calibration.toml").write_text(calibration_of(depth_of(frames[0])))
        until = time.monotonic() + 5.0
        while not any("there again" in line for line in messages) and time.monotonic() < until:
            time.sleep(0.01)
        for path, data, _ in grown(folder, frames[:1]):
            path.write_bytes(data)
        assert source.next(5.0).stamp == depth_of(frames[0]).stamp
        shutil.rmtree(folder)
        until = time.monotonic() + 5.0
        while "gone" not in source.faults.counts and time.monotonic() < until:
            time.sleep(0.01)
    assert source.faults.counts["gone"] == 1
    assert any("waiting for it" in line for line in messages)


def test_the_guide_names_every_fault():
    text = (ROOT / "docs/how-to/live.md").read_text(encoding="utf-8")
    assert [name for name in FAULTS if f"`{name}`" not in text] == []


def test_threads_end():
    before = threading.active_count()
    with played(8.0) as source:
        assert source.next(2.0) is not None
    assert threading.active_count() == before
