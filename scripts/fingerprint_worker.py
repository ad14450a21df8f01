"""Runs cases of `scripts/fingerprint` in the Python of one build: a case a line on stdin as JSON, an answer a line on stdout.

What is kept does not depend on how the package is arranged inside: every estimate that the public class `voodoo.Tracker` gives,
every posture of `voodoo.ik`, the files that a command writes, and what a script prints without its times.
"""

from __future__ import annotations

import contextlib
import gzip
import hashlib
import importlib
import io
import json
import os
import pickle
import re
import runpy
import struct
import sys
import tempfile
import traceback
from collections.abc import Callable, Mapping
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

import numpy as np
from fingerprint_cases import SCRIPT_FOLDERS

FORMAT = 3
"""Of the files of results; a new number makes all of them anew."""

Record = dict[str, Any]
TIMES = re.compile(r"[-+]?\d+(\.\d+)?(e[-+]?\d+)? ?(ms|us|µs|s|seconds|Hz|fps|frames a second)\b")
TIME_HEADS = re.compile(r"\b(ms|CPU)\b")


def packed(values: object) -> bytes:
    """Names and numbers in their order, every number bit for bit."""
    if isinstance(values, Mapping):
        return packed([part for pair in values.items() for part in pair])
    if isinstance(values, np.ndarray):
        array = np.ascontiguousarray(values)
        return f"{array.dtype.str}{array.shape}".encode() + array.tobytes()
    if isinstance(values, (list, tuple)):
        return b"[" + b",".join(packed(value) for value in values) + b"]"
    if isinstance(values, float):
        return struct.pack("<d", values)
    return repr(values).encode()


def of_estimate(call: str, estimate: Any) -> Record:  # noqa: ANN401 - the class of another build
    """What a step or a reset returned."""
    return {
        "call": call,
        "poses": np.ascontiguousarray(estimate.limb_poses, dtype=np.float64).tobytes(),
        "sites": packed([list(estimate.joint_names), estimate.joint_positions]),
        "status": packed([estimate.status, estimate.limb_status]),
        "residuals": packed(
            [
                float(estimate.stamp),
                float(estimate.mean_squared_distance),
                int(estimate.steps),
                estimate.limb_residual,
                estimate.limb_points,
                estimate.joint_gaps,
                estimate.sources,
            ]
        ),
    }


def of_posture(posture: Any) -> Record:  # noqa: ANN401
    """What inverse kinematics found."""
    return {
        "call": "posture",
        "poses": b"".join(
            np.ascontiguousarray(pose, dtype=np.float64).tobytes() for pose in posture.world_from_limb.values()
        ),
        "sites": packed([list(posture.joints), [np.asarray(place) for place in posture.joints.values()]]),
        "status": packed([int(posture.steps), bool(posture.converged), int(posture.images)]),
        "residuals": packed(
            [np.asarray(posture.angles), np.asarray(posture.residuals, dtype=np.float64), float(posture.h)]
        ),
    }


def of_postures(found: Any) -> Record:  # noqa: ANN401
    """What inverse kinematics found for many sets of targets."""
    return {
        "call": "postures",
        "poses": np.ascontiguousarray(found.joints, dtype=np.float64).tobytes(),
        "sites": packed(np.asarray(found.angles)),
        "status": packed([np.asarray(found.steps), np.asarray(found.tried), np.asarray(found.converged)]),
        "residuals": packed(np.asarray(found.h)),
    }


class Log:
    """What the case that runs has given so far."""

    def __init__(self) -> None:
        """Empty, without a limit."""
        self.records: list[Record] = []
        self.limit: int | None = None

    def add(self, record: Record) -> None:
        """Keep a result; a case that is cut short ends as by Ctrl-C."""
        self.records.append(record)
        if self.limit is not None and len(self.records) >= self.limit:
            self.limit = None
            raise KeyboardInterrupt


def watched(log: Log) -> None:
    """Have every result of the build kept, wherever its own code asks for it."""
    import voodoo

    def logged(name: str) -> Callable[..., Any]:
        plain = getattr(voodoo.Tracker, name)

        def call(self: Any, *args: Any, **options: Any) -> Any:  # noqa: ANN401
            try:
                estimate = plain(self, *args, **options)
            except voodoo.VoodooError as error:
                refused = type(error).__name__.encode()
                log.add({"call": name, "poses": b"", "sites": b"", "status": refused, "residuals": b""})
                raise
            log.add(of_estimate(name, estimate))
            return estimate

        return call

    for name in ("step", "reset", "reset_pose"):
        setattr(voodoo.Tracker, name, logged(name))
    for kind, keep in ((voodoo.ik.Posture, of_posture), (voodoo.ik.Postures, of_postures)):

        def made(self: Any, *args: Any, plain: Any = kind.__init__, keep: Any = keep, **values: Any) -> None:  # noqa: ANN401
            plain(self, *args, **values)
            log.add(keep(self))

        kind.__init__ = made


