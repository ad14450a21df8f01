import json
import re
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

import commands
import voodoo
from core_fakes import T_POSE, FakeRecording, install
from voodoo import cli
from voodoo.cli import running
from voodoo.cli.common import NO_POSE
from voodoo.drawing.ink import LEFT, RIGHT
from voodoo.errors import RecordingError, VoodooError
from voodoo.evaluation import evaluate as evaluate_module
from voodoo.export.track import Track
from voodoo.pipeline.front_end import FrontEnd
from voodoo.pipeline.run import track
from voodoo.pipeline.start import Init, start_tracker
from voodoo.sensors.adapters.skin import SKIN
from voodoo.sensors.depth import DepthFilter
from voodoo.sensors.settings import FrontEndSettings


@pytest.fixture
def run(monkeypatch, tmp_path):
    """Run the command line on fakes in an empty folder; set `run.recording` to what is opened."""
    tracker = install(monkeypatch)
    monkeypatch.chdir(tmp_path)

    def opened(path, loader=None, *, left_out=None, bare=False, **options):
        call.left_out = left_out
        call.options = options | ({"bare": True} if bare else {})
        if call.recording is None:
            raise RecordingError(f"{path}: expected a recording, found\nno such file")
        return call.recording

    def call(*arguments):
        return CliRunner().invoke(cli.app, [str(argument) for argument in arguments], env={"COLUMNS": "200"})

    call.recording, call.tracker = FakeRecording(frames=12), tracker
    tracker.reference = call.recording.reference
    for module in (running, evaluate_module):
        monkeypatch.setattr(module, "open_recording", opened)
    return call


def assert_one_line(result, code, *words):
    assert result.exit_code == code
    first, *more = result.stderr.splitlines()
    assert first.startswith("voodoo: ") and all(line.startswith("  ") for line in more), result.stderr
    for word in words:
        assert word in " ".join(result.stderr.split())


@pytest.mark.parametrize(
    ("command", "words"),
    [
        ((), ("track", "demo", "init", "eval", "config", "info", "body", "--version")),
        (
            ("track",),
            (
                "--init",
                "--body",
                "--height",
                "--config",
                "--out",
                "--overlay",
                "--frame",
                "--loader",
                "--topic",
                "l_shoulder",
                "Examples",
            ),
        ),
        (("eval",), ("--out", "--jobs", "--only", "--config", "sequences.csv")),
        (("init",), ("--at", "--out", "--exclude", "stamp", "Examples")),
        (("demo",), ("--out", "sheet.png")),
    ],
)
def test_help_teaches(run, command, words):
    result = run(*command, "--help")
    assert result.exit_code == 0
    for word in words:
        assert word in result.stdout


def test_track_writes_csv(run):
    result = run("track", "somewhere", "--out", "pose.csv")
    assert result.exit_code == 0, result.stderr
    assert "12 frames, 12 tracking; wrote pose.csv" in result.stdout
    assert result.stderr == ""
    written = Track.load(Path("pose.csv"))
    assert written.joints[-1, written.joint_names.index("l_wrist")] == pytest.approx(
        np.add(T_POSE["l_wrist"], (0.11, 0.0, 0.0))
    )


def test_track_default_name_and_npz_and_overlay(run):
    assert run("track", "somewhere").exit_code == 0
    assert Path("fake.csv").is_file()
    assert run("track", "somewhere", "--out", "pose.npz", "--overlay", "look.mp4").exit_code == 0
    assert Track.load(Path("pose.npz")).world_from_limb.shape == (12, 10, 4, 4)
    assert cv2.VideoCapture("look.mp4").get(cv2.CAP_PROP_FRAME_COUNT) == 12
    assert run("track", "somewhere", "--overlay", "look").exit_code == 0
    assert len(list(Path("look").glob("*.png"))) == 12


def test_track_passes_frame_and_init(run):
    moved = {name: [x, y, z + 0.5] for name, (x, y, z) in T_POSE.items()}
    Path("start.json").write_text(json.dumps({"height_m": 1.6, "joints": moved}))
    run.tracker.reference = None
    result = run("track", "somewhere", "--init", "start.json", "--frame", "odom", "--out", "pose.csv")
    assert result.exit_code == 0, result.stderr
    assert run.options == {"root_frame": "odom", "bare": True}  # what lies beside it is not asked for
    written = Track.load(Path("pose.csv"))
    assert written.joints[0, written.joint_names.index("l_hip"), 2] == pytest.approx(T_POSE["l_hip"][2] + 0.5)


