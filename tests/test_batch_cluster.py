"""`voodoo batch` on a cluster of processes, with the extra installed from the index: marked long."""

import csv
import os
import signal
import socket
import subprocess
import time
from pathlib import Path

import pytest

from extra_environment import environment
from voodoo.recordings import sample_path

pytestmark = pytest.mark.long

ROOT = Path(__file__).resolve().parent.parent
MAIN = "from voodoo.cli import main; main()"
RECORDINGS = 12


@pytest.fixture(scope="module")
def python(tmp_path_factory):
    return environment(tmp_path_factory.mktemp("batch") / "env", "batch")


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    """Links to the bundled recording, and one that is damaged."""
    folder = tmp_path_factory.mktemp("in")
    for number in range(RECORDINGS):
        (folder / f"walk_{number:02d}").symlink_to(sample_path(), target_is_directory=True)
    (folder / "damaged").mkdir()
    (folder / "damaged" / "x.mcap").write_bytes(b"\x89MCAP0\r\n")
    return folder


def command(python, recordings, out, *words):
    return [python, "-c", MAIN, "batch", recordings, "--out", out, "--use", "depth", *map(str, words)]


def run(python, recordings, out, *words, seconds=300):
    return subprocess.run(
        command(python, recordings, out, *words), capture_output=True, text=True, timeout=seconds, check=False
    )


def rows_of(out):
    with (out / "summary.csv").open(newline="") as file:
        return {row["recording"]: row for row in csv.DictReader(file)}


INTRUDER = """
import sys, psutil, distributed
process = psutil.Process(int(sys.argv[1]))
family = [process, *process.children(recursive=True)]
ports = {c.laddr.port for one in family for c in one.net_connections() if c.status == psutil.CONN_LISTEN}
assert ports
for port in sorted(ports):
    for scheme, keys in (("tcp", None), ("tls", distributed.Security.temporary())):
        try:
            client = distributed.Client(f"{scheme}://127.0.0.1:{port}", timeout=1, security=keys, set_as_default=False)
            print("IN", port, client.submit(lambda: 7).result(timeout=3))
        except (OSError, TimeoutError) as error:
            print("out", port, type(error).__name__)
"""


def test_nobody_else_can_use_the_workers(python, recordings, tmp_path):
    with subprocess.Popen(
        command(python, recordings, tmp_path / "o", "--workers", 1), stderr=subprocess.DEVNULL
    ) as batch:
        while not list((tmp_path / "o").glob("frames/*")):
            assert batch.poll() is None
            time.sleep(0.1)
        done = subprocess.run(
            [python, "-c", INTRUDER, str(batch.pid)], capture_output=True, text=True, timeout=120, check=False
        )
        batch.kill()
    assert done.returncode == 0, done.stdout + done.stderr
    assert "out" in done.stdout and "IN" not in done.stdout, done.stdout + done.stderr


def test_the_parts_that_need_the_extra(python):
    done = subprocess.run(
        [python, "-m", "pytest", "-q", "-p", "no:cacheprovider", ROOT / "tests" / "test_batch.py"],
        capture_output=True, text=True, timeout=300, check=False,
    )  # fmt: skip
    assert done.returncode == 0 and "skipped" not in done.stdout, done.stdout


def test_every_recording_is_a_row_and_a_table(python, recordings, tmp_path):
    done = run(python, recordings, tmp_path / "out", "--workers", 2)
    assert done.returncode == 1 and "1 recordings failed, the first: damaged" in done.stderr, done.stderr
    rows = rows_of(tmp_path / "out")
    assert len(rows) == RECORDINGS + 1 and rows.pop("damaged")["status"] == "failed"
    assert {row["status"] for row in rows.values()} == {"done"} and {row["frames"] for row in rows.values()} == {"90"}
    tables = list((tmp_path / "out" / "frames").glob("*/*"))
    assert len(tables) == RECORDINGS and {table.name for table in tables} == {"part-0.parquet"}
    before = {table: table.stat().st_mtime_ns for table in tables}
    (tmp_path / "out" / "summary.csv").unlink()  # as if the command had died before it wrote it
    tables[0].unlink()
    again = run(python, recordings, tmp_path / "out", "--workers", 2)
    assert f"1 of 2 recordings done, {RECORDINGS - 1} before" in again.stdout
    assert [table for table in tables if table.stat().st_mtime_ns != before[table]] == [tables[0]]
    assert len(rows_of(tmp_path / "out")) == RECORDINGS + 1


