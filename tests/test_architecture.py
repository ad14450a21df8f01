"""ARCHITECTURE.md and the tree agree: rooms, files, the order of dependency, and the sizes of files, functions and structs.

Format of ARCHITECTURE.md that is read here:
1. A line of the folder list that starts with the folder ("crates/voodoo-core/src/", "python/voodoo/"); its rooms below.
2. A room's line: four spaces, `name/`, its files without suffix and its folders as `name/`, " - ", what it is. Lines indented
   deeper go on. A line without `name/` lists the files beside the rooms. mod.rs, lib.rs and __init__.py are not listed.
3. The order of rooms: a line "Core: `math` < `shape` < ..." and one "Python: ...", going on in lines that start with a room
   in backquotes. A room uses rooms to its left only. Files beside the rooms are named like rooms.
"""

import re
from pathlib import Path
from statistics import median

import pytest

from source_rooms import backward, cycles, found, python_arrows, rust_arrows, rust_codes, stated

import rust_source  # isort: skip - found beside scripts/, which source_rooms puts on the path

ROOT = Path(__file__).resolve().parent.parent
CORE, PACKAGE = ROOT / "crates/voodoo-core/src", ROOT / "python/voodoo"
TEXT = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8")
SIDES = {
    "Core": (CORE, "crates/voodoo-core/src", ".rs", ("mod", "lib")),
    "Python": (PACKAGE, "python/voodoo", ".py", ("__init__",)),
}
TABLES = {("body", "human")}
"""Files that are mostly tables."""
SCHEMA = ("config",)
"""A field a parameter."""
LINES_OF_FUNCTION, LINES_OF_FILE, MEDIAN_FILE, LINES_OF_STEP = 60, 400, 150, 40
FIELDS, FIELDS_OF_TRACKER, LENT_TO = 12, 10, 2


@pytest.fixture(scope="module", params=SIDES)
def side(request):
    root, folder, suffix, faces = SIDES[request.param]
    return stated(TEXT, folder, request.param), found(root, suffix, faces), arrows_of(request.param)


def arrows_of(name):
    return rust_arrows(CORE) if name == "Core" else python_arrows(PACKAGE)[0]


@pytest.fixture(scope="module")
def codes():
    return rust_codes(CORE)


def test_the_folder_list_is_the_tree(side):
    listed, tree, _ = side
    assert {room: sorted(files) for room, files in listed.files.items()} == {
        room: sorted(files) for room, files in tree.items()
    }


def test_no_arrow_runs_against_the_order(side):
    listed, _, arrows = side
    assert backward(arrows, listed.order) == []


def test_the_order_names_every_room_once(side):
    listed, tree, _ = side
    tests = {"testing"} & tree[""]
    assert sorted(listed.order) == sorted({*tree, *tree[""]} - {""} - tests)


def test_no_cycle_between_files(side):
    _, _, arrows = side
    assert cycles(arrows) == []


def test_no_module_imports_the_package_face():
    assert python_arrows(PACKAGE)[1] == []


def test_the_product_does_not_import_the_evaluation():
    arrows, _ = python_arrows(PACKAGE)
    assert "evaluation" in {module[0] for module in arrows}
    wrong = {
        "/".join(module)
        for module, used in arrows.items()
        if module[0] not in ("evaluation", "batch", "cli") and any(other[0] == "evaluation" for other in used)
    }
    assert wrong == set()


def test_functions_are_short(codes):
    long = [
        f"{'/'.join(module)}:{part.line} {part.name}: {part.size} lines"
        for module, code in codes.items()
        if module not in TABLES
        for part in rust_source.functions(code)
        if part.size > LINES_OF_FUNCTION
    ]
    assert long == []


def test_files_are_short(codes):
    lines = {module: lines_of(module) for module in codes}
    assert {"/".join(m): n for m, n in lines.items() if n > LINES_OF_FILE and m not in TABLES} == {}
    assert median(lines.values()) < MEDIAN_FILE


def lines_of(module):
    """Lines of a core file, comments and all, less those of its tests."""
    path = CORE.joinpath(*module)
    path = path / "mod.rs" if path.is_dir() and (path / "mod.rs").exists() else path.with_suffix(".rs")
    text = path.read_text(encoding="utf-8")
    code = rust_source.code_of(text)
    kept = rust_source.without_tests(code)
    tests = sum(1 for a, b in zip(code.splitlines(), kept.splitlines(), strict=True) if a.strip() and not b.strip())
    return text.count("\n") - tests


def test_every_file_of_core_tests_runs():
    """They are modules of one program."""
    folder = CORE.parent / "tests"
    listed = re.findall(r"^mod (\w+);", (folder / "all.rs").read_text(encoding="utf-8"), re.M)
    shared = {path.parent.name for path in folder.glob("*/mod.rs")}
    assert {path.stem for path in folder.glob("*.rs")} - {"all", "allocations"} == set(listed) - shared


def test_structs_are_small(codes):
    large, tracker = [], None
    for module, code in codes.items():
        for part in rust_source.structs(code):
            if module[0] not in SCHEMA and part.size > FIELDS:
                large.append(f"{'/'.join(module)}:{part.line} {part.name}: {part.size} fields")
            if module[0] == "tracker" and part.name == "Tracker":
                tracker = part.size
    assert large == []
    assert tracker is not None
    assert tracker <= FIELDS_OF_TRACKER