def test_track_without_start_searches_for_a_person(run):
    """One row a frame with its stamp; empty cells until the person is found, and when they are gone."""
    run.recording = FakeRecording(frames=8, start=False)
    run.tracker.found_at, run.tracker.gone_at = 2, 6
    done = run("track", "somewhere", "--out", "pose.csv", "--out", "pose.npz", "--overlay", "look.mp4")
    assert_one_line(done, 0, "only 50 % of the frames are tracking")
    assert "8 frames, 4 searching, 4 tracking" in done.stdout and "50 % searching, 50 % tracking (docs" in done.stdout
    rows = [row.split(",") for row in Path("pose.csv").read_text().splitlines()[1:]]
    assert [float(row[0]) for row in rows] == run.recording.stamps.tolist()
    status = ["searching"] * 2 + ["tracking"] * 4 + ["searching"] * 2
    assert [row[2] for row in rows] == status
    assert [set(row[3:]) == {""} for row in rows] == [word == "searching" for word in status]
    for name in ("pose.csv", "pose.npz"):
        read = Track.load(name)
        assert list(read.status) == status and read.found.tolist() == [word == "tracking" for word in status]
        assert np.isnan(read.joints[~read.found]).all() and np.isfinite(read.joints[read.found]).all()
        assert np.isnan(read.angles[~read.found]).all() and np.isnan(read.residual[~read.found]).all()
    assert np.isnan(np.load("pose.npz")["world_from_limb"][:2]).all()
    assert cv2.VideoCapture("look.mp4").get(cv2.CAP_PROP_FRAME_COUNT) == 8


def test_nobody_found_is_a_result_and_one_line(run):
    run.recording = FakeRecording(frames=3, start=False)
    done = run("track", "somewhere", "--out", "pose.csv", "--out", "pose.npz")
    assert_one_line(done, NO_POSE, "nobody was found in 3 frames")
    assert "3 frames, 3 searching; wrote pose.csv" in done.stdout
    for name in ("pose.csv", "pose.npz"):
        read = Track.load(name)
        assert read.status == ("searching",) * 3 and read.joint_names == tuple(T_POSE)


def test_init_auto_leaves_the_recordings_start_alone(run):
    assert run("track", "somewhere", "--init", "auto", "--out", "pose.csv").exit_code == NO_POSE
    assert run.options == {"bare": True}
    assert Track.load("pose.csv").status == ("searching",) * 12  # this tracker finds nobody
    assert run("track", "somewhere", "--out", "pose.csv").exit_code == 0
    assert run.options == {}
    assert Track.load("pose.csv").status == ("tracking",) * 12


def test_init_for_a_time_starts_there(run):
    run.tracker.reference = None
    Path("start.json").write_text(json.dumps({"stamp_s": 1700200000.09, "joints": T_POSE}))
    assert run("track", "somewhere", "--init", "start.json", "--out", "pose.csv").exit_code == 0
    assert Track.load("pose.csv").status == ("searching",) * 3 + ("tracking",) * 9
    # Frames before it are not held against the track.
    Path("start.json").write_text(json.dumps({"stamp_s": 1700200000.25, "joints": T_POSE}))
    done = run("track", "somewhere", "--init", "start.json", "--out", "pose.csv")
    assert Track.load("pose.csv").status == ("searching",) * 8 + ("tracking",) * 4
    assert done.exit_code == 0 and "of the frames are tracking" not in done.stderr


def test_an_earlier_result_is_a_start(run):
    run.tracker.reference = None
    assert run("track", "somewhere", "--out", "before.csv").exit_code == 0
    before = Track.load("before.csv")
    for name in ("later.csv", "later.npz"):
        before.of_frames(np.arange(12) >= 4).save(name)
        assert run("track", "somewhere", "--init", name, "--out", "pose.csv").exit_code == 0
        assert Track.load("pose.csv").status == ("searching",) * 4 + ("tracking",) * 8
    Path("bad.csv").write_text("no result")
    assert_one_line(run("track", "somewhere", "--init", "bad.csv"), 1, "bad.csv", "stamp_s")


