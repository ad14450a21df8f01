"""Writes python/voodoo/_config_fields.pyi, what editors know of `voodoo.Config`, from the schema in the core.

python scripts/config_stub.py           writes the file
python scripts/config_stub.py --check   only says whether it is up to date
"""

import sys
import textwrap
from pathlib import Path

import voodoo._core as core

STUB = Path(__file__).resolve().parent.parent / "python" / "voodoo" / "_config_fields.pyi"

HEAD = '''"""Made by scripts/config_stub.py from the schema in the core; do not edit."""

from typing import Literal

from pydantic import BaseModel

class ConfigFields(BaseModel, frozen=True, extra="forbid"):
    """Entries of a configuration, all of them optional keyword arguments of `voodoo.Config`."""

'''


def stub() -> str:
    """The text of the file."""
    return HEAD + "".join(_entry(*row) for row in core.config_fields())


def _entry(
    name: str, doc: str, unit: str, default: object, limits: tuple[float, float] | None, words: list[str]
) -> str:
    kind = "Literal[" + ", ".join(f'"{word}"' for word in words) + "]" if words else type(default).__name__
    value = f'"{default}"' if isinstance(default, str) else repr(default)
    facts = [f"unit: {unit}"] if unit else []
    facts += [f"range: {limits[0]:g} to {limits[1]:g}"] if limits else []
    text = f"{doc} ({'; '.join(facts)})" if facts else doc
    lines = textwrap.wrap(text, width=106)
    quoted = f'    """{lines[0]}"""' if len(lines) == 1 else '    """' + "\n    ".join(lines) + '\n    """'
    return f"    {name}: {kind} = {value}\n{quoted}\n"


if __name__ == "__main__":
    if sys.argv[1:] == ["--check"]:
        if not STUB.is_file() or STUB.read_text(encoding="utf-8") != stub():
            sys.exit(f"{STUB.name} is not up to date: run scripts/config_stub.py")
    elif sys.argv[1:]:
        sys.exit(__doc__)
    else:
        STUB.write_text(stub(), encoding="utf-8")
