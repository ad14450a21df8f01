"""Where the measurement data lies: a fixture for the tests of the product and of lab/."""

import os
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def voodoo_data() -> Path:
    """Folder with the measurement data, which is not part of the repository; tests that need it are skipped without."""
    default = Path(__file__).resolve().parent.parent.parent / "shared" / "data"
    folder = Path(os.environ.get("VOODOO_DATA", default))
    if not folder.is_dir():
        pytest.skip(f"measurement data not found at {folder}: set VOODOO_DATA to the folder that holds rendered/ etc.")
    return folder


def data_folder(voodoo_data: Path, *parts: str) -> Path:
    """A folder of the measurement data; tests that need it are skipped without."""
    folder = voodoo_data.joinpath(*parts)
    if not folder.is_dir():
        pytest.skip(f"expected measurement data at {folder}")
    return folder
