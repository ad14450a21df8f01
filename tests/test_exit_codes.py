"""A room without a person is the same exit code for every command."""

import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

import voodoo
import voodoo.people
from voodoo.cli import app
from voodoo.cli.common import EXIT_CODES, NO_POSE

ROW, COLUMN = np.mgrid[:60, :80]


@pytest.fixture(scope="module")
def room(tmp_path_factory):
    """A wall in depth images of a folder, and a truth beside it."""
    folder = tmp_path_factory.mktemp("rooms") / "room"
    (folder / "depth").mkdir(parents=True)
    for index in range(4):
        assert cv2.imwrite(str(folder / f"depth/{index:04d}.png"), (3000 + index + 2 * COLUMN + ROW).astype(np.uint16))
    lines = "width=80\nheight=60\nfx=66\nfy=66\ncx=39.5\ncy=29.5\n"
    (folder / "calibration.toml").write_text(lines)
    sample = (voodoo.recordings.sample_path() / "truth.csv").read_text().splitlines()
    rows = [",".join([f"{index / 30:.6f}", *sample[1].split(",")[1:]]) for index in range(4)]
    (folder / "truth.csv").write_text("\n".join([sample[0], *rows]) + "\n")
    return folder


@pytest.mark.parametrize(
    "words",
    [
        "track",
        "track --people any",
        "init",
        "ik --pictures none --init auto",
        "eval --init auto",
        "batch --init auto --workers 1 --out out",
        "live --rate 20",
    ],
)
def test_nobody_is_the_same_exit_code_everywhere(room, words, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    if words.startswith("batch"):
        pytest.importorskip("distributed")
        pytest.importorskip("pyarrow")
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(app, [*words.split(), str(room), *(["--init", "auto"] if words == "track" else [])])
    assert done.exit_code == NO_POSE, done.output
    assert "nobody" in done.stderr.splitlines()[-1]


@pytest.mark.parametrize("words", ["track --init auto", "live --rate 20", "live --rate 20 --out pose.csv"])
def test_nothing_usable_is_that_code_as_well(room, words, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    blank = Path(shutil.copytree(room, tmp_path / "blank"))
    for file in (blank / "depth").iterdir():
        cv2.imwrite(str(file), np.zeros((60, 80), np.uint16))
    done = CliRunner().invoke(app, [*words.split(), str(blank)])
    assert done.exit_code == NO_POSE, done.output
    assert "blank" in done.stderr and not Path("pose.csv").exists()


def test_the_page_has_every_code():
    page = (Path(__file__).parent.parent / "docs/reference/command-line.md").read_text()
    assert "% generated: exit_codes" in page and set(EXIT_CODES) == {0, 1, 2, NO_POSE, 130, 143, 129, 141}
