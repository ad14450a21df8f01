"""The package as type checkers and linters see it."""

import ast
import importlib.util
import inspect
import subprocess
import sys
from pathlib import Path

import pytest

import voodoo

ROOT = Path(__file__).resolve().parent.parent


def run(module, *arguments):
    if importlib.util.find_spec(module.split(".")[0]) is None:
        pytest.skip(f"{module} is not installed")
    command = [sys.executable, "-m", module, *arguments]
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stdout + result.stderr


def test_the_stub_agrees_with_the_compiled_module():
    run("mypy.stubtest", "voodoo._core")


@pytest.mark.parametrize("name", ["Frame", "Estimate", "TaperedEllipticCylinder", "ClosestPoints"])
def test_help_says_what_the_stub_says(name):
    """Editors read the stub, `help()` and notebooks the compiled module."""
    stub = ast.parse((ROOT / "python" / "voodoo" / "_core.pyi").read_text(encoding="utf-8"))
    (described,) = [node for node in stub.body if isinstance(node, ast.ClassDef) and node.name == name]
    compiled = getattr(voodoo, name)
    assert inspect.getdoc(compiled) == ast.get_docstring(described)
    for entry in described.body:
        if isinstance(entry, ast.FunctionDef) and ast.get_docstring(entry):
            assert inspect.getdoc(getattr(compiled, entry.name)) == ast.get_docstring(entry), entry.name


def test_the_package_is_typed_throughout():
    run("mypy")


@pytest.mark.parametrize("arguments", [("check", "."), ("format", "--check", ".")], ids=["check", "format"])
def test_ruff_has_nothing_to_say(arguments):
    run("ruff", *arguments)
