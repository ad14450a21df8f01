"""What editors know of `voodoo.Config` is what the core says."""

import subprocess
import sys
from pathlib import Path

import voodoo
from voodoo._core import config_fields

ROOT = Path(__file__).resolve().parent.parent


def test_the_stub_is_up_to_date():
    command = [sys.executable, str(ROOT / "scripts" / "config_stub.py"), "--check"]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr


def test_the_entries_are_those_of_the_core_in_its_order():
    assert list(voodoo.Config().values()) == list(voodoo.Config.model_fields) == [name for name, *_ in config_fields()]