def test_what_kills_every_worker_is_a_row_and_the_rest_is_done(python, recordings, tmp_path):
    """A recording whose reading ends the process stands for one that takes all memory."""
    (tmp_path / "sitecustomize.py").write_text(
        "import importlib.abc, importlib.util, sys\n"
        "class Finder(importlib.abc.MetaPathFinder):\n"
        "    def find_spec(self, name, path, target=None):\n"
        "        if name != 'voodoo.batch.task':\n            return None\n"
        "        sys.meta_path.remove(self)\n"
        "        spec = importlib.util.find_spec(name)\n"
        "        load = spec.loader.exec_module\n"
        "        def exec_module(module):\n            load(module)\n"
        "            opened = module.open_recording\n"
        "            import os\n"
        "            module.open_recording = lambda p, **o: os._exit(9) if 'walk_03' in str(p) else opened(p, **o)\n"
        "        spec.loader.exec_module = exec_module\n        return spec\n"
        "sys.meta_path.insert(0, Finder())\n"
    )
    done = subprocess.run(
        command(python, recordings, tmp_path / "out", "--workers", 2),
        capture_output=True, text=True, timeout=300, check=False,
        env={**os.environ, "PYTHONPATH": f"{tmp_path}:{os.environ.get('PYTHONPATH', '')}"},
    )  # fmt: skip
    rows = rows_of(tmp_path / "out")
    assert len(rows) == RECORDINGS + 1, done.stderr
    assert rows["walk_03"]["status"] == "failed" and "worker died" in rows["walk_03"]["error"]
    assert sum(row["status"] == "done" for row in rows.values()) == RECORDINGS - 1


def test_ctrl_c_keeps_what_is_done(python, recordings, tmp_path):
    out = tmp_path / "out"
    running = subprocess.Popen(
        command(python, recordings, out, "--workers", 1), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    for _ in range(1200):
        if len(list((out / "frames").glob("*/*.parquet"))) >= 2 or running.poll() is not None:
            break
        time.sleep(0.1)
    running.send_signal(signal.SIGINT)
    _, message = running.communicate(timeout=60)
    assert running.returncode == 130 and "interrupted" in message, message
    kept = [row for row in rows_of(out).values() if row["status"] == "done"]
    assert 2 <= len(kept) < RECORDINGS


def until_open(port):
    for _ in range(300):
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", port)) == 0:
                return
        time.sleep(0.1)
    raise TimeoutError(f"nothing listens at {port}")


def test_a_scheduler_that_runs_already(python, recordings, tmp_path):
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{probe.getsockname()[1]}"
    started = []
    try:
        port = address.rsplit(":", 1)[1]
        words = [
            python,
            "-m",
            "distributed.cli.dask_scheduler",
            "--host",
            "127.0.0.1",
            "--port",
            port,
            "--no-dashboard",
        ]
        started.append(subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL))
        until_open(int(port))
        words = [
            python,
            "-m",
            "distributed.cli.dask_worker",
            address,
            "--nthreads",
            "1",
            "--no-dashboard",
            "--host",
            "127.0.0.1",
        ]
        started.append(subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, cwd=tmp_path))
        done = run(python, recordings, tmp_path / "out", "--scheduler", address, "--only", "walk_0?")
        assert done.returncode == 0 and "10 of 10 recordings done" in done.stdout, done.stderr
    finally:
        for process in started:
            process.terminate()
            process.wait(timeout=30)
    nobody = run(python, recordings, tmp_path / "other", "--scheduler", address)
    assert nobody.returncode == 1 and "expected a Dask scheduler at tcp://127.0.0.1" in nobody.stderr
