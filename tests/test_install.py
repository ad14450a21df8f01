"""What is published: names, metadata, and that nobody is sent to a stranger's package."""

import re
import subprocess
from importlib.metadata import metadata, version
from pathlib import Path

import pytest

import voodoo
from voodoo.model.toml_io import parse_toml

ROOT = Path(__file__).resolve().parent.parent
PROJECT = parse_toml((ROOT / "pyproject.toml").read_text(encoding="utf-8"), source="pyproject", error=ValueError)[
    "project"
]
DISTRIBUTION = "voodoo-tracker"


def tracked_files():
    found = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=False)
    if found.returncode:
        pytest.skip("not a git checkout")
    return [ROOT / name for name in found.stdout.splitlines() if not name.startswith("tests/")]


def test_nobody_is_asked_to_install_the_new_persons_package():
    for path in tracked_files():
        if (
            path.is_file()
            and path.suffix in (".py", ".pyi", ".md", ".toml", ".rs", ".yml", "")
            and path.stat().st_size < 10**6
        ):
            text = path.read_text(encoding="utf-8", errors="replace")
            wrong = re.findall(r"pip install [^\n`&;|]*\bvoodoo(?![-_\w/.])[^\n`]*", text)
            assert not wrong, f"{path.relative_to(ROOT)}: {wrong}"


def test_the_distribution_has_its_own_name():
    assert PROJECT["name"] == DISTRIBUTION
    assert version(DISTRIBUTION) == voodoo.__version__
    assert DISTRIBUTION in (ROOT / "README.md").read_text(encoding="utf-8")


def test_the_metadata_is_complete():
    message = metadata(DISTRIBUTION)
    assert message["Requires-Python"] == ">=3.10" and message["License-Expression"] == "MIT OR Apache-2.0"
    assert len(message.get_all("Classifier")) > 10 and message["Keywords"] and message["Maintainer"]
    for minor in range(10, 15):
        assert f"Programming Language :: Python :: 3.{minor}" in message.get_all("Classifier")
    extras = set(message.get_all("Provides-Extra"))
    assert {"view", "docs", "test", "training"} <= extras


def test_the_description_needs_no_repository():
    """It is shown where links into the repository lead nowhere."""
    text = (ROOT / PROJECT["readme"]).read_text(encoding="utf-8")
    assert re.findall(r"\]\((?!https?:)[^)]*\)", text) == [] and "![" not in text
    for words in ("no safety device", "children", "wheelchairs", DISTRIBUTION):
        assert words in text
    for words in ("no safety device", "children", "wheelchairs", "skirts", "loads"):
        assert words in (ROOT / "README.md").read_text(encoding="utf-8")


def test_the_workflow_builds_for_every_platform():
    text = (ROOT / ".github" / "workflows" / "wheels.yml").read_text(encoding="utf-8")
    for words in (
        "manylinux_2_28",
        "musllinux_1_2",
        "aarch64",
        "x86_64",
        "macos",
        "windows",
        "sdist",
        "twine check --strict",
    ):
        assert words in text, words
    assert "--compatibility manylinux_2_28" in (ROOT / "scripts" / "wheel").read_text(encoding="utf-8")
