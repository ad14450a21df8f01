"""Child processes import nothing from the current folder, and what they run reports nothing to anybody."""

import importlib.metadata
import json
import os
import socket
import subprocess
import sys
from pathlib import Path

import grimp
import pytest

import damage
import voodoo
from voodoo.children import children
from voodoo.cli import app
from voodoo.visualization.rerun_server import Server

COMMANDS = {
    "eval": ["a", "b", "--use", "depth", "--jobs", "2"],
    "track": ["a", "--use", "depth", "--out", "o.csv"],
    "live": ["a", "--rate", "20", "--duration", "1", "--out", "l.csv"],
    "demo": ["--out", "d.mp4"],
    "init": ["a", "--out", "i.json"],
    "ik": ["a", "--out", "k.csv"],
    "batch": ["a", "--out", "many"],
    "recover": ["."],
    "report": ["a/pose.csv", "--out", "r.html"],
    "info": ["a"],
    "config": [],
    "body": [],
}
SERVED = """
import json, os, socket, sys, time
words = sys.argv
ports = [int(words[words.index(name) + 1]) for name in ("--port", "--web-viewer-port")]
note = {"path": [os.path.realpath(item) for item in sys.path], "cwd": os.getcwd(), "environment": dict(os.environ)}
json.dump(note, open(os.environ["NOTE"], "w"))
sockets = [socket.create_server(("127.0.0.1", port)) for port in ports]
time.sleep(30)
"""


@pytest.fixture
def trapped(tmp_path, monkeypatch):
    """The current folder has a module of every name that can be imported; each leaves a file when it runs."""
    folder = tmp_path / "trapped"
    folder.mkdir()
    names = {*sys.stdlib_module_names, *importlib.metadata.packages_distributions(), "rerun", "distributed", "dask"}
    for name in names:
        if name.isidentifier():
            (folder / f"{name}.py").write_text(f"open({str(tmp_path)!r} + '/RAN_{name}', 'w')\n")
    (folder / "b").symlink_to(folder / "a", target_is_directory=True)
    damage.beginning(folder / "a", 8)
    rows = ["stamp_s,status,residual_m,vc7_x,vc7_y,vc7_z", "0.0,tracking,0.01,0,0,1", "0.1,tracking,0.01,0,0,1"]
    (folder / "a" / "pose.csv").write_text("\n".join(rows) + "\n")
    (tmp_path / "voodoo_command.py").write_text("from voodoo.cli import main\nif __name__ == '__main__':\n    main()\n")
    monkeypatch.chdir(folder)
    monkeypatch.setenv("PYTHONPATH", str(Path(voodoo.__file__).parent.parent))
    return tmp_path


def ran(folder):
    return sorted(path.name for path in folder.glob("RAN_*"))


def test_every_command_is_tried():
    assert {command.name for command in app.registered_commands} == set(COMMANDS)


@pytest.mark.parametrize(
    "name", [name if name == "eval" else pytest.param(name, marks=pytest.mark.long) for name in COMMANDS]
)
def test_no_command_imports_from_the_current_folder(trapped, name):
    done = subprocess.run(
        [sys.executable, trapped / "voodoo_command.py", name, *COMMANDS[name]],
        capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip
    assert ran(trapped) == []
    assert done.returncode == 0 or "pip install" in done.stderr, done.stderr


def test_the_traps_work(trapped):
    subprocess.run([sys.executable, "-c", "import colorsys"], check=False)
    assert ran(trapped) == ["RAN_colorsys"]


@pytest.mark.parametrize("wanted", ["", "1"])
def test_the_server_of_the_viewer_is_quiet_and_knows_no_current_folder(trapped, monkeypatch, wanted):
    package = trapped / "installed" / "rerun"
    package.mkdir(parents=True)
    (package / "__init__.py").touch()
    (package / "__main__.py").write_text(SERVED)
    monkeypatch.setenv("PYTHONPATH", str(package.parent))
    monkeypatch.setenv("NOTE", str(trapped / "note.json"))
    monkeypatch.setenv("FORCE_RERUN_ANALYTICS", wanted)
    monkeypatch.delenv("XDG_CONFIG_HOME", raising=False)
    before = dict(os.environ)
    Server(free_port()).close()
    assert ran(trapped) == [] and dict(os.environ) == before
    note = json.loads((trapped / "note.json").read_text())
    assert str(Path.cwd()) not in note["path"] and note["cwd"] == "/"
    folder = note["environment"].get("XDG_CONFIG_HOME")
    if wanted:
        assert folder is None
    else:
        assert json.loads(Path(folder, "rerun", "analytics.json").read_text())["analytics_enabled"] is False


def free_port():
    """The first of two neighboring free ports."""
    while True:
        with socket.create_server(("127.0.0.1", 0)) as first:
            port = first.getsockname()[1]
            try:
                socket.create_server(("127.0.0.1", port + 1)).close()
            except (OSError, OverflowError):
                continue
        return str(port)


def test_the_environment_is_restored_after_an_error():
    before = dict(os.environ)
    with pytest.raises(KeyError), children(quiet=True):
        assert os.environ["PYTHONSAFEPATH"] == "1"
        raise KeyError
    assert dict(os.environ) == before


def test_whoever_starts_a_process_uses_the_one_way():
    graph = grimp.build_graph("voodoo", include_external_packages=True, cache_dir=None)
    starters = {
        module
        for name in ("subprocess", "multiprocessing", "distributed", "rerun")
        if name in graph.modules
        for module in graph.find_modules_that_directly_import(name)
    } - {"voodoo.children"}
    assert {"voodoo.evaluation.evaluate", "voodoo.visualization.rerun_server"} <= starters
    without = {
        module for module in starters if "voodoo.children" not in graph.find_modules_directly_imported_by(module)
    }
    assert without == set()
