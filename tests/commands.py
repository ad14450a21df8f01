"""Runs commands and loads scripts for tests."""

import importlib.util
import sys

from typer.testing import CliRunner

from voodoo.cli import app


def run(*arguments):
    """Runs a command in this process."""
    return CliRunner().invoke(app, [str(argument) for argument in arguments], env={"COLUMNS": "200"})


def refused(done, *words):
    """Checks that a command ended with one message of an error, which names `words`; its lines are short."""
    assert done.exit_code == 1, done.output
    first, *more = done.stderr.splitlines()
    assert first.startswith("voodoo: ") and all(line.startswith("  ") for line in more), done.stderr
    assert all(len(line) <= 200 or len(line.split()) == 1 for line in (first, *more)), done.stderr
    said = " ".join(done.stderr.split())
    assert len(said) < 1000, said
    for word in words:
        assert word in said, said


def load_script(path):
    """The module of a script, which is not in a package."""
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[path.stem] = module
    spec.loader.exec_module(module)
    return module
