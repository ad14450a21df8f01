"""Makes training data: `python -m lab.training.data --out DIR`; seeded, in several processes, in files of 1,000 pictures."""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import time
from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from lab.training.anybody import GROUPS
from lab.training.bodies import Bodies
from lab.training.crops import Sample, samples
from lab.training.poses import load
from lab.training.scenes import Scenes

SHARD = 1000  # pictures in a file


def save(path: Path, batch: list[Sample]) -> None:
    """Write pictures and truths; the file appears when it is whole."""
    columns = {f.name: np.stack([np.asarray(getattr(s, f.name)) for s in batch]) for f in fields(Sample)}
    for name, column in columns.items():
        if column.dtype == np.float64:
            columns[name] = column.astype(np.float32)
    part = path.with_suffix(".part.npz")
    np.savez(part, **columns)
    part.rename(path)


def agree(path: Path, options: dict[str, Any]) -> None:
    """Write by which options files are made, which are kept when the command is given again.

    Raises:
        SystemExit: they were made by others.
    """
    if path.exists() and (found := json.loads(path.read_text(encoding="utf-8"))) != options:
        raise SystemExit(f"{path}: expected {options}, found {found}: choose another --out or --seed")
    path.write_text(json.dumps(options) + "\n", encoding="utf-8")


def make(
    out: Path, data: Path, *, seed: int, worker: int, count: int, held_out: bool, others: float, groups: Sequence[str]
) -> None:
    """One process' share: files `NAME_worker_number.npz` with `count` pictures in all."""
    os.nice(5)
    scenes = Scenes(Bodies(data / "bodies", held_out=held_out), load(data / "mocap", held_out))
    number, made = 0, 0
    while made < count:
        path = out / f"{'held' if held_out else 'train'}_{seed}_{worker}_{number:04d}.npz"
        rng = np.random.default_rng([seed, worker, number, int(held_out)])
        batch: list[Sample] = []
        size = min(SHARD, count - made)
        start = time.monotonic()
        while len(batch) < size and not path.exists():
            group = groups[int(rng.integers(len(groups)))] if others and rng.random() < others else GROUPS[0]
            batch += samples(scenes.frame(rng, group), rng)
        if batch:
            save(path, batch[:size])
            people = sum(s.person for s in batch[:size])
            print(f"{path.name}: {people} people, {size - people} others, {time.monotonic() - start:.0f} s", flush=True)
        made, number = made + size, number + 1


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--data", type=Path, default=Path(os.environ.get("VOODOO_DATA", "../shared/data")))
    parser.add_argument("--count", type=int, default=80_000, help="pictures")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--processes", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--held-out", action="store_true", help="bodies and motions that training does not see")
    parser.add_argument("--others", type=float, default=0.5, help="share of scenes of other groups than `adult`")
    parser.add_argument("--group", nargs="+", choices=GROUPS[1:], default=GROUPS[1:], help="which groups those are of")
    a = parser.parse_args()
    a.out.mkdir(parents=True, exist_ok=True)
    fraction = -(-a.count // a.processes)
    made_by = {"pictures a process": fraction, "others": a.others, "groups": list(a.group)}
    agree(a.out / f"{'held' if a.held_out else 'train'}_{a.seed}.json", made_by)
    workers = []
    for i in range(a.processes):
        options = {"seed": a.seed, "worker": i, "count": fraction, "held_out": a.held_out, "others": a.others}
        options["groups"] = a.group
        workers.append(multiprocessing.get_context("spawn").Process(target=make, args=(a.out, a.data), kwargs=options))
        workers[-1].start()
    for w in workers:
        w.join()
    if any(w.exitcode for w in workers):
        raise SystemExit("a process failed")


if __name__ == "__main__":
    main()
