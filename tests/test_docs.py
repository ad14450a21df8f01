"""The documentation: code that runs, names and links that lead somewhere, a clean build."""

import functools
import importlib
import importlib.util
import json
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
import typer.main
import typer.testing

import voodoo
from pages import headings, links, prose
from voodoo.cli import app
from voodoo.model.toml_io import parse_toml
from voodoo.pipeline.start import Init
from voodoo.recordings.camera_files import read_calibration, read_camera_toml
from voodoo.recordings.marker_files import MarkerMap

ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / "docs"
PAGES = sorted(page for page in DOCS.rglob("*.md") if "_build" not in page.parts)
TEXTS = [*PAGES, ROOT / "README.md", ROOT / "CHANGELOG.md"]
CHEAP = ("info", "config", "body")

voodoo_command = typer.main.get_command(app)


@dataclass(frozen=True)
class Block:
    """A fenced block: its language, its text, and what it needs to run."""

    language: str
    text: str
    needs: str


@functools.cache
def blocks(page: Path) -> list[Block]:
    fence = r"(?:^<!-- needs: (\w+) -->\n)?^```([\w{}-]*)\n(.*?)^```$"
    found = re.findall(fence, page.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    return [Block(language, text, needs) for needs, language, text in found]


def name(page: Path) -> str:
    return str(page.relative_to(ROOT))


def with_blocks(*languages: str) -> list[Path]:
    return [page for page in PAGES if any(block.language in languages for block in blocks(page))]


@pytest.mark.parametrize("page", with_blocks("python"), ids=name)
def test_python_runs(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """All blocks of a page, one after the other, as a reader would type them."""
    monkeypatch.chdir(tmp_path)
    space: dict[str, object] = {"__name__": "__docs__"}
    monkeypatch.setitem(sys.modules, "__docs__", type(sys)("__docs__"))  # dataclasses look for their module
    for block in blocks(page):
        if block.language == "python" and (not block.needs or importlib.util.find_spec(block.needs)):
            exec(compile(block.text, name(page), "exec"), space)


def command_lines(page: Path, *, inline: bool) -> Iterator[list[str]]:
    """Every `voodoo ...` of shell blocks, and of code in the text, as words."""
    lines = [line for block in blocks(page) if block.language == "sh" for line in block.text.splitlines()]
    if inline:
        lines += re.findall(r"`(voodoo [^`]+)`", re.sub(r"\s+", " ", prose(page)))
    for line in lines:
        words = shlex.split(line, comments=True)
        if words and words[0] in ("voodoo", ".venv/bin/voodoo"):
            yield words[1:]


@pytest.mark.parametrize("page", [*PAGES, ROOT / "README.md"], ids=name)
def test_commands_and_options_exist(page: Path):
    commands = voodoo_command.commands
    for words in command_lines(page, inline=True):
        command = words[0]
        options = [word.partition("=")[0] for word in words if word.startswith("--")]
        if command.startswith("--"):
            known = {"--help", "--version"}
        elif command == "COMMAND":
            known = {"--help"}
        else:
            assert command in commands, f"{name(page)}: voodoo {command}"
            known = {"--help"}.union(*([*option.opts, *option.secondary_opts] for option in commands[command].params))
        assert set(options) <= known, f"{name(page)}: voodoo {' '.join(words)}"


@pytest.mark.parametrize("page", with_blocks("sh"), ids=name)
def test_cheap_commands_run(page: Path):
    places = {"RECORDING": str(voodoo.recordings.sample_path())}
    for words in command_lines(page, inline=False):
        if words[0] in CHEAP:
            words = [places.get(word, str(ROOT / word) if (ROOT / word).exists() else word) for word in words]
            result = typer.testing.CliRunner().invoke(app, words)
            assert result.exit_code == 0 and result.output, f"{name(page)}: {words}: {result.output}"


@pytest.mark.parametrize("page", with_blocks("toml", "json"), ids=name)
def test_files_can_be_read(page: Path, tmp_path: Path):
    for block in blocks(page):
        file = tmp_path / f"file.{block.language}"
        file.write_text(block.text, encoding="utf-8")
        if block.language == "json":
            assert "joints" in json.loads(block.text) and Init.load(file).joints
        elif block.language == "toml":
            keys = parse_toml(block.text, source=name(page), error=ValueError)
            if "limbs" in keys and "name" in keys:
                assert voodoo.Body.load(file).site_names == ("tip",)
            elif any(isinstance(table, dict) and "matrix" in table for table in keys.values()):
                assert read_camera_toml(file)[0].camera.width == 1088
            elif "sites" in keys:
                assert MarkerMap.load(file).sites
            else:
                assert read_calibration(file).depth.camera.width == 640


@pytest.mark.parametrize("page", [*TEXTS, ROOT / "ARCHITECTURE.md"], ids=name)
def test_links_lead_somewhere(page: Path):
    for target, anchor in links(page):
        assert target.exists(), f"{name(page)} links to {target}"
        assert not anchor or anchor in headings(target), f"{name(page)} links to #{anchor} of {name(target)}"


@pytest.mark.parametrize(
    "question",
    ["Track a recording of your own", "What a status means", "Add a sensor of your own", "What was measured"],
)
def test_two_steps_from_the_front_page(question: str):
    reached = {DOCS / "index.md"}
    for _ in range(2):
        reached |= {target for page in reached for target, _ in links(page) if target in PAGES}
    assert any(re.search(rf"^#+ {question}$", prose(page), re.MULTILINE) for page in reached)


@pytest.mark.parametrize("page", [*PAGES, ROOT / "README.md"], ids=name)
def test_names_exist(page: Path):
    """`voodoo.x.Y` in the text can be imported; scripts, examples and files of the crates are there."""
    code = re.findall(r"`([^`]+)`", re.sub(r"\s+", " ", prose(page)))
    for path in {match for text in code for match in re.findall(r"(?<![/\w])voodoo(?:\.\w+)+", text)}:
        parts, found = path.split(".")[1:], voodoo
        for count, part in enumerate(parts, 1):
            if not hasattr(found, part):
                importlib.import_module(".".join(["voodoo", *parts[:count]]))
            found = getattr(found, part)
    rooms = r"(?:^|\s)((?:examples|benches|lab|tests|scripts|python)/[\w./]+)"
    for path in {match for text in code for match in re.findall(rooms, text)}:
        assert (ROOT / path).exists(), f"{name(page)} names {path}"
    sources = [path.as_posix() for path in (ROOT / "crates").rglob("*.rs")]
    for path in {text for text in code if re.fullmatch(r"[\w/]+\.rs", text)}:
        assert any(source.endswith(f"/{path}") for source in sources), f"{name(page)} names {path} of the crates"


def test_the_pages_build_without_a_warning(tmp_path: Path):
    options = ["--builder", "html", "--fail-on-warning", "--keep-going", "--nitpicky", "--quiet"]
    done = subprocess.run(
        [sys.executable, "-m", "sphinx", *options, DOCS, tmp_path], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    for page, words in {
        "reference/command-line": "--depth-range",
        "reference/configuration": "motion_scale",
        "reference/python-api": "add_depth",
        "project/architecture": "crates",
    }.items():
        assert words in (tmp_path / f"{page}.html").read_text(encoding="utf-8"), page
    listed = re.findall(r"^- `(voodoo\.[\w.]+)`", (DOCS / "reference/python-api.md").read_text(encoding="utf-8"), re.M)
    built = (tmp_path / "reference/python-api.html").read_text(encoding="utf-8")
    assert len(listed) > 100
    assert [public for public in listed if not re.search(rf'id="(module-)?{re.escape(public)}"', built)] == []
