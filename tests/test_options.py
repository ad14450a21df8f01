"""Options that several commands have are the same in all of them, and reach what reads the recording."""

from pathlib import Path

import pytest
import typer.main
from typer.testing import CliRunner

from commands import refused, run
from voodoo.cli import app
from voodoo.errors import VoodooError
from voodoo.live.sources.words import source_of
from voodoo.recordings import open_recording, sample_path
from voodoo.recordings.keypoint_layouts import LAYOUTS

COMMANDS = typer.main.get_command(app).commands
READING = ("topic", "frame", "loader", "option", "layout")
"""How a recording is read."""
READERS = ("track", "live", "init", "eval", "batch", "ik", "info")


def told(command, name):
    (option,) = (item for item in COMMANDS[command].params if item.name == name)
    return option.opts, option.metavar, option.help, option.multiple


@pytest.mark.parametrize("name", READING)
def test_a_recording_is_read_with_the_same_options_everywhere(name):
    assert {command: told(command, name) for command in READERS} == dict.fromkeys(READERS, told("track", name))


def test_no_option_has_two_meanings():
    """The metavar of an option is that of all commands, but for those that name another thing on purpose."""
    words = {}
    for command in READERS:
        for item in COMMANDS[command].params:
            if item.param_type_name == "option" and item.name not in ("out", "init", "result", "rate"):
                words.setdefault(item.opts[0], set()).add(item.metavar)
    assert {name: found for name, found in words.items() if len(found) > 1} == {}


@pytest.mark.parametrize(
    "words",
    ["track", "live", "init", "eval --jobs 1", "ik", "info", "batch --workers 1 --out out"],
)
@pytest.mark.parametrize(
    ("option", "reason"),
    [("--topic depth=/none", "/none"), ("--frame nowhere", "nowhere"), (f"--layout {next(iter(LAYOUTS))}", "layout")],
    ids=["topic", "frame", "layout"],
)
def test_an_option_of_reading_is_never_ignored(words, option, reason, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    if words.startswith("batch"):
        pytest.importorskip("distributed")
        pytest.importorskip("pyarrow")
    monkeypatch.chdir(tmp_path)
    command, *rest = words.split()
    done = CliRunner().invoke(app, [command, str(sample_path()), *rest, *option.split()])
    assert done.exit_code in (1, 2) and reason in done.stderr, done.output


@pytest.mark.parametrize("word", ["realsense", "oak", "orbbec:1", "grow:folder", "ros2:/depth"])
def test_a_live_source_takes_no_option_that_it_does_not_know(word):
    with pytest.raises(VoodooError, match="depth_topic"):
        source_of(word, options={"depth_topic": "/other"})


@pytest.mark.parametrize(
    ("option", "for_", "instead"),
    [
        ("--topic depth=/front", "loader ros2, ros1", "its options: calibration, rate"),
        ("--frame odom", "loader ros2, ros1", "use root_frame in calibration.toml"),
        (
            "--option meters_per_unit=0.001",
            "loader ros2, ros1, pose2sim, videos",
            "use depth_factor in calibration.toml",
        ),
        ("--option unpacked_gb=1", "loader ros2, ros1", "its options: calibration, rate"),
    ],
)
def test_an_option_of_bags_says_so_of_a_folder(option, for_, instead, tmp_path):
    path = tmp_path / "room"
    (path / "depth").mkdir(parents=True)
    for command in ("track", "info"):
        done = run(command, path, *option.split())
        refused(done, f"({option.split()[0]} ", for_, "found one of the loader folder", instead)


def test_an_option_of_folders_says_so_of_a_bag():
    words = "rate (--option rate=NUMBER): expected a recording it is for (loader folder, pose2sim, videos)"
    refused(run("track", sample_path(), "--option", "rate=15"), words, "found one of the loader ros2")


def test_an_option_that_no_loader_has_is_answered_with_those_there_are():
    with pytest.raises(
        VoodooError, match=r"expected an option of the loader ros2 \(use, depth_topic.*, found depth_topics$"
    ):
        open_recording(sample_path(), depth_topics="/front")


@pytest.mark.parametrize(("command", "height"), [("track", "180"), ("body", "17"), ("init", "0.2"), ("live", "nan")])
def test_a_stature_in_another_unit_is_a_wrong_option(command, height):
    done = run(command, *([] if command == "body" else ["nowhere"]), "--height", height)
    assert done.exit_code == 2 and "'--height': stature: expected meters from 0.3 to 3.0, found" in done.stderr
