"""Writes a track in any format, selected by the suffix."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from voodoo.errors import VoodooError
from voodoo.export.bvh import write_bvh
from voodoo.export.ros2 import write_bag
from voodoo.export.track import Track
from voodoo.export.trc import write_trc
from voodoo.model.body import Body

FORMATS = (".csv", ".npz", ".bvh", ".trc", ".mcap")
"""Suffixes; a path without one is a ROS 2 bag folder."""


def check_target(path: Path, *, inputs: Sequence[Path] = ()) -> None:
    """Reject a path that cannot or must not be written to, before the work starts.

    Args:
        path: see FORMATS.
        inputs: files that are read and must not be overwritten; marker files and bags can be both inputs and results.

    Raises:
        VoodooError: another suffix, a bag folder that exists, one of the inputs, or a place where nothing can be written.
    """
    if any(path.exists() and other.exists() and path.samefile(other) for other in inputs):
        raise VoodooError(f"{path}: expected another file than what is read, found the same")
    if path.suffix not in FORMATS and not is_folder(path):
        raise VoodooError(
            f"{path}: expected a name that ends in {', '.join(FORMATS)}, or a new folder for a ROS 2 bag, found "
            f"{path.suffix!r}"
        )
    if is_folder(path) and path.exists():
        raise VoodooError(f"{path}: expected a new folder for a ROS 2 bag, found one that exists")
    if path.is_dir():
        raise VoodooError(f"{path}: expected a file, found a folder")
    above = next(folder for folder in path.absolute().parents if folder.exists())
    if not above.is_dir() or not os.access(above, os.W_OK):
        raise VoodooError(f"{path}: expected a folder that can be written to, found {above}")


def is_folder(path: Path) -> bool:
    """Whether a name is that of a bag folder: the part after its last dot, if any, is not a file suffix (run.2026-05-01)."""
    return path.suffix not in FORMATS and not path.suffix[1:].isalpha()


def is_bag(path: Path) -> bool:
    """Whether a name is that of a bag: an .mcap file or a folder."""
    return path.suffix == ".mcap" or is_folder(path)


@contextmanager
def bag_folder(path: Path) -> Iterator[Path]:
    """The folder to write a bag to: `path`, or for .mcap a temporary one, whose only file is moved to `path` at the end."""
    if path.suffix != ".mcap":
        yield path
        return
    with tempfile.TemporaryDirectory(dir=path.parent) as folder:
        bag = Path(folder) / path.stem
        yield bag
        shutil.move(next(bag.glob("*.mcap")), path)


def save(track: Track, path: Path, *, body: Body, root_frame: str) -> None:
    """Write a track: .csv, .npz, .bvh, .trc, .mcap, or a ROS 2 bag folder.

    Args:
        track: with limb poses.
        path: see FORMATS.
        body: in the sizes it was tracked with.
        root_frame: frame of the track, for bags.

    Raises:
        VoodooError: another suffix, or data that the format requires are missing.
        OSError: the file cannot be written.
    """
    check_target(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.suffix == ".bvh":
        write_bvh(path, track, body)
    elif path.suffix == ".trc":
        write_trc(path, track)
    elif is_bag(path):
        with bag_folder(path) as folder:
            write_bag(folder, track, body, root_frame=root_frame)
    else:
        track.save(path)
