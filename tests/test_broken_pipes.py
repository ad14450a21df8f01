"""The reader of what a command prints may leave, as `head` does: the command ends without a word, with a code of its own."""

import os
import subprocess
import sys

import pytest

from voodoo.cli.terminal import READER_LEFT
from voodoo.recordings import sample_path

SAMPLE = str(sample_path())


def left(*words, folder, both=False):
    """Exit code and errors of a command whose reader has left before it prints."""
    reading, writing = os.pipe()
    os.close(reading)
    how = {"stdout": writing, "stderr": writing if both else subprocess.PIPE, "cwd": folder}
    try:
        done = subprocess.run([sys.executable, "-m", "voodoo", *words], text=True, check=False, **how)
    finally:
        os.close(writing)
    return done.returncode, done.stderr or ""


@pytest.mark.parametrize(
    "words",
    [
        "info SAMPLE",
        "eval SAMPLE --use depth",
        "batch SAMPLE --workers 1 --out out",
        "track SAMPLE --use depth --out -",
        "live SAMPLE --use depth --rate 20",
        "--help",
        "--version",
    ],
)
def test_a_reader_who_leaves_ends_a_command_quietly(words, tmp_path):
    if words.startswith("batch"):
        pytest.importorskip("distributed")
        pytest.importorskip("pyarrow")
    live = words.startswith("live")  # prints on stderr only
    code, errors = left(*(SAMPLE if word == "SAMPLE" else word for word in words.split()), folder=tmp_path, both=live)
    assert code == READER_LEFT
    assert "pipe" not in errors.lower() and "Traceback" not in errors, errors


def test_one_who_reads_a_line_gets_it():
    command = f"{sys.executable} -m voodoo body | head -1; echo ${{PIPESTATUS[0]}}"
    done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, check=False)
    first, code = done.stdout.splitlines()
    assert first and int(code) in (0, READER_LEFT) and not done.stderr
