"""The order of the Python package's rooms; that of the crates is cargo's."""

import re
from pathlib import Path

import grimp
import pytest
from importlinter.cli import EXIT_STATUS_SUCCESS, lint_imports

ROOT = Path(__file__).resolve().parent.parent


def test_imports_keep_the_order(monkeypatch):
    monkeypatch.chdir(ROOT)
    assert lint_imports(no_cache=True) == EXIT_STATUS_SUCCESS


def imports_of_the_face(package):
    """Imports of the package itself; its compiled core, of which no source is found, is none."""
    graph = grimp.build_graph(package, cache_dir=None)
    return [
        f"{module}: {found['line_contents']}"
        for module in sorted(graph.find_modules_that_directly_import(package))
        for found in graph.get_import_details(importer=module, imported=package)
        if not re.search(
            rf"from {package}\._core|import {package}\._core|from {package} import _core", found["line_contents"]
        )
    ]


def test_no_module_imports_the_package_face():
    """It would hide where the arrow goes."""
    assert imports_of_the_face("voodoo") == []


@pytest.mark.parametrize("line", ["import house", "def f():\n    from house import One", "from .. import One"])
def test_an_import_of_the_face_is_found(tmp_path, monkeypatch, line):
    for name, text in {"__init__.py": "", "a/__init__.py": "", "a/one.py": line, "b.py": "import house._core"}.items():
        path = tmp_path / "house" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    assert [entry.partition(":")[0] for entry in imports_of_the_face("house")] == ["house.a.one"]


@pytest.mark.parametrize("program", sorted(ROOT.glob("crates/*/tests/all.rs")), ids=lambda path: path.parts[-3])
def test_every_file_of_a_crates_tests_runs(program):
    """They are modules of one program."""
    listed = re.findall(r"^mod (\w+);", program.read_text(encoding="utf-8"), re.MULTILINE)
    manifest = (program.parent.parent / "Cargo.toml").read_text(encoding="utf-8")
    apart = re.findall(r'^\[\[test\]\]\nname = "(\w+)"', manifest, re.MULTILINE)
    assert {path.stem for path in program.parent.glob("*.rs")} <= {*listed, *apart}
