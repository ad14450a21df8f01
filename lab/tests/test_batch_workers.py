"""`voodoo batch` on a cluster of processes, of which one is killed: lab/experiments/batch_workers.py."""

import re
import subprocess
import sys

import pytest

from extra_environment import environment
from lab_scripts import EXPERIMENTS, load_experiment

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


def test_a_batch_that_ends_before_a_worker_is_killed_is_not_called_killed(tmp_path, monkeypatch):
    """It has no worker, either."""
    workers, started = load_experiment("batch_workers"), []

    def batch(recordings, out, count):
        started.append(subprocess.Popen([sys.executable, "-c", "import time; time.sleep(0.3)"]))
        return started[-1]

    monkeypatch.setattr(workers, "batch", batch)
    with pytest.raises(SystemExit, match="expected to kill a worker"):
        workers.timed(tmp_path, tmp_path, 2, kill_after=0)
    monkeypatch.setattr(workers, "done_in", lambda out: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        workers.timed(tmp_path, tmp_path, 2, kill_after=0)
    assert started[-1].poll() is not None
