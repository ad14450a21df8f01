"""Runs commands and loads scripts for tests."""

import importlib.util
import sys

from typer.testing import CliRunner

from voodoo.cli import app


def run(*arguments):
    """Runs a command in this process."""
    return CliRunner().invoke(app, [str(argument) for argument in arguments], env={"COLUMNS": "200"})


def refused(done, *words):
    """Checks that a command ended with one line of an error, which names `words`."""
    assert done.exit_code == 1, done.output
    assert done.stderr.startswith("voodoo: ") and done.stderr.count("\n") == 1 and len(done.stderr) < 1000, done.stderr
    for word in words:
        assert word in done.stderr, done.stderr


def load_script(path):
    """The module of a script, which is not in a package."""
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[path.stem] = module
    spec.loader.exec_module(module)
    return module
