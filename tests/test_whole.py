"""Outputs appear when they are complete, never in the place of what is read, and independently of each other."""

import errno
import fcntl
import os
import re
import shutil
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

import voodoo
from commands import refused
from voodoo.cli import app
from voodoo.cli.paths import OUTPUTS
from voodoo.evaluation.report import plot_errors
from voodoo.evaluation.summary import write_sequences
from voodoo.export.files import ONE_PERSON
from voodoo.export.track import Track
from voodoo.recordings import open_recording, sample_path
from voodoo.visualization.image_writer import PictureWriter, save_picture
from voodoo.whole import Hidden, appearing_whole, check_outputs

run = CliRunner().invoke


def test_the_old_file_stays_until_the_new_one_is_complete_and_no_link_is_followed(tmp_path):
    path, victim = tmp_path / "pose.csv", tmp_path / "victim"
    path.write_text("old")
    victim.write_text("victim")
    (tmp_path / ".pose.csv.part").symlink_to(victim)
    with pytest.raises(OSError, match=r"pose\.csv"), appearing_whole(path) as place:
        place.write_text("half")
        assert path.read_text() == "old"
        raise OSError(errno.ENOSPC, "full")
    assert path.read_text() == "old"
    with appearing_whole(path) as place:
        place.write_text("new")
    assert path.read_text() == "new" and victim.read_text() == "victim"
    assert {file.name for file in tmp_path.iterdir()} == {"pose.csv", "victim", ".pose.csv.part"}


def test_a_folder_appears_whole_too(tmp_path, monkeypatch):
    with appearing_whole(tmp_path / "bag") as place:
        place.mkdir()
        (place / "a").write_text("a")
        assert not (tmp_path / "bag").exists()
    assert [file.name for file in (tmp_path / "bag").iterdir()] == ["a"]
    (tmp_path / "empty").mkdir()
    # Windows renames no folder to one that exists.
    replace = os.replace
    monkeypatch.setattr("os.replace", lambda one, other: (full if Path(one).is_dir() else replace)(one, other))
    with appearing_whole(tmp_path / "empty") as place:
        place.mkdir()
        (place / "a").write_text("a")
    assert [file.name for file in (tmp_path / "empty").iterdir()] == ["a"]


def lock_as_windows_does(descriptor, mode, count):
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise PermissionError from None


@pytest.mark.parametrize("system", ["linux", "win32"])
def test_what_a_killed_process_left_is_removed_unless_it_is_kept_or_in_use(tmp_path, monkeypatch, system):
    monkeypatch.setattr("voodoo.whole.sys.platform", system)
    monkeypatch.setitem(sys.modules, "msvcrt", SimpleNamespace(locking=lock_as_windows_does, LK_NBLCK=2))
    path = tmp_path / "pose.csv"
    in_use, kept, left = Hidden(path), Hidden(path), Hidden(path)
    kept.keep(paths=["pose.csv"])
    for one in (kept, left):
        one.close()  # as at the end of a process
    (tmp_path / ".pose.csv-backup").mkdir()
    with appearing_whole(path) as place:
        place.write_text("new")
    assert in_use.folder.exists() and kept.folder.exists() and not left.folder.exists()
    assert (tmp_path / ".pose.csv-backup").exists()


def test_a_folder_is_replaced_by_a_complete_one_or_stays(tmp_path, monkeypatch):
    look = tmp_path / "look"
    with PictureWriter(look, rate_hz=30.0) as writer:
        for _ in range(3):
            writer.write(np.zeros((8, 8, 3), np.uint8))
    assert len(list(look.iterdir())) == 3
    for fails in ("voodoo.visualization.image_writer._encode", "pathlib.Path.rename"):
        with monkeypatch.context() as patch, PictureWriter(look, rate_hz=30.0) as writer:
            writer.write(np.zeros((8, 8, 3), np.uint8))
            patch.setattr(fails, full)
            writer.write(np.zeros((8, 8, 3), np.uint8))
            writer.__exit__(None, None, None)
        assert "No space left" in str(writer.failure) and len(list(look.iterdir())) == 3
    with PictureWriter(look, rate_hz=30.0) as writer:
        writer.write(np.zeros((8, 8, 3), np.uint8))
    assert len(list(look.iterdir())) == 1 and [file.name for file in tmp_path.iterdir()] == ["look"]
    (look / "mine.txt").write_text("precious")
    with pytest.raises(voodoo.VoodooError, match=r"found mine\.txt"):
        PictureWriter(look, rate_hz=30.0)