def test_init_writes_what_init_reads(run):
    run.recording = FakeRecording(frames=12)
    run.tracker.found_at, run.tracker.reference = 1, None
    done = run("init", "somewhere", "--at", "0.1")
    assert done.exit_code == 0, done.output
    assert run.options == {"bare": True}
    written = json.loads(done.stdout)
    # The fourth frame from 0.1 s on is the first one in which the tracker finds somebody who was looked for once.
    assert written["stamp_s"] == pytest.approx(1700200000.0 + 4 / 30.0)
    assert written["joints"]["l_wrist"] == list(T_POSE["l_wrist"])
    for at in ("1700200000.1", "0.1"):
        assert run("init", "somewhere", "--at", at, "--out", "start.json").exit_code == 0
        assert json.loads(Path("start.json").read_text()) == written
    assert Init.load(Path("start.json")).joints["l_wrist"] == T_POSE["l_wrist"]
    assert_one_line(run("init", "somewhere", "--at", "7"), 1, "--at: expected 0 to 0.367 s", "found 7")
    run.tracker.found_at = None
    assert_one_line(run("init", "somewhere"), NO_POSE, "found nobody")


def test_boxes_to_leave_out(run):
    for words in ("1,2,3", "a,0,0,1,1,1", "0,0,0,1,1,inf", "0,0,0,0,1,1"):
        assert_one_line(run("track", "x", "--exclude", words), 1, "exclude: expected")
    low, high = running.boxes_of(["1,-1,2,0,1,0"])[0]
    assert (low, high) == ((0.0, -1.0, 0.0), (1.0, 1.0, 2.0))
    assert run("track", "x", "--exclude", "0,0,0,1,1,1", "--exclude", "2,2,0,3,3,1", "--out", "p.csv").exit_code == 0
    assert run.tracker.last.excluded == [((0.0, 0.0, 0.0), (1.0, 1.0, 1.0)), ((2.0, 2.0, 0.0), (3.0, 3.0, 1.0))]


def test_eval_can_search_for_the_person(run):
    Path("a_depth.mat").touch()
    run.tracker.found_at = 4
    result = run("eval", "a_depth.mat", "--jobs", "1", "--init", "auto")
    assert result.exit_code == 0, result.output
    assert "frames without a pose | 33.3 %" in result.stdout
    assert run("eval", "a_depth.mat", "--init", "file.json").exit_code == 2


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("{", ("start.json", "JSON")),
        ('{"joints": {}}', ("start.json", "joints")),
        ('{"height_m": 1.7}', ("start.json", "joints", "found none")),
        ('{"joints": {"l_knee": [1, 2]}}', ("start.json", "joints.l_knee")),
        ('{"joints": {"l_knee": [1, 2, "x"]}}', ("start.json", "joints.l_knee.2", "'x'")),
        ('{"joints": {"l_knee": [1, 2, NaN]}}', ("start.json",)),
        ('{"height_m": 176, "joints": {"l_knee": [1, 2, 3]}}', ("start.json", "height_m", "176")),
        ('{"heigth_m": 1.7, "joints": {"l_knee": [1, 2, 3]}}', ("start.json", "heigth_m")),
        ('{"joints": {"left_nose": [1, 2, 3]}}', ("left_nose",)),
    ],
)
def test_bad_init_names_file_and_key(run, content, words):
    Path("start.json").write_text(content)
    assert_one_line(run("track", "somewhere", "--init", "start.json"), 1, *words)


def test_missing_files(run):
    assert_one_line(run("track", "somewhere", "--init", "none.json"), 1, "none.json")
    run.recording = None
    assert_one_line(run("track", "nowhere"), 1, "nowhere: expected a recording, found no such file")
    assert_one_line(run("info", "nowhere"), 1, "nowhere")


