"""What safe outputs and guarded inputs cost `voodoo track`: the command as it is, and with all of it bypassed, in turns.

    python lab/experiments/overhead.py RECORDING --pairs 16

Bypassed are the spool, hidden folders and fsync, the checks of bags and the own reading of chunks, the conversion of errors,
limits of files, and the check of paths.
"""

from __future__ import annotations

import argparse
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from contextlib import nullcontext
from pathlib import Path


class Unhidden:
    """In place of a hidden folder."""

    def __init__(self, path: Path) -> None:
        self.folder = path.parent

    def keep(self, **_: object) -> None:
        pass

    remove = close = keep


def bypass() -> None:
    """Take everything away, before other modules import it."""
    from rosbags.rosbag2.reader import DirectoryReader

    import voodoo.errors
    import voodoo.stored
    import voodoo.unpacking
    import voodoo.whole

    nothing = nullcontext()
    for module in (voodoo.errors, voodoo.stored, voodoo.unpacking):
        module.reading = lambda *_, **__: nothing
    voodoo.stored.check_stored = voodoo.unpacking.check_stored = lambda *_, **__: None
    voodoo.whole.appearing_whole = nullcontext
    voodoo.whole.Hidden = Unhidden
    import voodoo.cli.paths
    import voodoo.cli.recover

    voodoo.cli.paths.check_paths = voodoo.cli.recover.recover_before = lambda *_, **__: None
    import voodoo.cli.running
    import voodoo.recordings.ros_bag

    voodoo.cli.running.TOGETHER = sys.maxsize
    voodoo.recordings.ros_bag.bag_file = lambda path, _: DirectoryReader(path)
    voodoo.recordings.ros_bag.Bag._check_metadata = lambda *_: None


def measured(recording: Path, folder: Path, *, bare: bool) -> tuple[float, float]:
    """Time and processor time of a command [s]."""
    before, began = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    words = [sys.executable, __file__, str(recording), "--run", str(folder / f"{int(bare)}.csv")]
    subprocess.run(words, env={**os.environ, "BARE": "1" if bare else ""}, check=True, capture_output=True)
    took, after = time.perf_counter() - began, resource.getrusage(resource.RUSAGE_CHILDREN)
    return took, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recording", type=Path)
    parser.add_argument("--pairs", type=int, default=16)
    parser.add_argument("--run", help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    if chosen.run:
        if os.environ["BARE"]:
            bypass()
        from voodoo.cli import main as command

        sys.argv = ["voodoo", "track", str(chosen.recording), "--out", chosen.run]
        command()
        return
    with tempfile.TemporaryDirectory() as name:
        folder, pairs = Path(name), []
        for number in range(chosen.pairs + 1):  # the first one fills caches
            turns = (False, True) if number % 2 else (True, False)
            found = {bare: measured(chosen.recording, folder, bare=bare) for bare in turns}
            pairs.append((found[False], found[True]))
        assert (folder / "0.csv").read_bytes() == (folder / "1.csv").read_bytes()
    for index, words in enumerate(("time", "processor time")):
        whole, bare = ([pair[side][index] for pair in pairs[1:]] for side in (0, 1))
        ratio = statistics.median(one / other for one, other in zip(whole, bare, strict=True))
        print(
            f"{words}: {statistics.median(whole):.3f} s, bare {statistics.median(bare):.3f} s, median of ratios {ratio:.4f}"
        )


if __name__ == "__main__":
    main()
