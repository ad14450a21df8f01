"""Commands that are killed, or whose disk fails, at every point at which they write: results are old or new, or recoverable.

    python tests/crashes.py --points 200 --seed 1    so many points of all
    python tests/crashes.py --only csv               all points of one kind

Points are numbered: a failure names its kind, point and fault, by which `--only KIND --at POINT` runs it again.
"""

from __future__ import annotations

import argparse
import contextlib
import ctypes
import errno
import gc
import io
import os
import re
import signal
import subprocess
import sys
import tempfile
import traceback
import warnings
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from random import Random

HERE = Path(__file__).resolve().parent
KILL = 0
FAULTS = {"killed": KILL, "ENOSPC": errno.ENOSPC, "EIO": errno.EIO}
FRAMES, TOGETHER = 4, 2
OLD = "of before"


@dataclass
class Kind:
    """A command with its outputs: those that hold poses, and others."""

    words: tuple[str, ...]
    poses: tuple[str, ...]
    others: tuple[str, ...] = ()


TRACK = ("track", "REC", "--use", "depth")
LIVE = ("live", "REC", "--rate", "40")
PEOPLE = (*TRACK, "--people", "any")
KINDS = {
    "csv": Kind((*TRACK, "--out", "pose.csv"), ("pose.csv",)),
    "npz": Kind((*TRACK, "--out", "pose.npz"), ("pose.npz",)),
    "bvh trc": Kind((*TRACK, "--out", "pose.bvh", "--out", "pose.trc"), ("pose.bvh", "pose.trc")),
    "c3d mot glb": Kind(
        (*TRACK, "--out", "pose.c3d", "--out", "pose.mot", "--out", "pose.sto", "--out", "pose.glb"),
        ("pose.c3d", "pose.mot", "pose.sto", "pose.glb"),
    ),
    "mcap": Kind((*TRACK, "--out", "pose.mcap"), ("pose.mcap",)),
    "bag": Kind((*TRACK, "--out", "pose"), ("pose",)),
    "film": Kind((*TRACK, "--out", "pose.csv", "--overlay", "look.mp4"), ("pose.csv",), ("look.mp4",)),
    "pictures": Kind((*TRACK, "--out", "pose.csv", "--overlay", "look"), ("pose.csv",), ("look",)),
    "people": Kind((*PEOPLE, "--out", "pose.csv", "--out", "pose.npz"), ("pose.csv", "pose.npz")),
    "ik": Kind(("ik", "REC", "--pictures", "none", "--out", "pose.csv", "--out", "pose.npz"), ("pose.csv", "pose.npz")),
    "live": Kind((*LIVE, "--out", "pose.csv", "--report", "r.json"), ("pose.csv",), ("r.json",)),
    "record": Kind((*LIVE, "--record", "take.mcap"), (), ("take.mcap",)),
    "batch": Kind(("job",), (), ("summary.csv", "settings.json", "frames/recording=rec/part-0.parquet")),
}
"""`job` stands for a batch of one recording without Dask, whose processes are others."""
NEEDS = {"batch": ("pyarrow", "fsspec")}
LONGEST_S = 20
FAST = "/dev/shm" if os.access("/dev/shm", os.W_OK) else None
"""Where outputs are: a disk in memory, because points wait for the disk often."""


@dataclass
class Report:
    """What came of the points."""

    counts: Counter[str] = field(default_factory=Counter)
    recovered: int = 0
    failures: list[str] = field(default_factory=list)


def command(kind: Kind, folder: Path, recording: Path) -> tuple[int, str]:
    """Run a command in this process; its exit code and what it printed."""
    from commands import run

    os.chdir(folder)
    if kind.words == ("job",):
        from voodoo.batch.run import Batch
        from voodoo.batch.task import Settings, do
        from voodoo.errors import VoodooError

        try:
            batch = Batch([str(recording)], str(folder), Settings(use=("depth",)))
            for job in batch.jobs:
                batch.take(do(job))
            batch.save()
            errors = [row.error for row in batch.rows.values() if row.status != "done"]
            return int(bool(errors)), "".join(errors)
        except (VoodooError, OSError) as error:
            return 1, str(error)
    done = run(*(str(recording) if word == "REC" else word for word in kind.words))
    problem = done.exception if done.exception is not None and not isinstance(done.exception, SystemExit) else None
    if problem is not None:
        traceback.print_exception(problem)
    return (3 if problem is not None else done.exit_code), done.output


