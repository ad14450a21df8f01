"""Fixtures shared by all tests."""

import hypothesis
import pytest

import voodoo
from ik_cases import ARM
from measurement_data import voodoo_data  # noqa: F401 - a fixture
from voodoo import ik

# The same examples in every run, so that a failure is there again.
hypothesis.settings.register_profile("same", derandomize=True)
hypothesis.settings.load_profile("same")


@pytest.fixture(scope="session")
def arm():
    return ik.Chain(voodoo.Body.human(1.75, model="papers"), limbs=ARM)
