"""What editors know of `voodoo.Config` is what the core says."""

import subprocess
import sys
from pathlib import Path

import pytest

import voodoo
from voodoo._core import config_fields

ROOT = Path(__file__).resolve().parent.parent


def test_the_stub_is_up_to_date():
    command = [sys.executable, str(ROOT / "scripts" / "config_stub.py"), "--check"]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr


def test_the_entries_are_those_of_the_core_in_its_order():
    assert list(voodoo.Config().values()) == list(voodoo.Config.model_fields) == [name for name, *_ in config_fields()]


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
