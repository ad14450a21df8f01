"""`voodoo batch` on a cluster of processes, of which one is killed: lab/experiments/batch_workers.py."""

import re
import subprocess

import pytest

from extra_environment import environment
from lab_scripts import EXPERIMENTS

RECORDINGS = 12


@pytest.mark.long
def test_a_worker_that_dies_costs_its_task_once_more_and_nothing_else(tmp_path):
    """What the script prints of the time is not judged here."""
    done = subprocess.run(
        [environment(tmp_path / "env", "batch"), EXPERIMENTS / "batch_workers.py", str(RECORDINGS)],
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "killed worker" in done.stdout and re.search(r"[\d.]+ times as fast", done.stdout)
