"""Fixtures shared by all tests."""

import os
from pathlib import Path

import pytest

import voodoo
from ik_cases import ARM, load_example
from voodoo import ik


@pytest.fixture(scope="session")
def voodoo_data() -> Path:
    """Folder with the measurement data, which is not part of the repository; tests that need it are skipped without."""
    default = Path(__file__).resolve().parent.parent.parent / "shared" / "data"
    folder = Path(os.environ.get("VOODOO_DATA", default))
    if not folder.is_dir():
        pytest.skip(f"measurement data not found at {folder}: set VOODOO_DATA to the folder that holds rendered/ etc.")
    return folder


@pytest.fixture(scope="session")
def virtual():
    return load_example("ik_virtual")


@pytest.fixture(scope="session")
def arm():
    return ik.Chain(voodoo.Body.human(1.75, model="papers"), limbs=ARM)
