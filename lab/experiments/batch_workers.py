"""What a second worker buys `voodoo batch`, and what a worker that dies costs.

    pip install 'voodoo-tracker[batch]' && python lab/experiments/batch_workers.py [RECORDINGS]

Links to the bundled recording (by default 200), tracked by their depth by one worker, by two, and by two of which one is
killed when a third is done. Each run is the command, with its start and end. On a machine that does nothing else, with two cores
or more, two workers should be nearly twice as fast. Ends with exit code 1 if a recording is missing, or there twice, or differs.
"""

from __future__ import annotations

import argparse
import csv
import os
import platform
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from voodoo.recordings import sample_path

USE = ("--use", "depth")
COMMAND = (sys.executable, "-c", "from voodoo.cli import main; main()", "batch")


def batch(recordings: Path, out: Path, workers: int) -> subprocess.Popen[bytes]:
    """The command, started."""
    return subprocess.Popen(
        [*COMMAND, recordings, "--out", out, "--workers", str(workers), *USE], stdout=subprocess.DEVNULL
    )


def done_in(out: Path) -> list[Path]:
    """Tables that are complete."""
    return sorted((out / "frames").glob("recording=*/part-0.parquet"))


def children(pid: int) -> Iterator[tuple[int, str]]:
    """Processes below one, and their command lines."""
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                parent = int((entry / "stat").read_text().rpartition(")")[2].split()[1])
                words = (entry / "cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace")
            except (OSError, ValueError, IndexError):
                continue
            if parent == pid:
                yield int(entry.name), words
                yield from children(int(entry.name))


def kill_a_worker(pid: int) -> int | None:
    """Kill one of the processes that track, a child of the command by multiprocessing; its number, None: there is none yet."""
    worker = next((child for child, words in children(pid) if "spawn_main" in words), None)
    if worker is not None:
        os.kill(worker, signal.SIGKILL)
    return worker


def timed(recordings: Path, out: Path, workers: int, *, kill_after: int | None = None) -> float:
    """Wall-clock time of the command [s]."""
    began = time.perf_counter()
    running = batch(recordings, out, workers)
    try:
        while running.poll() is None:
            if (
                kill_after is not None
                and len(done := done_in(out)) >= kill_after
                and (worker := kill_a_worker(running.pid))
            ):
                print(f"killed worker {worker} after {len(done)} recordings", flush=True)
                kill_after = None
            time.sleep(0.05)
    finally:
        running.terminate()
        running.wait()
    if running.returncode:
        sys.exit(f"voodoo batch ended with exit code {running.returncode}")
    if kill_after is not None:
        sys.exit("expected to kill a worker, found that the batch had ended")
    return time.perf_counter() - began


def check(out: Path, like: Path, count: int) -> None:
    """End with an error where something is missing, there twice, or unlike the first run."""
    import pyarrow.parquet as parquet

    with (out / "summary.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    names = [row["recording"] for row in rows]
    if len(names) != count or len(set(names)) != count or any(row["status"] != "done" for row in rows):
        sys.exit(f"{out}: expected {count} recordings done, found {len(set(names))} in {len(names)} rows")
    if len(done_in(out)) != count:
        sys.exit(f"{out}: expected {count} tables, found {len(done_in(out))}")
    for table in done_in(out):
        if not parquet.read_table(table).equals(parquet.read_table(like / table.relative_to(out))):
            sys.exit(f"{table}: expected the same rows as by one worker, found others")


def main() -> None:
    words = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    words.add_argument("recordings", nargs="?", type=int, default=200)
    count = words.parse_args().recordings
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "in").mkdir()
        for number in range(count):
            (folder / "in" / f"walk_{number:03d}").symlink_to(sample_path(), target_is_directory=True)
        print(
            f"{count} recordings of 90 frames, {' '.join(USE)}; {os.cpu_count()} cores, {platform.processor()}",
            flush=True,
        )
        seconds = {}
        for label, workers, kill_after in (("one", 1, None), ("two", 2, None), ("killed", 2, count // 3)):
            seconds[label] = timed(folder / "in", folder / label, workers, kill_after=kill_after)
            check(folder / label, folder / "one", count)
            print(f"{label:<7}{seconds[label]:8.1f} s", flush=True)
        print(f"two workers are {seconds['one'] / seconds['two']:.2f} times as fast as one")


if __name__ == "__main__":
    main()
