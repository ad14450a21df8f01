"""`voodoo recover`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from voodoo.cli.common import print_message, refuse_missing, wrote
from voodoo.errors import VoodooError, reason


def recover_command(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="Where the results should have been written.")],
) -> None:
    """Make the files of voodoo track, live and ik that were killed, or ended by a power cut.

    The next one that writes into FOLDER does the same. An existing file is not replaced: NAME.recovered.csv is
    written beside it.
    """
    from voodoo.export.spool import recover

    if not folder.is_dir():
        raise VoodooError(f"{folder}: expected a folder, found none")
    done, failed = recover(folder)
    message = f"{len(done)} files recovered{wrote(done)}"
    refuse_missing(failed, message)
    typer.echo(message)


def recover_before(targets: Sequence[Path]) -> None:
    """Make the files that killed commands left in the folders of outputs, and print which."""
    from voodoo.export.spool import recover

    for folder in dict.fromkeys(target.parent for target in targets):
        done, failed = recover(folder, taken=targets)
        for path in done:
            print_message(f"recovered {path} of a command that did not end")
        for error in failed:
            print_message(f"not recovered: {reason(error)}")
