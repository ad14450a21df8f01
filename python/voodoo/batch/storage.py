"""Access to recordings and results by fsspec URLs or paths."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from itertools import chain, count
from pathlib import Path
from typing import Any
from urllib.parse import quote, unquote

from voodoo.errors import RecordingError, VoodooError, a_path, reading
from voodoo.evaluation.search import find_recordings
from voodoo.recordings.loaders import SUFFIXES
from voodoo.whole import appearing_whole

_OF_A_FOLDER = re.compile(r"(metadata\.yaml|Calib[^/]*\.toml|calibration\.toml|bag/[^/]*)$")
"""Files that identify a folder as a recording."""
_TABLE = "part-0.parquet"


def filesystem(url: str) -> tuple[Any, str]:
    """The file system of a URL or path, and the path in it.

    Raises:
        VoodooError: fsspec or its library for this protocol is not installed, or the address is invalid.
    """
    try:
        from fsspec.core import url_to_fs

        found: tuple[Any, str] = url_to_fs(url)
    except ImportError as error:
        raise VoodooError(
            f"{url}: fsspec and the library of its protocol are needed: pip install 'voodoo-tracker[batch]' ({error})"
        ) from None
    except Exception as error:
        raise VoodooError(f"{url}: expected a path or a URL that fsspec knows, found: {error}") from error
    return found


def is_local(word: str) -> bool:
    """Whether a word is a path, not a URL of another machine or archive."""
    return "://" not in word or word.startswith(("file://", "local://"))


def local_path(word: str) -> Path:
    """The path of a word that `is_local`.

    Raises:
        VoodooError: it is not a valid path, see `a_path`.
    """
    return a_path(unquote(word.split("://", 1)[1]) if "://" in word else word, error=VoodooError)


def find_sources(words: Sequence[str], *, only: Sequence[str] = ()) -> list[str]:
    """Recordings at paths and URLs; other folders are searched.

    Args:
        words: paths, URLs, or patterns of them (`s3://bucket/*.mcap`).
        only: see voodoo.evaluation.search.find_recordings.

    Raises:
        VoodooError: nothing was found, or a file system cannot be reached.
    """
    found: list[str] = []
    for word in words:
        if is_local(word):
            found += [str(path.absolute()) for path in find_recordings([local_path(word)], only=only)]
        else:
            found += _remote(word, only)
    return list(dict.fromkeys(found))


def _remote(url: str, only: Sequence[str]) -> list[str]:
    from fnmatch import fnmatch

    files, path = filesystem(url)
    with reading(url, "recordings"):
        tops = sorted(files.glob(path)) if "*" in path else [path.rstrip("/")]
        found: list[str] = []
        for top in tops:
            found += _in_folder(files, top) if files.isdir(top) else [top] if files.exists(top) else []
    kept = [one for one in found if not only or any(fnmatch(one.rsplit("/", 1)[-1], pattern) for pattern in only)]
    if not kept:
        raise RecordingError(f"{url}: expected a recording or a folder of recordings, found none")
    return [str(files.unstrip_protocol(one)) for one in kept]


def _in_folder(files: Any, folder: str) -> list[str]:  # noqa: ANN401 - fsspec has no types
    """The recordings in a folder, or the folder itself if it is one."""
    names = [str(name)[len(folder) :].lstrip("/") for name in files.find(folder)]
    if any(_OF_A_FOLDER.fullmatch(name) for name in names):
        return [folder]
    inside: list[str] = []
    for name in sorted({name.split("/", 1)[0] for name in names}):
        whole = f"{folder}/{name}"
        if files.isdir(whole):
            inside += _in_folder(files, whole)
        elif name.lower().endswith(SUFFIXES):
            inside.append(whole)
    return inside


@contextmanager
def on_disk(source: str) -> Iterator[Path]:
    """The recording as a local path, or a local copy that exists until the end of the block.

    Raises:
        RecordingError: it cannot be fetched.
    """
    if is_local(source):
        yield local_path(source)
        return
    with tempfile.TemporaryDirectory(prefix="voodoo-") as folder:
        files, path = filesystem(source)
        target = Path(folder) / path.rstrip("/").rsplit("/", 1)[-1]
        with reading(source, "a recording that can be fetched"):
            files.get(path.rstrip("/"), str(target), recursive=bool(files.isdir(path)))
            for beside in ("-wal", "-journal") if path.endswith(".db3") else ():
                if files.exists(path + beside):  # of a recorder that was killed
                    files.get(path + beside, str(target) + beside)
        yield target


def name_of(source: str) -> str:
    """Name of a recording: that of its file or folder, without suffix."""
    name = local_path(source).name if is_local(source) else source.rstrip("/").rsplit("/", 1)[-1]
    end = next((suffix for suffix in SUFFIXES if name.lower().endswith(suffix)), "")
    return name[: len(name) - len(end)] or "recording"


def named(sources: Sequence[str], taken: dict[str, str]) -> list[tuple[str, str]]:
    """(name, source) pairs; a name that is taken by another source gets a number.

    Args:
        sources: paths and URLs.
        taken: name -> source of earlier runs; their names are kept.
    """
    known = {source: name for name, source in taken.items() if source}
    used, pairs = set(taken), []
    for source in sources:
        base = name_of(source)
        free = (name for name in chain([base], (f"{base}~{number}" for number in count(2))) if name not in used)
        name = known.get(source) or next(free)
        used.add(name)
        pairs.append((name, source))
    return pairs


@dataclass(frozen=True)
class Store:
    """The folder for results.

    Args:
        url: path or URL.
    """

    url: str

    @cached_property
    def _files(self) -> Any:  # noqa: ANN401 - fsspec has no types
        """The file system below the folder."""
        from fsspec.implementations.dirfs import DirFileSystem

        files, path = filesystem(self.url if not is_local(self.url) else str(local_path(self.url).absolute()))
        return DirFileSystem(path.rstrip("/"), files)

    def read(self, name: str) -> str | None:
        """The text of a file; None if it does not exist.

        Raises:
            VoodooError: it cannot be read.
        """
        files = self._files
        with reading(f"{self.url}/{name}", "a readable file", error=VoodooError):
            return files.cat_file(name).decode("utf-8", errors="replace") if files.exists(name) else None

    def write(self, name: str, content: bytes) -> None:
        """Write a file atomically.

        Raises:
            VoodooError: it cannot be written.
        """
        files = self._files
        with reading(f"{self.url}/{name}", "a place that can be written to", error=VoodooError):
            files.makedirs(name.rpartition("/")[0], exist_ok=True)
            if not is_local(self.url):
                files.pipe_file(name, content)  # objects are written atomically
                return
            with appearing_whole(Path(files.path, name)) as part:
                part.write_bytes(content)

    def rename(self, name: str, other: str) -> None:
        """Give a file another name."""
        files = self._files
        with reading(f"{self.url}/{name}", "a file that can be renamed", error=VoodooError):
            files.mv(name, other)

    def place_of(self, recording: str) -> str:
        """Path of a recording's table."""
        return f"frames/recording={quote(recording, safe=' ~+,@()')}/{_TABLE}"

    def opened(self, recording: str) -> Any | None:  # noqa: ANN401 - a file of fsspec
        """A recording's table as a binary file; None if it does not exist."""
        place = self.place_of(recording)
        return self._files.open(place, "rb") if self._files.exists(place) else None

    def names(self, folder: str) -> set[str]:
        """Names of the files in a folder."""
        found = self._files.ls(folder, detail=False) if self._files.isdir(folder) else ()
        return {str(name).rstrip("/").rsplit("/", 1)[-1] for name in found}

    def recordings(self) -> set[str]:
        """Names of recordings with a folder of results."""
        start = "recording="
        return {unquote(name.removeprefix(start)) for name in self.names("frames") if name.startswith(start)}