def is_whole(path: Path) -> bool:
    """Whether a file or folder is a complete result; raises an error otherwise."""
    import c3d
    import cv2

    from voodoo.export.people import PeopleTrack
    from voodoo.recordings import open_recording
    from voodoo.recordings.mcap_file import check_mcap

    if path.suffix in (".csv", ".npz") and path.name != "summary.csv":
        return len(PeopleTrack.load(path)) > 0
    if path.suffix == ".c3d":
        with path.open("rb") as file, warnings.catch_warnings():
            warnings.simplefilter("ignore")
            reader = c3d.Reader(file)
            return 0 < reader.frame_count == sum(1 for _ in reader.read_frames())
    if path.suffix == ".glb":
        content = path.read_bytes()
        return content[:4] == b"glTF" and int.from_bytes(content[8:12], "little") == len(content)
    if path.suffix in (".bvh", ".trc", ".mot", ".sto"):
        return path.read_text().endswith("\n") and len(path.read_text().splitlines()) > FRAMES
    if path.name == "take.mcap":
        return len(open_recording(path)) >= 0
    if path.suffix == ".mcap":
        return len(check_mcap(path)) > 0
    if path.suffix == ".mp4":
        return 0 < cv2.VideoCapture(str(path)).get(cv2.CAP_PROP_FRAME_COUNT) <= FRAMES  # a disk that fails ends it
    if path.suffix == ".parquet":
        import pyarrow.parquet as parquet

        return parquet.read_table(path).num_rows == FRAMES
    if path.is_dir():
        found = [file.name for file in path.iterdir()]
        return ("metadata.yaml" in found and len(found) == 2) or all(
            cv2.imread(str(path / name)) is not None for name in found
        )
    return path.stat().st_size > 0


def prepared(kind: Kind, folder: Path) -> set[str]:
    """Old results, where they may be replaced; the names."""
    names = set()
    for name in (*kind.poses, *kind.others):
        if name in ("pose", "take.mcap") or kind.words == ("job",):
            continue  # must not exist, or is judged by what is in it
        if name == "look":
            (folder / name).mkdir()
            (folder / name / "frame_000009.png").write_text(OLD)
        else:
            (folder / name).write_text(OLD)
        names.add(name)
    return names


def is_old(path: Path) -> bool:
    file = path / "frame_000009.png" if path.is_dir() else path
    return file.exists() and file.stat().st_size == len(OLD) and file.read_text() == OLD


def judge(kind: Kind, folder: Path, old: set[str], status: int, output: str, fault: int) -> tuple[list[str], bool]:
    """What is wrong after a fault, and whether something was recovered."""
    from voodoo.export.spool import recover
    from voodoo.whole import KEPT

    wrong, new = [], {}
    if fault == KILL and (not os.WIFSIGNALED(status) or os.WTERMSIG(status) != signal.SIGKILL):
        wrong.append(f"ended by itself: {status}: {output}")
    kept = [note.parent for note in folder.glob(f".*/{KEPT}")]
    stored = any(any(hidden.glob("*.npz")) for hidden in kept)
    done, failed = recover(folder)
    wrong += [f"not recovered: {error}" for error in failed]
    for name in (*kind.poses, *kind.others):
        path = folder / name
        if path.exists() and not is_old(path):
            try:
                new[name] = is_whole(path)
            except Exception as error:
                new[name] = False
                wrong.append(f"{name}: {error}")
            if not new[name]:
                wrong.append(f"{name} is neither old nor new")
        elif name in old and not path.exists() and not list(folder.glob(f"{path.stem}.recovered*")):
            wrong.append(f"the old {name} is gone")
    for path in done:
        try:
            if not is_old(path) and not is_whole(path):
                wrong.append(f"{path.name} is recovered, but not whole")
        except Exception as error:
            wrong.append(f"{path.name} is recovered, but {error}")
    if stored and not done:
        wrong.append("stored poses were not recovered")
    if fault != KILL:
        if os.WIFSIGNALED(status) or os.WEXITSTATUS(status) not in (0, 1):
            wrong.append(f"ended with {status}: {output}")
        complete = all(new.get(name) for name in (*kind.poses, *kind.others))
        if os.WEXITSTATUS(status) == 0 and not complete:
            wrong.append(f"tells success, but there are {sorted(new)}")
        if os.WEXITSTATUS(status) == 1 and not re.search("No space left|Input/output error|cannot|expected", output):
            wrong.append(f"does not tell why: {output}")
    return wrong, bool(done)


def tracked_before(recording: Path) -> None:
    """From here on nothing is tracked: commands take the frames that were, because they write the same.

    What takes long besides is kept, too: the options of all commands, and the text of the body.
    """
    import typer
    import typer.testing

    import voodoo.cli
    import voodoo.cli.running
    import voodoo.people
    import voodoo.pipeline.run
    import voodoo.pipeline.start
    import voodoo.visualization.overlay
    from voodoo.recordings import open_recording

    source = open_recording(recording, use=("depth",))
    tracker = voodoo.pipeline.start.start_tracker(source)
    steps = list(voodoo.pipeline.run.track(source, tracker))
    people = voodoo.people.People()
    of_people = list(voodoo.pipeline.run.track(source, people))
    assert of_people[-1].estimate
    voodoo.cli.running.opened = lambda *_, **__: source
    voodoo.pipeline.start.start_tracker = lambda *_, **__: tracker
    voodoo.pipeline.start.start_people = lambda *_, **__: people
    voodoo.pipeline.run.track = lambda _, by, **__: iter(of_people if by is people else steps)
    body, commands = tracker.body.to_toml(), typer.main.get_command(voodoo.cli.app)
    voodoo.Body.to_toml = lambda _: body
    voodoo.visualization.overlay._TARGET_HEIGHT = 60
    typer.testing._get_command = lambda _: commands


