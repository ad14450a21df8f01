"""Fixtures of the tests of lab/, which use the helpers of tests/."""

import sys
from pathlib import Path

import pytest

LAB = Path(__file__).resolve().parent.parent
for folder in (LAB.parent, LAB.parent / "tests", LAB / "experiments"):
    sys.path.insert(0, str(folder))

from lab_scripts import load_experiment  # noqa: E402
from measurement_data import voodoo_data  # noqa: E402, F401 - a fixture


@pytest.fixture(scope="session")
def virtual():
    return load_experiment("ik_virtual")