def test_a_figure_and_a_picture_appear_whole(tmp_path, monkeypatch):
    from matplotlib.figure import Figure

    figure, picture = tmp_path / "errors.png", tmp_path / "sheet.png"
    for path in (figure, picture):
        path.write_text("old")
    monkeypatch.setattr(Figure, "savefig", lambda self, place, **how: full(place.write_text("half")))
    monkeypatch.setattr("voodoo.visualization.image_writer._encode", lambda place, _: full(place.write_text("half")))
    with pytest.raises(OSError, match=r"errors\.png"):
        plot_errors(figure, [])
    with pytest.raises(OSError, match=r"sheet\.png"):
        save_picture(picture, np.zeros((8, 8, 3), np.uint8))
    assert figure.read_text() == picture.read_text() == "old"


@pytest.mark.parametrize("suffix", ONE_PERSON)
def test_the_files_of_persons_are_outputs_too(tmp_path, suffix):
    walk, first = tmp_path / f"walk{suffix}", tmp_path / f"walk_1{suffix}"
    check_outputs([walk], [], numbered=ONE_PERSON)
    first.write_text("markers")
    check_outputs([walk], [first])
    with pytest.raises(voodoo.VoodooError, match="can be a person's"):
        check_outputs([walk], [first], numbered=ONE_PERSON)
    with pytest.raises(voodoo.VoodooError, match="apart"):
        check_outputs([tmp_path / "look.bvh", tmp_path / "look_12.bvh"], [], numbered=ONE_PERSON)
    track = ["track", sample_path(), "--people", "any", "--with", first, "--out", walk]
    refused(run(app, [str(word) for word in track]), "can be a person's")
    assert first.read_text() == "markers"


def test_two_processes_that_write_one_name_leave_one_whole_result(tmp_path):
    path, texts = tmp_path / "pose.csv", ("a" * 100_000, "b" * 100_000)
    child = os.fork()
    for _ in range(30):
        with appearing_whole(path) as place:
            place.write_text(texts[0 if child else 1])
        if child:
            assert path.read_text() in texts
    if not child:
        os._exit(0)
    assert os.waitpid(child, 0)[1] == 0
    assert [file.name for file in tmp_path.iterdir()] == ["pose.csv"]


def test_outputs_are_apart_from_inputs_and_from_each_other(tmp_path):
    recording, other = tmp_path / "walk", tmp_path / "other"
    recording.mkdir()
    (recording / "truth.csv").write_text("truth")
    (tmp_path / "link").symlink_to(recording)
    check_outputs([tmp_path / "pose.csv", tmp_path / "look.mp4", other], [recording, None, tmp_path / "realsense"])
    for outputs, words in (
        ([recording], "found the same"),
        ([recording / "truth.csv"], "inside"),
        ([tmp_path / "link" / "new.csv"], "inside"),
        ([tmp_path], "found a folder with"),
        ([other, tmp_path / "b" / ".." / "other"], "apart"),
        ([other, other / "in.csv"], "apart"),
    ):
        with pytest.raises(voodoo.VoodooError, match=words):
            check_outputs(outputs, [recording])


COMMAND = typer.main.get_command(app).commands


