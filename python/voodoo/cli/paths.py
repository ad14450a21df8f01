"""What a command reads and writes, by its options."""

from __future__ import annotations

import re
from collections.abc import Container, Sequence
from pathlib import Path
from typing import Any

import typer
from typer.core import TyperCommand

from voodoo.cli.common import clear_errors
from voodoo.cli.signals import ending

OUTPUTS = {"out", "overlay", "save", "report", "record"}
"""Parameters of commands that name what is written; all others with a metavar of files are read."""
SEARCHED = "RECORDING..."
"""Metavar of folders in which recordings are searched for: the command checks the recordings that it finds."""
_EITHER = ("DIR|FILE.mp4", "FILE")
"""Metavar of outputs that are files or folders."""
_BESIDE = ("truth.csv", "truth_people.csv")
"""Files that are read with a recording in their folder or the one below."""
_FILES = re.compile(r"\b(RECORDING|SOURCE|FILE|DIR|PATH)\b")


class Checked(TyperCommand):
    """A command that begins only if nothing it writes is in the place of what it reads, and that signals end; its errors are
    lines."""

    def invoke(self, ctx: Any) -> Any:  # noqa: ANN401 - Typer brings its own Click, or uses the installed one
        """Check the options, then run the command."""
        with ending(), clear_errors():
            check_paths(ctx)
            return super().invoke(ctx)


def check_paths(context: typer.Context, default: Sequence[Path] = ()) -> None:
    """Reject outputs of a command that would replace its inputs or each other, or cannot be written.

    Args:
        context: of the command.
        default: outputs that no option names.

    Raises:
        VoodooError: see `voodoo.whole.check_outputs` and `check_place`.
    """
    from voodoo.whole import check_outputs, check_place

    outputs, inputs, places = list(default), [], []
    for option in context.command.params:
        if option.name is not None and option.metavar != SEARCHED and _FILES.search(option.metavar or ""):
            value = context.params.get(option.name)
            words = [str(one) for one in (value if isinstance(value, list | tuple) else [value]) if one is not None]
            if option.name in OUTPUTS:
                found = [Path(word) for word in words if "://" not in word]
                # Commands check folders themselves, when they know what they read.
                places += [
                    (path, option.metavar or "") for path in found if option.metavar != "DIR" and str(path) != "-"
                ]
                outputs += found
            else:
                # Also the path in SENSOR=DIR and KIND:SOURCE.
                inputs += [Path(part) for word in words for part in (word, *re.split("[=:]", word, maxsplit=1)[1:])]
    folders = {folder for path in inputs for folder in (path.parent, path.parent.parent)}
    inputs += [folder / name for folder in sorted(folders) for name in _BESIDE]
    numbered: Container[str] = ()
    if context.params.get("people") not in (None, "1"):
        # Loaded where it is needed: a command without outputs starts in half of the time.
        from voodoo.export.files import ONE_PERSON

        numbered = ONE_PERSON
    check_outputs(outputs, inputs, numbered=numbered)
    for path, metavar in places:
        check_place(path, kind="either" if metavar in _EITHER else "file")
