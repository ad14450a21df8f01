"""What is published: names, metadata, and that nobody is sent to a stranger's package."""

import json
import os
import re
import shutil
import subprocess
import sys
import threading
import venv
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from importlib.metadata import metadata, version
from pathlib import Path
from zipfile import ZipFile

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


class Quiet(SimpleHTTPRequestHandler):
    def log_message(self, *words):
        pass


@pytest.fixture
def index(tmp_path):
    """Address of a package index that holds the wheel of scripts/setup, and nothing else."""
    wheels = sorted((ROOT / "target" / "wheels").glob("voodoo_tracker-*.whl"))
    if not wheels:
        pytest.skip("no wheel in target/wheels: scripts/setup builds it")
    folder = tmp_path / "index" / "simple" / DISTRIBUTION
    folder.mkdir(parents=True)
    shutil.copy(wheels[-1], folder)
    (folder / "index.html").write_text(f"<a href='{wheels[-1].name}'>{wheels[-1].name}</a>")
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=str(tmp_path / "index")))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_port}/simple"
    server.shutdown()


@pytest.mark.long
def test_a_stranger_installs_it_from_an_index_and_runs_the_demo(index, tmp_path):
    """Its dependencies are those of the usual index; no compiler is found."""
    venv.create(tmp_path / "env", with_pip=True)
    programs = tmp_path / "env" / ("Scripts" if sys.platform == "win32" else "bin")
    plain = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    plain |= {"CC": "/nowhere", "CARGO": "/nowhere"}
    pip = [programs / "python", "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    subprocess.run([*pip, "--extra-index-url", index, DISTRIBUTION], check=True, cwd=tmp_path, env=plain)
    done = subprocess.run([programs / "voodoo", "demo"], cwd=tmp_path, env=plain, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "voodoo-demo" / "pose.csv").is_file()
    uvx = shutil.which("uvx")
    if uvx is not None:
        (tmp_path / "uvx").mkdir()
        words = [uvx, "--index", index, "--python", sys.executable, DISTRIBUTION, "demo"]
        done = subprocess.run(words, cwd=tmp_path / "uvx", env=plain, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        assert (tmp_path / "uvx" / "voodoo-demo" / "pose.csv").is_file()


@pytest.mark.long
def test_the_wheel_names_what_it_was_built_of(index, tmp_path):
    (wheel,) = (tmp_path / "index").rglob("*.whl")
    with ZipFile(wheel) as content:
        (name,) = [name for name in content.namelist() if name.endswith(".cyclonedx.json")]
        told = json.loads(content.read(name))
    assert told["bomFormat"] == "CycloneDX" and "pyo3" in {one["name"] for one in told["components"]}


def test_a_release_publishes_what_was_tested_without_a_token():
    text = (ROOT / ".github" / "workflows" / "release.yml").read_text(encoding="utf-8")
    for words in ("id-token: write", "attest-build-provenance@", "gh-action-pypi-publish@", "sboms", "needs: wheels"):
        assert words in text, words
    assert "password" not in text and "secrets" not in text
    assert all(re.search(r"@[0-9a-f]{40} # v", line) for line in text.splitlines() if re.search(r"uses: \w+/", line))


def test_recipes_name_the_dependencies():
    recipe = (ROOT / "lab" / "packaging" / "recipe.yaml").read_text(encoding="utf-8")
    for word in PROJECT["dependencies"]:
        name = re.match(r"[\w.-]+", word)[0].removesuffix("-python-headless").replace("opencv", "py-opencv")
        assert f"- {name}" in recipe, name
    assert re.search(r"^voodoo-tracker:$", (ROOT / "lab" / "packaging" / "rosdep.yaml").read_text(), re.M)
