"""Files and folders that appear only when they are complete, and never in the place of what is read."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from voodoo.errors import VoodooError


@contextmanager
def appearing_whole(path: Path) -> Iterator[Path]:
    """Another place to write to, which becomes this file or folder when it is complete; until then an old file stays.

    The place is in a new folder beside `path`, so that no other process writes to it and no link is followed. What is written
    is on the disk before it appears. If the block fails, nothing remains of it.

    Raises:
        OSError: it cannot be written; names `path`.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    folder = Path(tempfile.mkdtemp(dir=path.parent, prefix=f".{path.name[:64]}-"))
    try:
        place = folder / path.name
        yield place
        move_whole(place, path)
    except OSError as error:
        if error.errno is None:
            raise
        raise OSError(error.errno, os.strerror(error.errno), str(path)) from error
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def move_whole(place: Path, path: Path) -> None:
    """Give a complete file or folder its name, once it is on the disk; if that fails, it stays where it is.

    Raises:
        OSError: it cannot be moved, or is on another file system.
    """
    for written in (place, *place.rglob("*")) if place.is_dir() else (place,):
        _sync(written)
    os.replace(place, path)  # noqa: PTH105 - the replacement must be atomic
    _sync(path.parent)


def _sync(path: Path) -> None:
    """Wait until a file or folder is on the disk."""
    if path.is_dir() and os.name == "nt":
        return
    descriptor = os.open(path, os.O_RDONLY if path.is_dir() else os.O_RDWR)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def check_outputs(outputs: Iterable[Path], inputs: Iterable[Path | None]) -> None:
    """Reject outputs that would replace what is read, or each other, before the work starts.

    Args:
        outputs: files and folders that will be written.
        inputs: files and folders that are read; None and names that are no files are ignored.

    Raises:
        VoodooError: an output is an input or inside one, or two outputs are the same or one is inside the other.
    """
    targets = [(path, _place(path)) for path in outputs]
    sources = [(path, _place(path)) for path in inputs if path is not None and path.exists()]
    for index, (path, place) in enumerate(targets):
        for source, found in sources:
            if _same(place, found):
                raise VoodooError(f"{path}: expected another file than what is read, found the same")
            if found in place.parents and found.is_dir():
                raise VoodooError(f"{path}: expected a place outside of what is read, found one inside {source}")
            if place in found.parents:
                raise VoodooError(f"{path}: expected a place outside of what is read, found a folder with {source}")
        for other, found in targets[:index]:
            if _same(place, found) or found in place.parents or place in found.parents:
                raise VoodooError(f"{path}: expected outputs that are apart, found {other} in the same place")


def _place(path: Path) -> Path:
    """The absolute place of a name, links followed."""
    return Path(os.path.realpath(path))


def _same(one: Path, other: Path) -> bool:
    return one == other or (one.exists() and other.exists() and one.samefile(other))
