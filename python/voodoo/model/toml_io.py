"""Reading TOML with one clear error, of the caller's kind."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from voodoo.errors import VoodooError

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib


def parse_toml(text: str, *, source: str, error: type[VoodooError]) -> dict[str, Any]:
    """The tables of a TOML text.

    Args:
        text: the TOML.
        source: where it comes from, for the message.
        error: what to raise.

    Raises:
        VoodooError: of the class `error`, naming the source and the place of the syntax error.
    """
    if not isinstance(text, str):
        raise error(f"{source}: expected TOML text, found {type(text).__name__}")
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as cause:
        raise error(f"{source}: expected a TOML file, found a syntax error: {cause}") from None


def read_text(path: str | Path, *, error: type[VoodooError]) -> str:
    """The text of a TOML file.

    Raises:
        VoodooError: of the class `error`, naming the file.
    """
    try:
        return Path(path).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as cause:
        raise error(f"{path}: expected a readable TOML file, found: {cause}") from None
