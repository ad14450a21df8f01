"""What the README tells a reader to run, runs; the documentation has test_docs.py."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

import damage

ROOT = Path(__file__).resolve().parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
VOODOO = [sys.executable, "-c", "from voodoo.cli import main; main()"]


def blocks(text, language):
    return re.findall(rf"^```{language}\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)


def run(command, cwd):
    result = subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stdout + result.stderr
    return result.stdout


@pytest.mark.parametrize("code", blocks(README, "python"))
def test_python_examples_run(code, tmp_path):
    output = run([sys.executable, "-c", code], tmp_path)
    assert output.startswith(("tracking", "degraded"))


def test_the_two_commands_are_there_and_call_what_they_report():
    first, second = (line.split()[0] for line in blocks(README, "sh")[0].splitlines())
    assert (first, second) == ("scripts/demo", "scripts/test")
    for name in (first, second, "scripts/setup", ".ci/run"):
        assert (ROOT / name).stat().st_mode & 0o111, f"{name} is not executable"
        run(["bash", "-n", name], ROOT)
    assert "voodoo demo" in (ROOT / first).read_text() and "pytest" in (ROOT / second).read_text()
    assert second in (ROOT / ".ci" / "run").read_text()


def test_the_commands_on_a_recording_run(tmp_path):
    """The README's `voodoo` lines, on a few frames of the bundled recording."""
    recording = str(damage.beginning(tmp_path / "recording", 12))
    first, *lines = blocks(README, "sh")[1].splitlines()
    assert first.startswith("source .venv/bin/activate")
    for line in lines:
        words = line.split()
        assert words[0] == "voodoo"
        run([*VOODOO, *(recording if word == "RECORDING" else word for word in words[1:])], tmp_path)
    assert len((tmp_path / "pose.csv").read_text().splitlines()) == 1 + 12 and (tmp_path / "pose.bvh").exists()
    assert (tmp_path / "look.mp4").stat().st_size > 1000


def test_the_lamp_is_tracked():
    output = run([sys.executable, str(ROOT / "examples" / "track_lamp.py")], ROOT)
    found = re.search(r"mean error of the bulb: ([\d.]+) mm", output)
    assert found and float(found[1]) < 15.0, output
