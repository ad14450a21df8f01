"""The package as type checkers and linters see it."""

import ast
import importlib.util
import inspect
import operator
import subprocess
import sys
from pathlib import Path

import pytest

import voodoo._core as _core

ROOT = Path(__file__).resolve().parent.parent


def run(module, *arguments):
    if importlib.util.find_spec(module.split(".")[0]) is None:
        pytest.skip(f"{module} is not installed")
    command = [sys.executable, "-m", module, *arguments]
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stdout + result.stderr


def test_the_stub_agrees_with_the_compiled_module():
    run("mypy.stubtest", "voodoo._core")


def test_help_reports_what_the_stub_reports():
    """Editors read the stub, `help()` and notebooks the compiled module, whose build takes its text from there."""
    stub = ast.parse((ROOT / "python" / "voodoo" / "_core.pyi").read_text(encoding="utf-8"))
    described = {node.name: node for node in stub.body if isinstance(node, (ast.ClassDef, ast.FunctionDef))}
    for outer in [*described.values()]:
        members = outer.body if isinstance(outer, ast.ClassDef) else ()
        described |= {f"{outer.name}.{node.name}": node for node in members if isinstance(node, ast.FunctionDef)}
    message = {name: text for name, node in described.items() if (text := ast.get_docstring(node))}
    assert len(message) > 80
    assert {name: inspect.getdoc(operator.attrgetter(name)(_core)) for name in message} == message


def test_the_package_is_typed_throughout():
    run("mypy")


@pytest.mark.parametrize("arguments", [("check", "."), ("format", "--check", ".")], ids=["check", "format"])
def test_ruff_has_nothing_to_report(arguments):
    run("ruff", *arguments)
