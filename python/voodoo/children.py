"""Starts child processes: without the current folder on their path, and without the telemetry of what they run."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing import util
from pathlib import Path
from typing import Any

NEUTRAL_FOLDER = os.path.abspath(os.sep)  # noqa: PTH100 - a string for subprocess
"""Working directory for programs that need no files of the user: only the administrator can write there."""
_QUIET = Path(__file__).resolve().parent / "data" / "quiet"
"""A configuration folder in which telemetry is off; see `children`."""
_ANALYTICS = "FORCE_RERUN_ANALYTICS"
"""Environment variable of Rerun that turns its telemetry on."""


@contextmanager
def children(*, quiet: bool = False) -> Iterator[None]:
    """Child processes started inside do not import modules from the current folder.

    `python -m` and `python -c`, which `multiprocessing` uses, search it first, so that whoever can write to the current
    folder could run code. All child processes of this package are started inside this block. It changes the environment
    of this process while it lasts.

    Args:
        quiet: Rerun's telemetry is off, unless the user sets FORCE_RERUN_ANALYTICS.
    """
    values = {"PYTHONSAFEPATH": "1"}
    if quiet and not os.environ.get(_ANALYTICS):
        values["XDG_CONFIG_HOME"] = str(_QUIET)
    before = {name: os.environ[name] for name in values if name in os.environ}
    tools: Any = util
    flags = tools._args_from_interpreter_flags
    if sys.version_info < (3, 11):  # it does not know PYTHONSAFEPATH; multiprocessing sends the path of modules itself
        tools._args_from_interpreter_flags = lambda: [*flags(), "-I"]
    os.environ.update(values)
    try:
        yield
    finally:
        tools._args_from_interpreter_flags = flags
        for name in values.keys() - before.keys():
            os.environ.pop(name, None)
        os.environ.update(before)
