"""A result's file: which names it may have, and that it appears only when it is complete."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from voodoo.errors import VoodooError

SUFFIXES = (".csv", ".npz")


@contextmanager
def appearing_whole(path: Path) -> Iterator[Path]:
    """Another file to write a result to, which becomes this one when it is complete.

    Raises:
        VoodooError: another suffix than those of results.
    """
    check_suffix(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(f".{path.name}.part")
    try:
        yield part
        os.replace(part, path)  # noqa: PTH105 - the replacement must be atomic
    finally:
        part.unlink(missing_ok=True)


def check_suffix(path: Path) -> None:
    """Refuse result files that are neither .csv nor .npz.

    Raises:
        VoodooError: names both.
    """
    if path.suffix not in SUFFIXES:
        raise VoodooError(f"{path}: expected a name that ends in {' or '.join(SUFFIXES)}, found {path.suffix!r}")
