"""Reads TOML with errors of the caller's class."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from voodoo.errors import VoodooError, a_path, reading, shortened
from voodoo.stored import MOST_METADATA, read_stored_text

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib


def parse_toml(text: str, *, source: str, error: type[VoodooError]) -> dict[str, Any]:
    """The tables of a TOML text.

    Args:
        text: the TOML.
        source: origin of the text, for the message.
        error: class of the error.

    Raises:
        VoodooError: of the class `error`, naming the source and the place of the syntax error.
    """
    if not isinstance(text, str):
        raise error(f"{source}: expected TOML text, found {type(text).__name__}")
    # Deeply nested tables and numbers with thousands of digits raise other errors in the parser.
    with reading(source, "a TOML file", error=error):
        try:
            return tomllib.loads(text)
        except tomllib.TOMLDecodeError as cause:
            raise error(f"{source}: expected a TOML file, found a syntax error: {shortened(str(cause))}") from None


def read_text(path: str | Path, *, error: type[VoodooError]) -> str:
    """The text of a TOML file.

    Raises:
        VoodooError: of the class `error`, naming the file.
    """
    return read_stored_text(a_path(path, error=error), "a readable TOML file", most=MOST_METADATA, error=error)
