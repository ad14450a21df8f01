"""What editors know of `voodoo.Config` is what the core says."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import voodoo
from voodoo._core import config_fields

ROOT = Path(__file__).resolve().parent.parent
STUB = ROOT / "python" / "voodoo" / "_config_fields.pyi"


def test_the_stub_is_up_to_date():
    command = [sys.executable, str(ROOT / "scripts" / "config_stub.py"), "--check"]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr


def test_names_kinds_and_defaults_are_those_of_the_core():
    (fields,) = [node for node in ast.parse(STUB.read_text(encoding="utf-8")).body if isinstance(node, ast.ClassDef)]
    found = {
        node.target.id: (ast.unparse(node.annotation), ast.literal_eval(node.value))
        for node in fields.body
        if isinstance(node, ast.AnnAssign)
    }
    expected = {
        name: (f"Literal[{', '.join(map(repr, words))}]" if words else type(default).__name__, default)
        for name, _, _, default, _, words in config_fields()
    }
    assert found == expected
    assert list(found) == list(voodoo.Config().values()) == list(voodoo.Config.model_fields)
    assert {name: value for name, (_, value) in found.items()} == voodoo.Config().values()


def test_editing_keeps_comments_order_and_layout():
    text = "# of the kitchen robot\nthreads = 1   # one core\n\nsolver = 'tree'\n"
    config = voodoo.Config(solver="tree", threads=2, max_steps=3)
    edited = config.to_toml(edit=text)
    assert edited.startswith("# of the kitchen robot\nthreads = 2   # one core\n\nsolver = 'tree'\n")
    assert voodoo.Config.from_toml(edited) == config
    assert edited.count("=") == 3, "entries at their defaults are not added"
    assert config.to_toml(edit=edited) == edited
    with pytest.raises(voodoo.ConfigError, match="syntax"):
        config.to_toml(edit="threads =")
