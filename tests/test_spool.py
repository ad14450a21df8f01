"""Poses are on the disk while they are tracked: memory is flat, results are the same, and a kill costs little."""

import gc
import json
import os
import re
import signal
import struct
import subprocess
import sys
import time
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

import damage
import voodoo
from commands import run
from test_doors import track_of
from voodoo.errors import VoodooError
from voodoo.export.people import PeopleTrack
from voodoo.export.spool import Spool, recover
from voodoo.export.track import Track
from voodoo.pipeline.run import start_tracker, track
from voodoo.recordings import open_recording, sample_path
from voodoo.whole import KEPT

PROGRAM = "import sys; from voodoo.cli import main; sys.argv[0] = 'voodoo'; main()"
OFTEN = "import voodoo.cli.live_run as run; run._LINE_S = 0.2; "
"""Lines of `voodoo live` come more often than once a second."""
FORMATS = ("pose.csv", "pose.npz", "pose.bvh", "pose.trc")


def started(folder: Path, *words: object, **environment: str) -> subprocess.Popen[str]:
    """A command in a process of its own."""
    known = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), **environment}
    program = OFTEN + PROGRAM if words[0] == "live" else PROGRAM
    command = [sys.executable, "-c", program, *map(str, words)]
    return subprocess.Popen(command, cwd=folder, env=known, stderr=subprocess.PIPE, text=True)


def until(found, seconds=20.0):
    end = time.monotonic() + seconds
    while not (result := found()):
        assert time.monotonic() < end
        time.sleep(0.01)
    return result


@pytest.fixture(scope="module")
def short(tmp_path_factory):
    """The bundled recording's first second."""
    return damage.beginning(tmp_path_factory.mktemp("short") / "recording", 30)


@pytest.mark.parametrize("words", ["track --use depth", "track --use depth --people any", "ik --pictures none"])
def test_parts_are_the_whole(short, tmp_path, monkeypatch, words):
    monkeypatch.chdir(tmp_path)
    for together in (7, 1000):
        monkeypatch.setattr("voodoo.cli.running.TOGETHER", together)
        outputs = [word for name in FORMATS for word in ("--out", f"{together}/{name}")]
        done = run(*words.split(), short, *outputs)
        assert done.exit_code == 0, done.output
    written = sorted(file.name for file in Path("7").iterdir())
    assert written == sorted(file.name for file in Path("1000").iterdir()) and len(written) == 4
    for name in written:
        if name.endswith(".npz"):
            one, other = (np.load(f"{folder}/{name}") for folder in (7, 1000))
            assert set(one) == set(other)
            for array in one:
                np.testing.assert_array_equal(one[array], other[array], err_msg=array)
        else:
            assert Path("7", name).read_bytes() == Path("1000", name).read_bytes()


def test_a_killed_command_is_completed_by_the_next_one(tmp_path):
    """Its results take free names: there is one of an earlier command, and the next one will write the other."""
    (tmp_path / "pose.csv").write_text("of before")
    words = ("--loop", "--rate", "4", "--record", "take.mcap", "--out", "pose.csv", "--out", "pose.npz")
    with started(tmp_path, "live", sample_path(), *words) as process:
        until(lambda: len(list(tmp_path.glob(".pose.csv-*.voodoo/*.npz"))) >= 2)
        in_use = recover(tmp_path)
        process.kill()
        process.stderr.read()
    assert in_use == ([], []) and {file.name for file in tmp_path.iterdir() if file.name[0] != "."} == {"pose.csv"}
    done = run("track", sample_path(), "--use", "depth", "--out", tmp_path / "pose.npz")
    assert done.exit_code == 0 and done.stderr.count(": recovered ") == 3, done.stderr
    assert (tmp_path / "pose.csv").read_text() == "of before"
    assert len(Track.load(tmp_path / "pose.npz")) == 90
    rows, exact = Track.load(tmp_path / "pose.recovered.csv"), Track.load(tmp_path / "pose.recovered.npz")
    assert len(rows) == len(exact) >= 60 and rows.stamps.tolist() == exact.stamps.tolist()
    assert len(open_recording(tmp_path / "take.mcap")) > 30
    assert len(list(tmp_path.iterdir())) == 5


