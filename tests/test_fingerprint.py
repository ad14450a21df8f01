"""The fingerprint of this checkout: the same twice, and another one with another constant."""

import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent


def fingerprint(*words):
    done = subprocess.run(
        [ROOT / "scripts" / "fingerprint", ROOT, ROOT, *words], capture_output=True, text=True, check=False
    )
    return done.returncode, done.stdout


pytestmark = pytest.mark.long


def test_one_build_is_the_same_twice_for_any_number_of_threads_and_jobs():
    words = ("--only", "^bundled/|^virtual/full/all", "--set", "threads=3", "--jobs", "3")
    code, reported = fingerprint(*words)
    assert (code, "0 differ, 0 failed, 0 skipped" in reported) == (0, True), reported


@pytest.mark.parametrize("change", ["max_steps=6", "point_sigma=0.0300001"])
def test_a_changed_constant_is_visible(change):
    code, reported = fingerprint("--only", "^bundled/", "--set", change)
    assert code == 1
    assert "bundled/chain" in reported
    assert "differs from frame" in reported
