"""Files and folders that appear only when they are complete, and never in the place of what is read."""

from __future__ import annotations

import json
import os
import re
import shutil
import sys
import tempfile
from collections.abc import Container, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Literal

from voodoo.errors import VoodooError

SUFFIX = ".voodoo"
"""Ends the names of hidden folders."""
KEPT = ".voodoo-kept.json"
"""File in a hidden folder with the names of the outputs that its content becomes after a crash."""
_LOCK = ".voodoo-lock"
_LONGEST = 48
"""Length of an output's name in that of a hidden folder [characters]: names of files have 255 bytes at most."""
_UNLOCKED = -1
_open: set[Path] = set()
"""Hidden folders of this process: they may be without a lock."""


class Hidden:
    """A new hidden folder beside an output, for what is not complete yet.

    No other process writes to it, and no link is followed. It is locked as long as this process lives, so that what a killed
    process left is told from what is in use: it is removed when its output is written again, unless `keep` was called.

    Args:
        path: the output.

    Attributes:
        folder: the folder.
    """

    def __init__(self, path: Path) -> None:
        """Make the folder, and that of the output."""
        with naming(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            self._make(path)
        _open.add(self.folder)

    def _make(self, path: Path) -> None:
        start = f".{path.name[:_LONGEST]}-"
        for left in path.parent.iterdir():
            with suppress(OSError):
                ours = left.name.startswith(start) and left.name.endswith(SUFFIX)
                if ours and left not in _open and not (left / KEPT).exists() and (lock := locked(left)) is not None:
                    removed(left, lock)
        self._lock: int | None = None
        while self._lock is None:  # somebody took it for one that was left
            self.folder = Path(tempfile.mkdtemp(dir=path.parent, prefix=start, suffix=SUFFIX))
            try:
                self._lock = locked(self.folder)
            except OSError:
                self._lock = _UNLOCKED if self.folder.exists() else None

    def keep(self, **note: Any) -> None:  # noqa: ANN401 - any values of JSON
        """Keep the folder after a crash; `note` tells what is in it."""
        write_whole(self.folder / KEPT, json.dumps(note))

    def remove(self) -> None:
        """Delete the folder."""
        removed(self.folder, self._unlocked())

    def close(self) -> None:
        """Leave the folder to others."""
        if (lock := self._unlocked()) != _UNLOCKED:
            os.close(lock)

    def _unlocked(self) -> int:
        _open.discard(self.folder)
        lock, self._lock = self._lock, _UNLOCKED
        return _UNLOCKED if lock is None else lock


def removed(folder: Path, lock: int) -> None:
    """Delete a hidden folder and close its lock, which Windows does not delete before; what a crash leaves of it is not kept."""
    with suppress(OSError):
        (folder / KEPT).unlink(missing_ok=True)
    if lock != _UNLOCKED:
        os.close(lock)
    shutil.rmtree(folder, ignore_errors=True)


def locked(folder: Path) -> int | None:
    """Lock a hidden folder until the returned descriptor is closed, or this process ends; None: another process lives in it.

    Raises:
        OSError: the folder is gone, or the system has no such locks.
    """
    descriptor = os.open(folder / _LOCK, os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0), 0o600)
    try:
        if sys.platform == "win32":
            import msvcrt

            msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)
        else:
            import fcntl

            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except (BlockingIOError, PermissionError):  # the latter on Windows
        os.close(descriptor)
        return None
    except OSError:
        os.close(descriptor)
        raise
    if folder.exists():
        return descriptor
    os.close(descriptor)  # it was removed before it was locked
    return None


@contextmanager
def appearing_whole(path: Path) -> Iterator[Path]:
    """Another place to write to, which becomes this file or folder when it is complete; until then an old one stays.

    The place is in a hidden folder beside `path`. What is written is on the disk before it appears. If the block fails,
    nothing remains of it.

    Raises:
        OSError: it cannot be written; names `path`.
    """
    with naming(path):
        hidden = Hidden(path)
        try:
            place = hidden.folder / path.name
            yield place
            move_whole(place, path)
        finally:
            hidden.remove()


@contextmanager
def naming(path: Path) -> Iterator[None]:
    """Errors of the system inside name this file, instead of another or none."""
    try:
        yield
    except OSError as error:
        if error.errno is None:
            raise
        raise OSError(error.errno, os.strerror(error.errno), str(path)) from error


