"""Fixtures shared by all tests."""

import pytest

import voodoo
from ik_cases import ARM
from measurement_data import voodoo_data  # noqa: F401 - a fixture
from voodoo import ik


@pytest.fixture(scope="session")
def arm():
    return ik.Chain(voodoo.Body.human(1.75, model="papers"), limbs=ARM)