def files_of(command: str, *, written: bool) -> list[str]:
    """The options of a command that name files or folders, and are written or read."""
    options = [option for option in COMMAND[command].params if option.opts[0].startswith("--")]
    files = [option for option in options if set(re.findall("[A-Z]+", option.metavar or "")) & {"FILE", "DIR", "PATH"}]
    return [option.opts[0] for option in files if (option.name in OUTPUTS) == written]


PAIRS = [
    (command, one, other)
    for command in COMMAND
    for one in files_of(command, written=True)
    for other in (*files_of(command, written=True), *files_of(command, written=False))
    if one != other
]


def test_there_are_pairs_of_all_commands_that_write():
    assert {command for command, *_ in PAIRS} == {"track", "live", "ik", "init", "eval", "batch", "report"} and len(
        PAIRS
    ) > 45
    assert ("track", "--out", "--background") in PAIRS and ("live", "--report", "--calibration") in PAIRS


@pytest.mark.parametrize(("command", "one", "other"), PAIRS)
def test_no_option_replaces_what_another_one_reads_or_writes(command, one, other, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    file = tmp_path / ("mine.mp4" if "--overlay" in (one, other) else "mine.csv")
    file.write_text("precious")
    words = "outputs that are apart" if other in files_of(command, written=True) else "another file than what is read"
    given = f"/camera/color={file}" if other == "--keypoints" else str(file)
    refused(run(app, [command, str(sample_path()), one, str(file), other, given]), str(file), words)
    assert file.read_text() == "precious"


@pytest.mark.parametrize("command", ["track", "live", "ik", "init", "eval", "batch"])
def test_no_output_is_written_into_the_recording(command, tmp_path):
    recording = tmp_path / "rec"
    shutil.copytree(sample_path(), recording)
    before = {file: file.read_bytes() for file in recording.rglob("*") if file.is_file()}
    for option in files_of(command, written=True):
        for target in ("truth.csv", "bag/bag.mcap", "new.csv"):
            refused(run(app, [command, str(recording), option, str(recording / target)]), "outside of what is read")
        if command in ("track", "live", "ik"):  # a truth is read with the bag below it
            given = [command, str(recording / "bag"), option, str(recording / "truth.csv")]
            refused(run(app, given), "another file than what is read")
    assert {file: file.read_bytes() for file in recording.rglob("*") if file.is_file()} == before


def full(*_, **__):
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def test_a_film_or_format_that_fails_costs_no_other_output(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("voodoo.visualization.image_writer.PictureWriter._open", full)
    monkeypatch.setitem(ONE_PERSON, ".bvh", full)
    Path("old.bvh").write_text("old")
    command = ["track", str(sample_path()), "--use", "depth"]
    done = run(app, [*command, "--out", "old.bvh", "--out", "pose.csv", "--overlay", "look.mp4"])
    assert done.exit_code == 1
    told = " ".join(done.stderr.split())
    assert "old.bvh" in told and "look.mp4" in told and "wrote pose.csv" in told
    assert Path("old.bvh").read_text() == "old" and len(Path("pose.csv").read_text().splitlines()) == 91
    (kept,) = {file.name for file in tmp_path.iterdir()} - {"old.bvh", "pose.csv"}
    assert kept in done.stderr and "voodoo recover" in done.stderr
    monkeypatch.undo()
    monkeypatch.chdir(tmp_path)
    assert "wrote old.recovered.bvh" in run(app, ["recover", "."]).stdout
    assert {file.name for file in tmp_path.iterdir()} == {"old.bvh", "old.recovered.bvh", "pose.csv"}
    assert Path("old.bvh").read_text() == "old"


@pytest.mark.parametrize("command", [["live", "--rate", "2"], ["track"]], ids=["live", "track"])
def test_a_disk_that_fills_during_a_session_costs_no_pose_before(tmp_path, monkeypatch, command):
    """No part can be stored after the first; the files are on another disk."""
    savez, parts = np.savez, []
    monkeypatch.setattr("voodoo.cli.running.TOGETHER", 30)
    monkeypatch.setattr(np, "savez", lambda *place, **how: full() if parts else parts.append(savez(*place, **how)))
    done = run(app, [command[0], str(sample_path()), *command[1:], "--out", str(tmp_path / "pose.csv")])
    assert done.exit_code == 1 and "No space left" in done.stderr
    assert len(Track.load(tmp_path / "pose.csv")) == 60
    assert [file.name for file in tmp_path.iterdir()] == ["pose.csv"]


def test_the_poses_of_a_session_are_kept_where_its_files_cannot_be_written(tmp_path, monkeypatch):
    command = ["live", str(sample_path()), "--rate", "8", "--duration", "2", "--out", str(tmp_path / "pose.csv")]
    with monkeypatch.context() as patch:
        patch.setattr("voodoo.export.spool.save_result", full)
        done = run(app, command)
    (folder,) = tmp_path.iterdir()
    assert done.exit_code != 0 and str(folder) in done.stderr
    parts = [Track.load(part) for part in sorted(folder.glob("*.npz"))]
    assert sum(len(part) for part in parts) > 0


def test_a_recording_that_cannot_be_put_in_its_place_is_kept(tmp_path, monkeypatch):
    monkeypatch.setattr("voodoo.live.recorder.move_whole", full)
    take = tmp_path / "take.mcap"
    done = run(app, ["live", str(sample_path()), "--rate", "8", "--duration", "2", "--record", str(take)])
    (folder,) = tmp_path.iterdir()
    assert done.exit_code == 1 and f"{take}: " in done.stderr and str(folder) in done.stderr
    assert len(open_recording(folder / "take.mcap")) > 0


def test_a_table_of_an_evaluation_that_fails_leaves_the_old_one(tmp_path, monkeypatch):
    table = tmp_path / "sequences.csv"
    table.write_text("old")
    monkeypatch.setattr("voodoo.whole.move_whole", full)
    with pytest.raises(OSError, match=r"sequences\.csv"):
        write_sequences(table, [])
    assert table.read_text() == "old"


WRITTEN = [
    ("track", "--overlay", "look.mp4"),
    ("track", "--save", "look.rrd"),
    ("live", "--report", "r.json"),
    ("live", "--record", "take.mcap"),
    ("init", "--out", "start.json"),
    ("eval", "--out", "report"),
    ("report", "--out", "page.html"),
]


@pytest.mark.parametrize(("command", "option", "name"), WRITTEN)
def test_an_output_that_cannot_be_written_is_refused_before_the_work(command, option, name, tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    words = [command, str(sample_path()) if command == "eval" else str(tmp_path / "nowhere"), option]
    refused(run(app, [*words, str(tmp_path / "file" / name)]), f"file/{name}: expected a folder that can be written to")
    monkeypatch.setattr("os.access", lambda _, mode, **__: mode != os.W_OK)
    refused(run(app, [*words, str(tmp_path / name)]), f"{name}: expected a folder that can be written to")


def test_an_output_of_another_kind_is_refused_before_the_work(tmp_path):
    (tmp_path / "file").write_text("")
    refused(
        run(app, ["eval", str(sample_path()), "--out", str(tmp_path / "file")]), "file: expected a folder, found a file"
    )
    for command, option in (("live", "--report"), ("live", "--record"), ("report", "--out"), ("track", "--save")):
        refused(run(app, [command, "nowhere", option, str(tmp_path)]), "expected a file, found a folder")


def test_an_error_of_a_hidden_folder_names_the_output(tmp_path, monkeypatch):
    def failing(**how):
        raise PermissionError(errno.EACCES, "denied", str(how["dir"] / (how["prefix"] + "x")))

    monkeypatch.setattr("tempfile.mkdtemp", failing)
    with pytest.raises(PermissionError) as caught:
        Hidden(tmp_path / "take.mcap")
    assert caught.value.filename == str(tmp_path / "take.mcap")