def write_whole(path: Path, text: str) -> None:
    """Write a text file, which appears when it is complete.

    Raises:
        OSError: it cannot be written; names `path`.
    """
    with appearing_whole(path) as place:
        place.write_text(text, encoding="utf-8")


def move_whole(place: Path, path: Path) -> None:
    """Give a complete file or folder its name, once it is on the disk; if that fails, it stays where it is.

    An old folder is put aside before, and removed afterwards.

    Raises:
        OSError: it cannot be moved, or is on another file system.
    """
    for written in (place, *place.rglob("*")) if place.is_dir() else (place,):
        _sync(written)
    if place.is_dir() and path.is_dir():
        _swap(place, path)
    else:
        os.replace(place, path)  # noqa: PTH105 - the replacement must be atomic
    _sync(path.parent)


def _swap(place: Path, path: Path) -> None:
    """Replace a folder in two steps; after a crash between them the old one is in a folder that is kept."""
    aside = Hidden(path)
    try:
        aside.keep(paths=[path.name])
        old = aside.folder / path.name
        path.rename(old)
        try:
            place.rename(path)
        except OSError:
            old.rename(path)
            raise
    finally:
        if path.exists():
            aside.remove()
        else:
            aside.close()


def check_disk(folder: Path) -> None:
    """Find out whether a megabyte can be written: some libraries do not tell why they cannot.

    Raises:
        OSError: it cannot.
    """
    with tempfile.TemporaryFile(dir=folder) as probe:
        probe.write(bytes(1 << 20))
        probe.flush()
        os.fsync(probe.fileno())


def _sync(path: Path) -> None:
    """Wait until a file or folder is on the disk."""
    if path.is_dir() and os.name == "nt":
        return
    descriptor = os.open(path, os.O_RDONLY if path.is_dir() else os.O_RDWR)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def check_place(path: Path, *, kind: Literal["file", "folder", "either"] = "either") -> None:
    """Reject an output that cannot be written, before the work starts.

    Raises:
        VoodooError: it exists as another kind, or is in a place where nothing can be written.
    """
    if (path.exists() and kind == "folder" and not path.is_dir()) or (kind == "file" and path.is_dir()):
        raise VoodooError(f"{path}: expected a {kind}, found a {'file' if kind == 'folder' else 'folder'}")
    own = [path.absolute()] if kind == "folder" else []
    above = next(place for place in (*own, *path.absolute().parents) if place.exists())
    if not above.is_dir() or not os.access(above, os.W_OK):
        raise VoodooError(f"{path}: expected a folder that can be written to, found {above}")


def check_outputs(outputs: Iterable[Path], inputs: Iterable[Path | None], *, numbered: Container[str] = ()) -> None:
    """Reject outputs that would replace what is read, or each other, before the work starts.

    Args:
        outputs: files and folders that will be written.
        inputs: files and folders that are read; None and names that are no files are ignored.
        numbered: suffixes of outputs that become NAME_1, NAME_2, ..., one of each person.

    Raises:
        VoodooError: an output is an input or inside one, or two outputs are the same or one is inside the other.
    """
    targets = [(path, _place(path)) for path in outputs]
    sources = [(path, _place(path)) for path in inputs if path is not None and path.exists()]
    for index, (path, place) in enumerate(targets):
        for source, found in sources:
            if _same(place, found):
                raise VoodooError(f"{path}: expected another file than what is read, found the same")
            if place.suffix in numbered and _is_numbered(found, place):
                raise VoodooError(
                    f"{path}: expected other files than what is read, found that {source} can be a person's"
                )
            if found in place.parents and found.is_dir():
                raise VoodooError(f"{path}: expected a place outside of what is read, found one inside {source}")
            if place in found.parents:
                raise VoodooError(f"{path}: expected a place outside of what is read, found a folder with {source}")
        for other, found in targets[:index]:
            both = place.suffix in numbered and (_is_numbered(found, place) or _is_numbered(place, found))
            if _same(place, found) or found in place.parents or place in found.parents or both:
                raise VoodooError(f"{path}: expected outputs that are apart, found {other} in the same place")


def _place(path: Path) -> Path:
    """The absolute place of a name, links followed."""
    return Path(os.path.realpath(path))


def _is_numbered(path: Path, target: Path) -> bool:
    """Whether a file can be that of a person of an output."""
    stem = re.fullmatch(rf"{re.escape(target.stem)}_\d+", path.stem)
    return stem is not None and path.parent == target.parent and path.suffix == target.suffix


def _same(one: Path, other: Path) -> bool:
    return one == other or (one.exists() and other.exists() and one.samefile(other))