def run_point(layer: ctypes.CDLL, kind: Kind, recording: Path, at: int, fault: int) -> tuple[list[str], int, bool]:
    """One point in a process of its own: what is wrong, the number of points, whether something was recovered."""
    with tempfile.TemporaryDirectory(prefix="voodoo-crash-", dir=FAST) as top:
        folder, told = Path(top) / "out", Path(top) / "told"
        folder.mkdir()
        old = prepared(kind, folder)
        child = os.fork()
        if not child:
            with contextlib.suppress(BaseException):
                signal.alarm(LONGEST_S)
                null = os.open(os.devnull, os.O_WRONLY)
                os.dup2(null, 2)
                text = io.StringIO()
                layer.fault_arm(os.fsencode(folder), ctypes.c_long(at), fault)
                with contextlib.redirect_stderr(text):
                    code, output = command(kind, folder, recording)
                points = layer.fault_count()
                layer.fault_arm(b"", ctypes.c_long(-1), 0)
                told.write_text(f"{points}\n{output}\n{text.getvalue()}")
                os._exit(code)
            os._exit(4)
        _, status = os.waitpid(child, 0)
        points, _, output = told.read_text().partition("\n") if told.exists() else ("0", "", "")
        if at < 0:
            good = status == 0 and all(is_whole(folder / name) for name in (*kind.poses, *kind.others))
            return ([] if good else [f"fails without a fault: {status}: {output}"]), int(points), False
        wrong, recovered = judge(kind, folder, old, status, output, fault)
        return wrong, int(points), recovered


def crash(points: int | None, *, seed: int = 0, only: str = "", at: int | None = None) -> Report:
    """Run `points` points, chosen by a seed, or all of them."""
    import importlib.util

    import damage
    import voodoo.cli.live_run
    import voodoo.cli.running

    os.environ["RAYON_NUM_THREADS"] = "1"
    voodoo.cli.running.TOGETHER = voodoo.cli.live_run._TOGETHER = TOGETHER
    voodoo.cli.live_run.warm_up = lambda: None
    layer, report = ctypes.CDLL(os.environ["LD_PRELOAD"]), Report()
    names = [name for name in KINDS if only in ("", name) and all(map(importlib.util.find_spec, NEEDS.get(name, ())))]
    with tempfile.TemporaryDirectory(prefix="voodoo-crash-") as top:
        recording = damage.beginning(Path(top) / "rec", FRAMES)
        chosen: list[tuple[str, int, str]] = []
        tracked_before(recording)
        for name in names:
            first = Path(top) / name  # in this process, so that its modules are there for all points
            first.mkdir()
            with contextlib.redirect_stderr(io.StringIO()):
                command(KINDS[name], first, recording)
            wrong, count, _ = run_point(layer, KINDS[name], recording, -1, KILL)
            report.failures += [f"{name}: {words}" for words in wrong]
            chosen += [(name, number, fault) for number in range(count) for fault in FAULTS]
        if at is not None:
            chosen = [each for each in chosen if each[1] == at]
        elif points is not None:
            chosen = Random(seed).sample(chosen, min(points, len(chosen)))
        gc.freeze()
        for name, number, fault in chosen:
            wrong, _, recovered = run_point(layer, KINDS[name], recording, number, FAULTS[fault])
            if wrong and KINDS[name].words[0] == "live" and wrong[0].startswith("ended by itself: 0"):
                wrong = wrong[1:]  # it wrote less often than before: frames come as time goes
            report.counts[name] += 1
            report.recovered += recovered
            report.failures += [f"{name}, point {number}, {fault}: {words}" for words in wrong]
        os.chdir(HERE)
    return report


def build(folder: Path) -> Path:
    """The layer that injects faults."""
    library = folder / "faults.so"
    subprocess.run(["cc", "-shared", "-fPIC", "-O1", "-o", library, HERE / "faults.c", "-ldl"], check=True)
    return library


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--points", type=int, help="by default all")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", default="", choices=["", *KINDS])
    parser.add_argument("--at", type=int)
    chosen = parser.parse_args()
    if "faults" not in os.environ.get("LD_PRELOAD", ""):
        with tempfile.TemporaryDirectory(prefix="voodoo-crash-") as folder:
            environment = {**os.environ, "LD_PRELOAD": str(build(Path(folder)))}
            sys.exit(subprocess.run([sys.executable, *sys.argv], env=environment, check=False).returncode)
    report = crash(chosen.points, seed=chosen.seed, only=chosen.only, at=chosen.at)
    for name, count in sorted(report.counts.items()):
        print(f"{name:<10} {count:5d} points")
    print(f"{report.counts.total()} points, {report.recovered} with poses to recover, {len(report.failures)} failures")
    print("\n".join(report.failures[:40]))
    sys.exit(bool(report.failures))


if __name__ == "__main__":
    main()
