"""Commands that meet what cannot be: a line that says so, no traceback, and what was done is kept."""

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import cv2
import numpy as np
import pytest

import damage
from commands import refused, run
from voodoo.errors import RecordingError, VoodooError
from voodoo.evaluation.report import markdown
from voodoo.evaluation.score import Score
from voodoo.recordings import sample_path
from voodoo.recordings.videos import opened_video
from voodoo.visualization.image_writer import PictureWriter, save_picture


def test_numpy_does_not_talk_to_users(tmp_path):
    code = (
        "import sys, numpy as np\nfrom voodoo.cli.common import clear_errors\n"
        "with clear_errors():\n    np.float64(1e300) * np.float64(1e300)\n    np.array([1.0]) / np.array([0.0])\n"
    )
    quiet = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert quiet.stderr == ""
    loud = subprocess.run([sys.executable, "-W", "always", "-c", code], capture_output=True, text=True, check=True)
    assert "RuntimeWarning" in loud.stderr


@pytest.mark.parametrize("path", ["~nobody-of-that-name/x.csv", "a\0b", "a\0b.json", "x" * 5000])
@pytest.mark.parametrize(
    "command",
    [
        ("track",),
        ("info",),
        ("init",),
        ("ik",),
        ("eval",),
        ("batch", "--out", "o"),
        *(("track", sample_path(), option) for option in ("--init", "--config", "--body", "--with")),
    ],
    ids=lambda words: f"{words[0]} {words[-1]}",
)
def test_paths_that_cannot_be_are_refused_in_a_line(tmp_path, monkeypatch, command, path):
    monkeypatch.chdir(tmp_path)
    done = run(*command, path)
    assert isinstance(done.exception, SystemExit), done.exception
    assert done.exit_code in (1, 2) and done.stderr and "Traceback" not in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_results_of_a_batch_have_a_path_that_can_be():
    refused(run("batch", sample_path(), "--out", "~nobody-of-that-name/x"), "found the home of an unknown user")


LATIN = os.fsdecode(b"caf\xe9")
"""As files of old are named: OpenCV ends the process for one."""


def test_names_of_other_bytes_do_not_reach_opencv(tmp_path):
    picture = np.zeros((16, 16, 3), np.uint8)
    for make in (
        lambda: PictureWriter(tmp_path / f"{LATIN}.mp4", rate_hz=30.0),
        lambda: PictureWriter(tmp_path / LATIN, rate_hz=30.0),
        lambda: save_picture(tmp_path / f"{LATIN}.png", picture),
    ):
        with pytest.raises(VoodooError, match=r"caf.*: expected a name in UTF-8, found other bytes"):
            make()
    if sys.platform == "linux":  # others have no such files
        (tmp_path / f"{LATIN}.avi").touch()
        with pytest.raises(RecordingError, match="expected a name in UTF-8"):
            opened_video(tmp_path / f"{LATIN}.avi")


@pytest.mark.skipif(sys.platform != "linux", reason="no such names here")
def test_names_of_other_bytes_are_read_and_reported(tmp_path):
    folder = tmp_path / LATIN
    (folder / "depth").mkdir(parents=True)
    (folder / "calibration.toml").write_text("width=4\nheight=3\nfx=5\nfy=5\ncx=1\ncy=1\n")
    (folder / "depth" / "1.0.png").write_bytes(cv2.imencode(".png", np.ones((3, 4), np.uint16))[1].tobytes())
    command = [sys.executable, "-c", "from voodoo.cli import main; main()", "info", folder]
    utf8 = {**os.environ, "LC_ALL": "C.UTF-8", "PYTHONUTF8": "0", "PYTHONIOENCODING": "utf-8:strict"}
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=utf8)
    assert done.returncode == 0 and done.stderr == "" and r"caf\udce9" in done.stdout


def test_a_failure_stands_below_the_table():
    text = markdown([Score("walk", Path("walk"), failure="walk: expected | a\nrecording, found\nnone " + "x" * 300)])
    rows = [line for line in text.splitlines() if line.startswith("| walk")]
    assert rows == ["| walk | - | - | failed, see below | | | | | |"]
    assert "walk: walk: expected | a recording, found none xxx" in text


@pytest.mark.skipif(not hasattr(os, "killpg"), reason="no process groups here")
def test_ctrl_c_ends_an_evaluation_at_once_and_keeps_what_is_done(tmp_path):
    (tmp_path / "all").mkdir()
    recording = damage.beginning(tmp_path / "recording", 12)
    for number in range(300):
        (tmp_path / "all" / f"r{number:03d}").symlink_to(recording)
    # A shell's background job ignores the signal, and what it starts does, too.
    listen = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)"
    often = "import voodoo.cli.common as common; common._LINE_S = 0.0"
    command = [
        sys.executable,
        "-c",
        f"{listen}; {often}; from voodoo.cli import main; main()",
        "eval",
        "all",
        "--use",
        "depth",
        "--jobs",
        "2",
        "--out",
        "report",
    ]
    pipe = subprocess.PIPE
    with subprocess.Popen(
        command, cwd=tmp_path, stdout=pipe, stderr=pipe, text=True, start_new_session=True, env={**os.environ}
    ) as running:
        late = threading.Timer(60.0, os.killpg, (running.pid, signal.SIGKILL))
        late.start()
        for line in running.stderr:
            if "evaluating: " in line:  # a recording is done
                break
        late.cancel()
        began = time.perf_counter()
        os.killpg(running.pid, signal.SIGINT)  # as a terminal does: the workers get it, too
        try:
            out, err = running.communicate(timeout=60)
        finally:
            if running.poll() is None:
                os.killpg(running.pid, signal.SIGKILL)
        took = time.perf_counter() - began
    assert running.returncode == 130, err
    done = int(err.split("interrupted: ")[1].split(" of 300")[0])
    assert done >= 1 and f": {done} sequence" in out
    assert took < 2.0, f"{took:.1f} s"  # on an idle machine 0.3 s
    assert len((tmp_path / "report" / "sequences.csv").read_text().splitlines()) == 1 + done
