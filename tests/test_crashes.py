"""Commands that are killed, or whose disk fails, where they write; see crashes.py."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import crashes

pytestmark = pytest.mark.skipif(
    not (sys.platform == "linux" and shutil.which("cc")),
    reason="the layer that injects faults needs Linux and a C compiler",
)


def crash(*words):
    done = subprocess.run([sys.executable, crashes.__file__, *words], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_results_are_old_or_new_or_recoverable():
    told = crash("--points", "60", "--seed", "1")
    assert "60 points" in told and len(told.splitlines()) > len(crashes.KINDS) - len(crashes.NEEDS)


@pytest.mark.long
def test_results_are_old_or_new_or_recoverable_at_every_point():
    assert "0 failures" in crash()


def test_a_result_that_is_half_written_is_found(tmp_path, monkeypatch):
    """The judge itself: a half result, one that is gone, and success that is none."""
    kind = crashes.KINDS["csv"]
    for content, words in (("stamp_s,status,resid", "neither old nor new"), (None, "is gone")):
        folder = tmp_path / words.replace(" ", "_")
        folder.mkdir()
        old = crashes.prepared(kind, folder)
        Path(folder / "pose.csv").unlink() if content is None else Path(folder / "pose.csv").write_text(content)
        assert any(words in wrong for wrong in crashes.judge(kind, folder, old, 9, "", crashes.KILL)[0])
    folder = tmp_path / "unchanged"
    folder.mkdir()
    old = crashes.prepared(kind, folder)
    assert crashes.judge(kind, folder, old, 9, "", crashes.KILL) == ([], False)
    for code in (2, 4):
        assert "ended with" in crashes.judge(kind, folder, old, code << 8, "", crashes.FAULTS["EIO"])[0][0]
    assert "tells success" in crashes.judge(kind, folder, old, 0, "", crashes.FAULTS["EIO"])[0][0]
