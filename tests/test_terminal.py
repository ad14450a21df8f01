"""Names and texts of files never reach a terminal as commands."""

import io
import subprocess
import sys

import numpy as np
import pytest

from bag_writer import Messages, write_bag
from commands import run
from voodoo.cli.terminal import Escaped, escaped

M = Messages()
COMMAND = "\x1b]0;title\x07\x1b[2J\r\x9b31m\u202e"


def bag(folder, name):
    image = M.image(10.0, np.full((3, 4), 1500, np.uint16), "16UC1", frame=f"cam{name}")
    topics = [
        (f"/d{name}/depth/camera_info", M.camera_info(10.0, frame=f"cam{name}")),
        (f"/d{name}/depth/image", image),
    ]
    return write_bag(folder, [(topic, 10.0, message) for topic, message in topics])


def commands_in(text):
    return [letter for letter in text if letter not in "\n\t" and (ord(letter) < 32 or letter in "\x9b\u202e")]


@pytest.mark.parametrize(
    "words", [("info",), ("info", "--topic", "depth=/none"), ("track", "--strict", "--out", "o.csv"), ("init",)]
)
def test_names_of_topics_and_frames_are_escaped(tmp_path, monkeypatch, words):
    monkeypatch.chdir(tmp_path)
    name, *options = words
    done = run(name, bag(tmp_path / "b", COMMAND), *options)
    assert done.output and commands_in(done.stdout + done.stderr) == []
    if name == "info":
        assert r"\x1b]0;title\x07" in done.stdout + done.stderr


def test_names_of_files_are_escaped(tmp_path):
    path = tmp_path / f"x{COMMAND}.mcap"
    path.write_bytes(b"none")
    main = "from voodoo.cli import main; main()"
    done = subprocess.run([sys.executable, "-c", main, "info", path], capture_output=True, text=True, check=False)
    assert done.returncode == 1 and r"\x1b]0;title" in done.stderr
    assert commands_in(done.stdout + done.stderr) == []


def test_ordinary_letters_stay():
    text = "Größe 体 🙂 \\ 'x'\n\t1\u00a0m"
    assert escaped(text) == text and escaped(text[:3]) == "Grö"


def test_a_stream_is_wrapped_once():
    stream = io.StringIO()
    assert Escaped(Escaped(stream)).stream is stream, "where a progress bar writes its own commands"
