"""An environment with an extra of this package, beside the one the tests run in: made from the package index."""

import subprocess
import sysconfig
import venv
from pathlib import Path

import pytest

from voodoo.model.toml_io import parse_toml

ROOT = Path(__file__).resolve().parent.parent
SECONDS = 300


def environment(folder: Path, extra: str) -> Path:
    """Its Python, with all that this one has and the requirements of the extra; the test is skipped without an index."""
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    expected = parse_toml(text, source="pyproject", error=ValueError)["project"]["optional-dependencies"][extra]
    venv.create(folder, with_pip=True)
    python = folder / "bin" / "python"
    (own,) = folder.glob("lib/python*/site-packages")
    paths = [sysconfig.get_path("purelib"), sysconfig.get_path("platlib")]
    (own / "tests.pth").write_text("\n".join(dict.fromkeys(paths)) + "\n")
    done = subprocess.run(
        [python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", *expected],
        capture_output=True, text=True, timeout=SECONDS, check=False,
    )  # fmt: skip
    if done.returncode:
        pytest.skip(f"the extra {extra} cannot be installed here: {done.stderr.strip().splitlines()[-1:]}")
    return python