def without_times(text: str) -> str:
    """What a script printed, without the columns and numbers that are times."""
    lines = text.splitlines()
    columns = set[int]()
    for index, line in enumerate(lines):
        if not line.startswith("|"):
            columns = set()
        elif index + 1 < len(lines) and re.fullmatch(r"[|: -]*-[|: -]*", lines[index + 1]):
            columns = {number for number, cell in enumerate(line.split("|")) if TIME_HEADS.search(cell)}
        cells = line.split("|")
        hidden = "|".join("*" if number in columns else cell for number, cell in enumerate(cells))
        lines[index] = TIMES.sub("*", hidden if line.startswith("|") else line)
    return "\n".join(lines)


def script_of(checkout: Path, name: str) -> Path:
    """A script of the checkout: in one of its folders of scripts, by the age of the build."""
    for folder in SCRIPT_FOLDERS:
        if (checkout / folder / name).exists():
            return checkout / folder / name
    raise FileNotFoundError(f"{checkout}: expected {name} in {' or '.join(SCRIPT_FOLDERS)}")


def run_case(case: Mapping[str, Any], log: Log, *, checkout: Path, folder: Path) -> str:
    """Run a command, a script of the checkout or a case of `fingerprint_public`; what it printed."""
    printed = io.StringIO()
    kind, words = case["kind"], list(case["arguments"])
    old_path, old_argv, old_folder = list(sys.path), sys.argv, Path.cwd()
    with contextlib.redirect_stdout(printed), contextlib.suppress(KeyboardInterrupt):
        try:
            os.chdir(folder)
            if kind == "public":
                public = importlib.import_module("fingerprint_public")
                getattr(public, words[0])(*words[1:])
            else:
                sys.argv = words
                try:
                    if kind == "command":
                        next(iter(entry_points(group="console_scripts", name="voodoo"))).load()()
                    else:
                        script = script_of(checkout, words[0])
                        sys.path.insert(0, str(script.parent))
                        runpy.run_path(str(script), run_name="__main__")
                except SystemExit as end:
                    if end.code not in (None, 0, 130):
                        raise RuntimeError(f"{words[0]} ended with {end.code}: {printed.getvalue()[-500:]}") from end
        finally:
            sys.path[:], sys.argv = old_path, old_argv
            os.chdir(old_folder)
    return printed.getvalue()


def files_of(folder: Path) -> dict[str, str]:
    """Digest of every table and every array that the case wrote."""
    found = {}
    for path in sorted(folder.rglob("*")):
        name = str(path.relative_to(folder))
        if path.suffix == ".npz":
            with np.load(path, allow_pickle=False) as arrays:
                for key in sorted(arrays):
                    found[f"{name}:{key}"] = hashlib.sha256(packed(arrays[key])).hexdigest()
        elif path.suffix in (".csv", ".bvh", ".trc"):
            found[name] = hashlib.sha256(path.read_bytes()).hexdigest()
    return found


def answer(line: str, log: Log, checkout: Path) -> dict[str, Any]:
    """Run one case and write its results."""
    case = json.loads(line)
    np.random.seed(0)
    with contextlib.suppress(ImportError):
        import cv2

        cv2.setRNGSeed(0)
        cv2.setNumThreads(1)
    log.records, log.limit = [], case.get("frames")
    with tempfile.TemporaryDirectory() as folder:
        out, links = Path(folder) / "out", Path(folder) / "data"
        out.mkdir()
        for name, target in case.get("links", {}).items():
            link = links / name
            link.parent.mkdir(parents=True, exist_ok=True)
            link.symlink_to(target)
        for name, content in case.get("writes", {}).items():
            (Path(folder) / name).write_text(content, encoding="utf-8")
        case["arguments"] = [word.replace("{out}", str(out)).replace("{folder}", folder) for word in case["arguments"]]
        try:
            printed = run_case(case, log, checkout=checkout, folder=out)
        except Exception as error:
            traceback.print_exc()
            return {"error": f"{type(error).__name__}: {error}"[:500]}
        printed = without_times(printed.replace(folder, "FOLDER").replace(str(checkout), "CHECKOUT"))
        result = {"format": FORMAT, "records": log.records, "printed": printed, "files": files_of(out)}
    target = Path(case["result"])
    target.parent.mkdir(parents=True, exist_ok=True)
    part = target.with_name(f"{target.name}.{os.getpid()}")
    with gzip.open(part, "wb", compresslevel=1) as file:
        pickle.dump(result, file)
    part.rename(target)
    return {"frames": len(result["records"])}


def main() -> None:
    """Answer until stdin ends; whatever a case prints by itself goes to stderr."""
    checkout = Path(sys.argv[1])
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    log = Log()
    watched(log)
    for line in sys.stdin:
        print(json.dumps(answer(line, log, checkout)), file=answers, flush=True)


if __name__ == "__main__":
    main()