def test_usage_errors_end_with_2(run):
    assert run("track").exit_code == 2
    assert run("track", "x", "--bogus").exit_code == 2
    result = run("track", "x", "--height", "1.7", "--body", "b.toml")
    assert result.exit_code == 2
    assert "not both" in result.stderr
    assert "not both" in run("track", "x", "--height", "1.1", "--age", "6").stderr


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("track", "x", "--body", "b.toml", "--model", "papers"), "give --body or --model, not both"),
        (("ik", "x", "--body", "b.toml", "--model", "full"), "give --body or --model, not both"),
        (("body", "b.toml", "--model", "papers"), "give FILE or --model, not both"),
        (("body", "b.toml", "--height", "1.7"), "give FILE or --height, not both"),
        (("track", "x", "--view", "--save", "s.rrd"), "give --view or --save, not both"),
        (("eval", "x", "--use", "scan", "--depth-only"), "give --depth-only or --use, not both"),
        (("eval", "x", "--result", "r.csv", "--model", "full"), "give --result or --model, not both"),
        (("track", "x", "--offset", "0.5"), "--offset is for the stamps of --with"),
        (("track", "x", "--draw-regions"), "--draw-regions is for --overlay"),
    ],
)
def test_what_would_be_ignored_is_refused(run, arguments, words):
    result = run(*arguments)
    assert result.exit_code == 2 and words in result.stderr, result.stderr


def test_bad_result_name_is_refused_before_the_work(run):
    assert_one_line(run("track", "x", "--out", "pose.txt", "--overlay", "look"), 1, ".csv, .npz, .bvh")
    assert not Path("look").exists()


def test_a_refused_frame_is_left_out_and_counted(run):
    run.tracker.refuse_at = 4
    done = run("track", "x", "--out", "pose.csv", "--out", "pose.npz")
    assert_one_line(done, 0, "left out 1 that the tracker refuses", "fake, frame 4", "finite", "--strict")
    stamps = np.delete(run.recording.stamps, 4)
    assert Track.load("pose.csv").stamps.tolist() == Track.load("pose.npz").stamps.tolist() == stamps.tolist()
    assert Track.load("pose.npz").left_out == {"that the tracker refuses": 1}


def test_strictly_a_refused_frame_is_named_and_leaves_no_result(run):
    run.tracker.refuse_at = 4
    assert_one_line(run("track", "x", "--out", "pose.csv", "--strict"), 1, "fake, frame 4", "finite")
    assert run.left_out is None and not Path("pose.csv").exists()


def test_ctrl_c_leaves_the_frames_up_to_there_and_reports_so(run):
    run.tracker.interrupt_at = 4
    result = run("track", "x", "--out", "pose.csv", "--out", "pose.npz", "--overlay", "look.mp4")
    assert_one_line(result, 130, "interrupted", "4 frames", "12 frames", "pose.csv and pose.npz and look.mp4")
    assert not result.stdout
    for name in ("pose.csv", "pose.npz"):
        assert len(Track.load(name)) == 4
    assert cv2.VideoCapture("look.mp4").get(cv2.CAP_PROP_FRAME_COUNT) == 4


def test_ctrl_c_before_the_first_frame_leaves_nothing(run):
    run.tracker.interrupt_at = 0
    assert run("track", "x", "--out", "pose.csv").exit_code == 130
    assert run("demo", "--out", "demo").exit_code == 130
    run.tracker.interrupt_at = 2
    assert run("demo", "--out", "demo").exit_code == 130
    assert not Path("pose.csv").exists() and not Path("demo/pose.csv").exists()


def test_demo(tmp_path, monkeypatch):
    """With the tracker itself, on the bundled recording."""
    monkeypatch.chdir(tmp_path)
    result = commands.run("demo", "--out", "here")
    assert result.exit_code == 0, result.stderr
    assert "bend_scoop: 90 frames, " in result.stdout
    (error,) = re.findall(r"mean joint error  ([\d.]+) cm", result.stdout)
    assert 0.5 < float(error) < 6.0
    assert len(Track.load("here/pose.csv")) == 90
    assert cv2.VideoCapture("here/overlay.mp4").get(cv2.CAP_PROP_FRAME_COUNT) == 90
    assert sorted(path.name for path in Path("here").iterdir()) == ["overlay.mp4", "pose.csv", "sheet.png"]
    legend = cv2.imread("here/sheet.png")[-36:].reshape(-1, 3)
    for color in (LEFT, RIGHT, SKIN):
        assert (np.abs(legend.astype(int) - color).max(axis=1) < 4).sum() > 20, color