@pytest.mark.parametrize("words", ["track", "track --people any", "ik --pictures none"])
def test_recover_makes_all_formats_of_a_killed_command(short, tmp_path, monkeypatch, words):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("voodoo.cli.running.TOGETHER", 10)
    child = os.fork()
    if not child:
        kill = lambda *_, **__: os.kill(os.getpid(), signal.SIGKILL)  # noqa: E731
        monkeypatch.setattr("voodoo.export.spool.Spool.write", kill)
        run(*words.split(), short, *(word for name in FORMATS for word in ("--out", name)))
    assert os.waitpid(child, 0)[1] == signal.SIGKILL
    (hidden,) = tmp_path.iterdir()
    assert json.loads((hidden / KEPT).read_text())["paths"] == list(FORMATS)
    (hidden / "00000001.npz").write_bytes(b"damage")
    done = run("recover", ".")
    assert done.exit_code == 1 and "00000001.npz" in done.stderr and "4 files recovered" in done.stderr
    result = (PeopleTrack if "any" in words else Track).load("pose.npz")
    assert len(result) == 20 and not hidden.exists()


def test_what_others_left_is_not_followed_out_of_the_folder(tmp_path):
    hidden = tmp_path / "in" / ".pose.csv-abcdefgh.voodoo"
    hidden.mkdir(parents=True)
    (hidden / "out.mcap").write_text("recorded")
    (hidden / KEPT).write_text(json.dumps({"paths": ["../out.mcap"]}))
    done = run("recover", tmp_path / "in")
    assert done.exit_code == 0 and [file.name for file in tmp_path.iterdir()] == ["in"]
    assert (tmp_path / "in" / "out.mcap").read_text() == "recorded"
    hidden.mkdir()
    for note in ("[]", '{"paths": 3}', "{", '{"paths": ["a.csv"], "root_frame": "a"}'):
        (hidden / KEPT).write_text(note)
        assert run("recover", tmp_path / "in").exit_code == 1
    assert [file.name for file in (tmp_path / "in").iterdir()] == ["out.mcap", hidden.name]


def in_parts(paths, track, body):
    """A spool with the poses of each frame in a part of its own."""
    spool = Spool(paths, root_frame=lambda: "odom", together=1)
    for number in range(len(track)):
        spool.add(track.of_frames(np.array([number])), {1: body})
    return spool


def test_poses_that_a_format_cannot_hold_are_kept_and_recovered_as_arrays(tmp_path):
    body = voodoo.Body.human()
    track = track_of(body).of_frames(np.array([0, 2, 1]))  # a clock that was set back
    done, errors = in_parts([tmp_path / "pose.bvh", tmp_path / "pose.csv"], track, body).write()
    assert done == [tmp_path / "pose.csv"] and "rising times" in str(errors[0]) and "voodoo recover" in str(errors[1])
    assert recover(tmp_path) == ([tmp_path / "pose.bvh.npz"], [])
    assert Track.load(tmp_path / "pose.bvh.npz").stamps.tolist() == track.stamps.tolist()
    assert len(list(tmp_path.iterdir())) == 2


def test_a_leftover_that_cannot_be_recovered_is_named_and_kept(tmp_path):
    """And a format that fails there costs the others nothing, and is not tried again."""
    body = voodoo.Body.human()
    spool = in_parts(
        [tmp_path / "pose.csv", tmp_path / "pose.bvh"], track_of(body).of_frames(np.array([0, 2, 1])), body
    )
    (hidden,) = tmp_path.iterdir()
    note = json.loads((hidden / KEPT).read_text())
    (hidden / KEPT).write_text(json.dumps({name: note[name] for name in ("paths", "root_frame")}))  # an earlier version
    spool._hidden.close()
    parts = {part: part.read_bytes() for part in hidden.glob("*.npz")}
    for part in parts:
        part.write_bytes(b"damage")
    done, failed = recover(tmp_path)
    assert done == [] and f"{hidden}: expected poses that were tracked, found none" in str(failed[-1])
    for part, content in parts.items():
        part.write_bytes(content)
    done, (error,) = recover(tmp_path)
    assert done == [tmp_path / "pose.csv"] and "rising times" in str(error)
    assert recover(tmp_path) == ([tmp_path / "pose.bvh.npz"], []) and not hidden.exists()


