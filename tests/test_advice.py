"""Advice in messages: every option, command, extra and page that a text of the program names is there, and works."""

import ast
import re
from pathlib import Path

import cv2
import numpy as np
import pytest
import typer.main

import voodoo
from commands import run
from voodoo.cli import app
from voodoo.cli.options import numbers_of, topics_of
from voodoo.cli.running import kinds_of
from voodoo.config import Config
from voodoo.model.toml_io import parse_toml
from voodoo.recordings.loaders import LOADERS, options_of

ROOT = Path(__file__).resolve().parent.parent
COMMANDS = typer.main.get_command(app).commands
OPTIONS = {
    name: item
    for command in COMMANDS.values()
    for item in command.params
    for name in (*item.opts, *item.secondary_opts)
}
OPTIONS |= {"--help": None, "--version": None}
FOREIGN = {"--bind", "--port", "--serve-web", "--web-viewer-port", "--server-memory-limit", "--output"}
"""Of other programs."""


def texts():
    """(module, text) of every string of the program that is no docstring; what is filled in is X."""
    for path in sorted((ROOT / "python/voodoo").rglob("*.py")):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        skipped = {
            id(node.value)
            for node in ast.walk(tree)
            if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
        }
        for node in ast.walk(tree):
            if isinstance(node, ast.JoinedStr):
                skipped |= {id(part) for part in node.values}
                parts = [str(part.value) if isinstance(part, ast.Constant) else "X" for part in node.values]
                yield path.stem, "".join(parts)
            elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in skipped:
                yield path.stem, node.value


TEXTS = list(texts())


def advices(pattern):
    """The matches of a pattern in all texts, with the modules that say so."""
    return {found: module for module, text in TEXTS for found in re.findall(pattern, text)}


def test_every_option_that_is_named_is_there():
    named = advices(r"(?<![\w-])--[a-z][a-z-]+")
    assert len(named) > 25
    assert set(named) - set(OPTIONS) - FOREIGN == set()


def test_every_option_with_a_value_takes_one_and_no_flag_does():
    for option, value in advices(r"(?<![\w-])(--[a-z][a-z-]+) ([A-Z]{3,}|[a-z_]+=)"):
        if option not in FOREIGN:
            assert not OPTIONS[option].is_flag, f"{option} {value}"


@pytest.mark.parametrize("advice", advices(r"--option ([a-z_]+=[\w.]+)"))
def test_every_number_for_a_loader_is_one(advice):
    (name,) = numbers_of([re.sub("=[A-Z]+", "=1", advice)])
    assert any(name in options_of(loader) for loader in LOADERS)


@pytest.mark.parametrize("advice", advices(r"--topic ([a-z_]+=/?\w+)"))
def test_every_topic_has_a_kind(advice):
    assert topics_of([advice])


@pytest.mark.parametrize("advice", advices(r"--use ([a-z]+(?:,[a-z]+)*)"))
def test_every_kind_of_input_is_one(advice):
    assert kinds_of(advice)


def test_every_command_extra_and_page_is_there():
    commands = set(advices(r"\bvoodoo ([a-z]+) (?:[A-Z]|--|says|prints)"))
    assert commands and commands <= set(COMMANDS)
    extras = parse_toml((ROOT / "pyproject.toml").read_text(), source="pyproject", error=ValueError)["project"]
    named = set(advices(r"voodoo-tracker\[(\w+)\]"))
    assert len(named) > 4 and named <= set(extras["optional-dependencies"])
    pages = advices(r"\bdocs/[\w/-]+\.md")
    assert pages and all((ROOT / page).is_file() for page in pages)


@pytest.fixture
def images(tmp_path):
    (tmp_path / "depth").mkdir()
    for index in range(3):
        cv2.imwrite(str(tmp_path / f"depth/{index}.png"), np.full((60, 80), 4000 + index, np.uint16))
    return tmp_path


def test_a_missing_calibration_is_written_as_the_template_says(images):
    done = run("info", images)
    assert done.exit_code == 1
    name, template = re.search(r"Write (\S+\.toml)[^\n]*\n\n(.*)", done.stderr, re.DOTALL).groups()
    Path(name).write_text(template.replace("640", "80").replace("480", "60"))
    assert run("info", images).exit_code == 0, template


def test_a_rate_is_given_as_the_note_says(images):
    (images / "calibration.toml").write_text("width=80\nheight=60\nfx=66\nfy=66\ncx=39.5\ncy=29.5\n")
    assert "--option rate=N says another rate" in run("info", images).stdout
    told = run("info", images, "--option", "rate=15").stdout
    assert "at 15.00 Hz" in told and "says another rate" not in told


def test_a_pose_is_found_edited_and_given_back(tmp_path):
    """What init and its help advise."""
    start = tmp_path / "start.json"
    assert run("init", voodoo.recordings.sample_path(), "--out", start).exit_code == 0
    done = run("track", voodoo.recordings.sample_path(), "--init", start, "--out", tmp_path / "o.csv")
    assert done.exit_code == 0, done.stderr


def test_every_entry_of_the_configuration_that_is_named_is_one():
    named = advices(r"\bConfig\.([a-z_]+)\b(?!\()")
    assert set(named) <= set(Config().values())