def test_eval_writes_reports_and_prints_the_table(run):
    Path("a_depth.mat").touch()
    Path("b_depth.mat").touch()
    result = run("eval", ".", "--jobs", "1", "--out", "report")
    assert result.exit_code == 0, result.stderr
    assert "class 0 / 1 / 2 (K06 Table I) | 0 / 0 / 2" in result.stdout
    assert {"sequences.csv", "summary.csv", "summary.md", "errors.png", "frames"} == {
        p.name for p in Path("report").iterdir()
    }


def test_eval_with_a_failure_still_reports_and_ends_with_1(run):
    Path("a_depth.mat").touch()
    run.tracker.refuse_at = 2
    result = run("eval", "a_depth.mat", "--jobs", "1", "--out", "report")
    assert_one_line(result, 1, "1 of 1 recordings failed", "frame 2")
    assert "frame 2" in Path("report/sequences.csv").read_text()


def test_config_body_info_version(run):
    assert run("config").stdout == "max_steps = 5\n"
    assert run("body", "--height", "1.6").stdout == "height_m = 1.6\n"
    assert "12 in 0.367 s" in run("info", "somewhere").stdout
    assert run("--version").stdout.startswith("voodoo ")


def test_measurements_reach_the_frame_with_pose_and_weight(run):
    recording = FakeRecording(frames=1, depth=False)
    settings = FrontEndSettings(scan_noise=None)
    frame = FrontEnd(start_tracker(recording), settings=settings).frame(next(iter(recording)))
    ((kind, shape, options),) = frame.calls
    assert (kind, shape, options["weight"], options["source"]) == ("points", (11, 3), 1.0, "scan")
    assert np.array_equal(options["world_from_sensor"], np.eye(4))
    recording = FakeRecording(frames=1)
    frame = FrontEnd(start_tracker(recording)).frame(next(iter(recording)))
    ((kind, shape, options),) = frame.calls
    assert (kind, shape, options["meters_per_unit"], options["weight"]) == ("depth", (60, 80), 0.001, 1.0)
    assert frame.stamp == 1700200000.0


def test_track_yields_one_estimate_a_frame_with_its_time(run):
    recording = FakeRecording(frames=4)
    steps = list(track(recording, start_tracker(recording)))
    assert [step.index for step in steps] == [0, 1, 2, 3]
    assert [step.estimate.stamp for step in steps] == recording.stamps.tolist()
    assert all(step.seconds > 0.0 for step in steps)


def test_numbers_for_the_loader(run):
    assert run("track", "x", "--option", "rate=30", "--option", "tf_max_age=2").exit_code == 0
    assert run.options == {"rate": 30.0, "tf_max_age": 2.0}
    assert run("info", "x", "--option", "meters_per_unit=0.00025").exit_code == 0
    assert run.options == {"meters_per_unit": 0.00025}
    for words in ("rate", "rate=fast", "depth=1"):
        assert_one_line(run("track", "x", "--option", words), 1, "NAME=NUMBER with one of rate, meters_per_unit", words)


def test_a_number_goes_to_the_recording_that_knows_it(run, monkeypatch, tmp_path):
    """A Pose2Sim folder beside a bag; what nobody knows is left to RECORDING's loader to refuse."""
    for name in ("bag", "people"):
        (tmp_path / name).mkdir()
    (tmp_path / "people" / "Calib_x.toml").touch()
    opened = []

    def other(path, left_out, bare, **options):
        opened.append((path.name, options))
        return FakeRecording(frames=12)

    monkeypatch.setattr("voodoo.pipeline.inputs.open_recording", other)
    words = ("--with", "people", "--option", "rate=30", "--option", "tf_max_age=2")
    assert run("track", "bag", "--loader", "ros2", *words).exit_code == 0
    assert run.options == {"tf_max_age": 2.0}
    assert opened == [("people", {"layout": None, "rate": 30.0})]
    assert run("track", "bag", "--loader", "ros2", *words[2:]).exit_code == 0
    assert run.options == {"tf_max_age": 2.0, "rate": 30.0}


