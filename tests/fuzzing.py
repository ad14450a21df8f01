"""Mutated files and odd arguments by the thousand, each in a process that may die of it.

    .venv/bin/python tests/fuzzing.py --cases 20000 --seed 1

Every case is seeded by its number: `--first N --cases 1` runs one again. What counts as a failure: an exception that is no
VoodooError, a warning of NumPy, more than 5 seconds of computing or 30 of waiting, more than a gigabyte, or a process that dies.
"""

from __future__ import annotations

import argparse
import json
import os
import queue
import re
import resource
import signal
import subprocess
import sys
import tempfile
import threading
import time
import warnings
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from random import Random

LONGEST_S = 5.0
MOST_BYTES = 2**30
API = "api"
STRUCTURED = 0.8
"""Share of damage within the structure of a file, where it is known."""
TOKENS = (
    "nan",
    "inf",
    "-1",
    "1e400",
    "9" * 400,
    "0",
    '""',
    "[]",
    "{}",
    "null",
    "true",
    "-0.0",
    "1e-320",
    "\0",
    "[" * 3000,
)


@dataclass
class Report:
    """What came of the cases: how many of each kind, and those that failed, with the reason."""

    counts: Counter[str] = field(default_factory=Counter)
    accepted: Counter[str] = field(default_factory=Counter)
    failures: list[str] = field(default_factory=list)
    slowest: float = 0.0
    largest: int = 0


def mutated(data: bytes, rng: Random, *, text: bool) -> bytes:
    """A damaged file: bytes changed, cut, repeated or exchanged; in texts also numbers and words."""
    found = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 5, 20))):
        if not found:
            break
        # Headers decide more than what follows.
        at = rng.randrange(min(len(found), rng.choice((64, 1024, len(found)))))
        kind = rng.randrange(8)
        if text and kind < 5:
            spots = list(re.finditer(rb"[-\w.]+", bytes(found)))
            if spots:
                spot = rng.choice(spots)
                found[spot.start() : spot.end()] = rng.choice(TOKENS).encode()
        elif kind < 3:
            found[at] = rng.randrange(256)
        elif kind == 3:
            found[at : at + 4] = rng.choice((b"\xff\xff\xff\xff", b"\0\0\0\0", b"\xff\xff\xff\x7f", b"\0\0\0\x80"))
        elif kind == 4:
            found[at : at + 8] = rng.choice((b"\xff" * 8, b"\0" * 8, b"\0" * 7 + b"\x7f", b"\0\0\0\0\0\0\xf0\x7f"))
        elif kind == 5:
            del found[at : len(found) if rng.random() < 0.3 else at + rng.randrange(1, 40)]
        elif kind == 6:
            piece = found[at : at + rng.randrange(1, 200)]
            found[at:at] = piece
        else:
            found[at:at] = rng.randbytes(rng.randrange(1, 20))
    return bytes(found)


# In the child


class TooLong(BaseException):
    """A case took longer than it may."""