def test_a_recording_whose_channel_has_no_schema_is_named_and_kept(tmp_path):
    bag = tmp_path / ".take.mcap-abcdefgh.voodoo" / "take.mcap" / "take.mcap"
    bag.parent.mkdir(parents=True)
    (bag.parents[1] / KEPT).write_text(json.dumps({"paths": ["take.mcap"]}))
    channel = struct.pack("<BQ", 4, 8) + struct.pack("<HHI", 1, 1, 0)
    message = struct.pack("<BQ", 5, 22) + bytes(22)
    chunk = bytes(32) + struct.pack("<Q", len(channel + message)) + channel + message
    bag.write_bytes(b"\x89MCAP0\r\n" + struct.pack("<BQ", 6, len(chunk)) + chunk)
    done, (error,) = recover(tmp_path)
    assert done == [] and isinstance(error, VoodooError) and str(bag.parents[1]) in str(error) and bag.exists()


@pytest.mark.parametrize(("command", "name"), [("track", "SIGINT"), ("track", "SIGTERM"), ("live", "SIGHUP")])
def test_every_signal_ends_a_command_with_what_there_is(tmp_path, command, name):
    """For others of live see test_live_command.py."""
    words = ("--overlay", "look.mp4") if command == "track" else ("--loop",)
    with started(tmp_path, command, sample_path(), "--use", "depth", "--out", "pose.csv", *words) as process:
        if command == "live":
            until(lambda: "Hz" in process.stderr.readline())
        else:
            until(lambda: list(tmp_path.glob(".look.mp4-*/look.mp4")))
        process.send_signal(getattr(signal, name))
        messages = process.communicate(timeout=20)[1]
    assert process.returncode == 128 + getattr(signal, name), messages
    assert len(Track.load(tmp_path / "pose.csv")) > 0 and not list(tmp_path.glob(".*"))


def test_a_signal_that_is_ignored_stays_ignored(tmp_path):
    """As below nohup."""
    command = f"trap '' HUP; exec {sys.executable} -c \"{PROGRAM}\" track {sample_path()} --use depth --out pose.csv"
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    with subprocess.Popen(["sh", "-c", command], cwd=tmp_path, env=environment, stdout=subprocess.DEVNULL) as process:
        until(lambda: list(tmp_path.glob(".pose.csv-*")))
        process.send_signal(signal.SIGHUP)
    assert process.returncode == 0 and len(Track.load(tmp_path / "pose.csv")) == 90


def test_what_cannot_be_drawn_or_shown_costs_no_pose(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("voodoo.visualization.overlay.Overlay.draw", lambda *_, **__: {}["a bug"])
    for people in ("1", "any"):
        done = run("track", sample_path(), "--people", people, "--out", "pose.csv", "--overlay", "look.mp4")
        assert done.exit_code == 1 and re.search("not written: KeyError: 'a bug'", done.stderr)
        assert len(Path("pose.csv").read_text().splitlines()) == 91 and not Path("look.mp4").exists()


def test_memory_does_not_grow_with_the_recording(tmp_path):
    """Each frame more takes less than 100 bytes, while it is tracked and while files are written."""
    recording = open_recording(sample_path(), use=("depth",))
    tracker = start_tracker(recording)
    estimates = [step.estimate for step in track(recording, tracker)]
    kept, peaks = [], []
    tracemalloc.start()
    for times in (1, 1, 4):
        with Spool([tmp_path / "pose.csv", tmp_path / "pose.npz"], root_frame=lambda: "a", together=45) as spool:
            for estimate in times * estimates:
                spool.add(estimate, {1: tracker.body})
            gc.collect()
            kept.append(tracemalloc.get_traced_memory()[0])
            tracemalloc.reset_peak()
            assert spool.write()[1] == []
        peaks.append(tracemalloc.get_traced_memory()[1])
    tracemalloc.stop()
    assert len(Track.load(tmp_path / "pose.csv")) == 4 * 90
    assert kept[2] - kept[1] < 3 * 90 * 100, kept
    assert peaks[2] - peaks[1] < 1e6, peaks  # the poses of the three recordings more are 2 MB
