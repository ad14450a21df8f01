"""Finds recordings to evaluate."""

from __future__ import annotations

import fnmatch
from collections.abc import Iterator, Sequence
from pathlib import Path

from voodoo.errors import RecordingError, VoodooError
from voodoo.recordings.loaders import SUFFIXES, guess_loader
from voodoo.recordings.order import natural


def find_recordings(paths: Sequence[Path], *, only: Sequence[str] = ()) -> list[Path]:
    """Recordings at `paths`, in that order; other folders are searched, in natural order of their contents.

    Args:
        paths: recordings, or folders of recordings, e.g. that of UTD-MHAD or of the rendered recordings.
        only: patterns like "a0?_s1_*" or "*_cmu"; a recording is kept if its file or folder name matches one.

    Raises:
        RecordingError: a path does not exist, or no recording is left.
    """
    found: list[Path] = []
    for path in paths:
        if not path.exists():
            raise RecordingError(f"{path}: expected a recording or a folder of recordings, found nothing there")
        inside = [path] if _is_recording(path) else list(_search(path))
        if not inside:
            raise RecordingError(f"{path}: expected a recording or a folder of recordings, found none in it")
        found += inside
    kept = [path for path in found if not only or any(fnmatch.fnmatch(path.name, pattern) for pattern in only)]
    if not kept:
        raise RecordingError(f"expected recordings that fit {' or '.join(only)}, found none among {len(found)}")
    return list(dict.fromkeys(kept))


def _search(folder: Path) -> Iterator[Path]:
    if folder.is_dir():
        for path in sorted(folder.iterdir(), key=lambda path: natural(path.name)):
            if path.is_dir() or path.name.lower().endswith(SUFFIXES):
                yield from [path] if _is_recording(path) else _search(path)


def _is_recording(path: Path) -> bool:
    try:
        guess_loader(path)
    except VoodooError:
        return False
    return True