def work(first: int, last: int, step: int, folder: Path, only: str) -> None:
    """Run cases, and say of each that it begins and how it ended, as lines of JSON."""
    import fuzz_samples
    from voodoo.errors import VoodooError

    resource.setrlimit(resource.RLIMIT_AS, (4 * MOST_BYTES, 4 * MOST_BYTES))
    resource.setrlimit(resource.RLIMIT_FSIZE, (MOST_BYTES, MOST_BYTES))
    warnings.simplefilter("error", RuntimeWarning)

    def late(*_: object) -> None:
        raise TooLong

    signal.signal(signal.SIGPROF, late)
    pristine: dict[str, dict[str, bytes]] = {}
    for name, sample in fuzz_samples.SAMPLES.items():
        place = folder / re.sub(r"\W", "_", name)
        place.mkdir()
        sample.make(place)
        pristine[name] = {file: (place / file).read_bytes() for file in sample.mutated}
    names = [name for name in (*fuzz_samples.SAMPLES, API, API, API) if only in ("", name)]
    for case in range(first, last, step):
        rng, name = Random(case), names[case // step % len(names)]
        print(json.dumps({"case": case, "name": name}), flush=True)
        outcome, began = "accepted", time.process_time()
        try:
            if name == API:
                signal.setitimer(signal.ITIMER_PROF, LONGEST_S)
                fuzz_samples.call(rng)
            else:
                sample, place = fuzz_samples.SAMPLES[name], folder / re.sub(r"\W", "_", name)
                file = rng.choice(sample.mutated)
                if sample.damage is not None and rng.random() < STRUCTURED:
                    (place / file).write_bytes(sample.damage(pristine[name][file], rng))
                else:
                    (place / file).write_bytes(mutated(pristine[name][file], rng, text=sample.text))
                signal.setitimer(signal.ITIMER_PROF, LONGEST_S)
                sample.open(place, rng.random() < 0.5)
        except VoodooError as error:
            outcome = "refused" if str(error) else "an error without words"
        except TooLong:
            outcome = f"more than {LONGEST_S:g} s"
        except BaseException as error:
            import traceback

            where = traceback.extract_tb(error.__traceback__)[-1]
            outcome = f"{type(error).__name__}: {str(error)[:200]} ({Path(where.filename).name}:{where.lineno})"
        finally:
            signal.setitimer(signal.ITIMER_PROF, 0.0)
        if name != API:
            (place / file).write_bytes(pristine[name][file])
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
        took = time.process_time() - began
        print(json.dumps({"case": case, "outcome": outcome, "s": took, "memory": memory}), flush=True)
        if memory > MOST_BYTES:
            os._exit(0)  # the peak would be held against every case that follows; a new process goes on


# In the parent


def fuzz(cases: int, *, first: int = 0, jobs: int = 1, only: str = "") -> Report:
    """Run cases in child processes, and start another where one dies."""
    report, lock = Report(), threading.Lock()
    threads = [
        threading.Thread(target=_supervise, args=(first + job, first + cases, jobs, only, report, lock))
        for job in range(jobs)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return report


def _supervise(case: int, last: int, step: int, only: str, report: Report, lock: threading.Lock) -> None:
    while case < last:
        with tempfile.TemporaryDirectory(prefix="voodoo-fuzz-") as folder:
            command = [sys.executable, __file__, "--work", str(case), str(last), str(step), folder, only]
            with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as child:
                case = _listen(child, case, step, report, lock)
                child.kill()


def _listen(child: subprocess.Popen[str], case: int, step: int, report: Report, lock: threading.Lock) -> int:
    """Take what a child says until it ends or hangs; the case to go on with."""
    lines: queue.Queue[str | None] = queue.Queue()

    def pump() -> None:
        for line in child.stdout or ():
            lines.put(line)
        lines.put(None)

    threading.Thread(target=pump, daemon=True).start()
    reported: list[str] = []
    threading.Thread(target=lambda: reported.extend(child.stderr or ()), daemon=True).start()
    running, name, wait = None, "", 60.0
    while True:
        try:
            line = lines.get(timeout=wait)
        except queue.Empty:
            line, hung = None, True
        else:
            hung = False
        if line is None:
            with lock:
                if running is not None:
                    how = "hangs in compiled code" if hung else f"died ({child.wait()}): {''.join(reported)[-300:]}"
                    report.failures.append(f"case {running} ({name}): the process {how}")
                elif hung or child.wait() != 0:
                    report.failures.append(f"before case {case}: the process ended: {''.join(reported)[-600:]}")
                    return sys.maxsize
            return case + step if running is not None else case
        message = json.loads(line)
        if "outcome" not in message:
            running, name, case, wait = message["case"], message["name"], message["case"], 6 * LONGEST_S
            continue
        with lock:
            report.counts[name] += 1
            report.accepted[name] += message["outcome"] == "accepted"
            report.slowest = max(report.slowest, message["s"])
            report.largest = max(report.largest, message["memory"])
            if message["outcome"] not in ("accepted", "refused"):
                report.failures.append(f"case {running} ({name}): {message['outcome']}")
            if message["memory"] > MOST_BYTES:
                report.failures.append(f"case {running} ({name}): {message['memory'] / 1e9:.1f} GB")
        running, case = None, case + step


def main() -> None:
    if sys.argv[1:2] == ["--work"]:
        first, last, step, folder, only = sys.argv[2:7]
        work(int(first), int(last), int(step), Path(folder), only)
        return
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=2000)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--only", default="", help="one kind")
    chosen = parser.parse_args()
    report = fuzz(chosen.cases, first=chosen.first, jobs=chosen.jobs, only=chosen.only)
    for name, count in sorted(report.counts.items()):
        print(f"{name:<18} {count:6d} cases, {report.accepted[name]:6d} accepted")
    print(f"{report.counts.total()} cases, slowest {report.slowest:.2f} s, largest {report.largest / 1e6:.0f} MB")
    for failure in report.failures[:60]:
        print(failure)
    print(f"{len(report.failures)} failures")
    sys.exit(bool(report.failures))


if __name__ == "__main__":
    main()