def test_the_tracker_is_not_lent(codes):
    lent = ["/".join(m) for m, code in codes.items() if "&mut Tracker" in code or "impl Tracker {" in code]
    assert len(lent) <= 1 + LENT_TO, lent


def test_step_names_the_method(codes):
    steps = [
        part for m, c in codes.items() if m[0] == "tracker" for part in rust_source.functions(c) if part.name == "step"
    ]
    assert steps
    assert all(part.size <= LINES_OF_STEP for part in steps)


# That the checks above can fail, on made-up trees.

MADE_UP = """```
src/    the core
    config testing - beside the rooms
    math/    lanes
        geometry - numbers
    body/    joint inner/ deep - limbs
```

Core: `config` < `math` <
`body`
"""


@pytest.fixture
def core(tmp_path):
    files = {
        "lib.rs": "pub mod body; pub mod config; pub mod math;\n#[cfg(test)]\nmod testing;",
        "testing.rs": "use crate::body;",
        "config.rs": "pub struct Config { a: f64, pub(crate) b: Vec<(f64, [u8; 3])>, }",
        "math/mod.rs": "mod geometry; mod lanes; pub use geometry::{Pose, Vec3};",
        "math/geometry.rs": "pub struct Pose; pub struct Vec3;",
        "math/lanes.rs": "use super::Pose;\n#[cfg(test)]\nmod tests { use crate::body::Joint; }",
        "body/mod.rs": "pub mod joint; pub mod inner; pub use joint::Joint; // crate::nowhere\nfn f() { joint::g() }",
        "body/joint.rs": "use crate::{config::Config, math::{Pose, Vec3 as V}};\npub(in crate::body) fn g() {\n let a = 1;\n}",
        "body/inner/mod.rs": "pub mod deep;",
        "body/inner/deep.rs": "fn h() -> super::super::Joint { crate::math::lanes::four() }",
    }
    for name, text in files.items():
        path = tmp_path / "src" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return tmp_path / "src"


def test_a_tree_that_agrees_passes(core):
    listed = stated(MADE_UP, "src", "Core")
    assert listed.files == found(core, ".rs", ("mod", "lib"))
    arrows = rust_arrows(core)
    assert ("testing",) not in arrows
    assert arrows["body", "joint"] == {("config",), ("math", "geometry")}
    assert arrows["body", "inner", "deep"] == {("body", "joint"), ("math", "lanes")}
    assert arrows["body",] == {("body", "joint")}
    assert arrows["math", "lanes"] == {("math", "geometry")}
    assert (backward(arrows, listed.order), cycles(arrows)) == ([], [])


def test_a_file_that_is_not_listed_is_found(core):
    (core / "body" / "new.rs").write_text("")
    assert stated(MADE_UP, "src", "Core").files != found(core, ".rs", ("mod", "lib"))


@pytest.mark.parametrize(
    "use", ["use crate::body::joint;", "fn f(a: crate::body::Joint) {}", "use crate::{body::{joint::{self}}};"]
)
def test_an_arrow_against_the_order_is_found(core, use):
    (core / "math" / "lanes.rs").write_text(use)
    arrows = rust_arrows(core)
    assert backward(arrows, stated(MADE_UP, "src", "Core").order) == ["math/lanes uses body/joint, but math < body"]


def test_a_cycle_within_a_room_is_found(core):
    (core / "body" / "joint.rs").write_text("use super::inner::deep::h;")
    assert cycles(rust_arrows(core)) == ["body/inner/deep <-> body/joint"]
    (core / "math" / "geometry.rs").write_text("use super::lanes;")
    assert len(cycles(rust_arrows(core))) == 2


def test_sizes_are_counted(core):
    code = rust_codes(core)
    assert [(part.name, part.size) for part in rust_source.functions(code["body", "joint"])] == [("g", 3)]
    assert [(part.name, part.size) for part in rust_source.structs(code["config",])] == [("Config", 2)]


@pytest.fixture
def package(tmp_path):
    files = {
        "__init__.py": "from house.a.one import One",
        "_core.pyi": "",
        "a/__init__.py": "from house.a.one import One\nfrom house.a import two",
        "a/one.py": "from house import _core\nimport numpy",
        "a/two.py": "from house.a import One",
        "b.py": "from __future__ import annotations\nfrom house.a import One, two",
    }
    for name, text in files.items():
        path = tmp_path / "house" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return tmp_path / "house"


def test_python_arrows_and_faces(package):
    arrows, faces = python_arrows(package)
    assert arrows == {
        ("a",): set(),
        ("a", "one"): set(),
        ("a", "two"): {("a", "one")},
        ("b",): {("a", "one"), ("a", "two")},
    }
    assert (faces, cycles(arrows), backward(arrows, ["a", "b"])) == ([], [], [])


@pytest.mark.parametrize("line", ["import house", "def f():\n    from house import One", "from .. import One"])
def test_an_import_of_the_face_is_found(package, line):
    (package / "a" / "one.py").write_text(line)
    assert python_arrows(package)[1] == ["a/one imports the package's face"]


@pytest.mark.parametrize(
    "line",
    ["import house.b", "from house import b", "from ..b import x", "if TYPE_CHECKING:\n    from house.b import x"],
)
def test_python_cycles_and_arrows_back_are_found(package, line):
    (package / "a" / "one.py").write_text(line)
    arrows, _ = python_arrows(package)
    assert backward(arrows, ["a", "b"]) == ["a/one uses b, but a < b"]
    assert cycles(arrows) == ["a/one <-> a/two <-> b"] or cycles(arrows) == ["a/one <-> b"]
