"""Which names a result may have."""

from __future__ import annotations

from pathlib import Path

from voodoo.errors import VoodooError

SUFFIXES = (".csv", ".npz")


def check_suffix(path: Path) -> None:
    """Refuse result files that are neither .csv nor .npz.

    Raises:
        VoodooError: names both.
    """
    if path.suffix not in SUFFIXES:
        raise VoodooError(f"{path}: expected a name that ends in {' or '.join(SUFFIXES)}, found {path.suffix!r}")