def test_a_depth_range_is_two_distances(run):
    assert_one_line(run("track", "bag", "--depth-range", "far"), 1, "depth-range: expected NEAR,FAR", "'far'")
    assert_one_line(run("track", "bag", "--depth-range", "5,1"), 1, "0 <= nearest < farthest")
    assert running.depth_filter_of(None) is None
    assert running.depth_filter_of("0.5, 4") == DepthFilter(nearest=0.5, farthest=4.0)
    run.recording = FakeRecording(frames=3)
    result = run("track", "bag", "--depth-range", "0.5,4")
    assert result.exit_code == 0, result.output


def test_height_option_wins_over_the_start(run):
    recording = FakeRecording(frames=1)
    assert start_tracker(recording).initial.height == 1.76
    assert start_tracker(recording, height=1.6).initial.height == 1.6
    assert start_tracker(recording, init=Init(height_m=1.5, joints=dict(T_POSE))).initial.height == 1.5


def test_an_age_stands_for_a_stature(run):
    recording = FakeRecording(frames=1)
    ages = {2: 0.87, 6: 1.15, 10: 1.385, 40: 1.70}  # medians of the World Health Organization
    assert {age: round(start_tracker(recording, age=age).initial.height, 3) for age in ages} == ages
    for given in ({"height": 1.1}, {"body": voodoo.Body.human()}):
        with pytest.raises(VoodooError, match=f"at most one of them, found {next(iter(given))} and age"):
            start_tracker(recording, age=6, **given)
    for wrong, message in (
        ("six", "age: expected years"),
        (0.5, "age: expected 1 to 120 years"),
        (float("nan"), "age: "),
    ):
        with pytest.raises(VoodooError, match=message):
            start_tracker(recording, age=wrong)


def test_nothing_usable_is_no_pose(run):
    run.recording, run.tracker.refuse_at = FakeRecording(frames=1), 0
    assert_one_line(
        run("track", "somewhere"), NO_POSE, "at least one frame that can be used", "1 that the tracker refuses"
    )


def test_the_module_is_the_command():
    done = subprocess.run([sys.executable, "-m", "voodoo", "track"], capture_output=True, text=True, check=False)
    assert done.returncode == 2 and done.stderr.startswith("Usage: python -m voodoo track"), done.stderr


def test_eval_is_json_or_ten_rows(run):
    Path("a_depth.mat").touch()
    rows = [line for line in run("eval", "a_depth.mat", "--jobs", "1").stdout.splitlines() if line.startswith("| ")]
    assert len(rows) == 11 and rows[0] == "| | |"
    done = run("eval", "a_depth.mat", "--jobs", "1", "--json", "--out", "report")
    report = json.loads(done.stdout)
    assert report["recordings"][0]["tracking_class"] == 2 and report["summaries"][0]["sequences"] == 1
    assert "NaN" not in done.stdout and "wrote report/sequences.csv" in done.stderr
    run.tracker.refuse_at = 2
    failed = run("eval", "a_depth.mat", "--jobs", "1", "--json")
    assert failed.exit_code == 1 and "frame 2" in json.loads(failed.stdout)["recordings"][0]["failure"]


def test_progress_in_a_pipe_is_lines(run, monkeypatch):
    monkeypatch.setattr("voodoo.cli.common._LINE_S", 0.0)
    done = run("track", "somewhere", "--out", "pose.csv")
    assert "voodoo: fake: 7 of 12\n" in done.stderr and "\r" not in done.stderr and "\x1b" not in done.stderr


def test_no_line_of_an_error_is_long(run):
    run.recording = None
    names = " ".join(f"--with somewhere{number}" for number in range(40))
    done = run("track", "nowhere/" + "folder " * 60, *names.split())
    assert done.exit_code == 1 and len(done.stderr) > 400
    assert all(len(line) <= 200 for line in done.stderr.splitlines())


@pytest.mark.parametrize("words", [(), ("--out", "pose.npz")])
def test_a_minus_is_csv_on_stdout_and_nothing_else(run, words):
    done = run("track", "somewhere", "--out", "-", *words)
    assert done.exit_code == 0 and "12 frames, 12 tracking" in done.stderr, done.output
    Path("read.csv").write_text(done.stdout)
    assert run("track", "somewhere", "--out", "pose.csv").exit_code == 0
    assert Path("read.csv").read_text() == Path("pose.csv").read_text() and not Path("-").exists()
    assert all(name in done.stderr for name in words[1:])
