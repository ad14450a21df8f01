"""scripts/constants and scripts/fingerprint: what they count and when they speak."""

import json
import re
import subprocess
import sys
from array import array
from importlib.machinery import SourceFileLoader
from importlib.util import module_from_spec, spec_from_loader
from pathlib import Path
from types import SimpleNamespace

import pytest

SCRIPTS = Path(__file__).resolve().parent.parent / "scripts"


def load(name):
    """A script of ours as a module."""
    sys.path.insert(0, str(SCRIPTS))
    loader = SourceFileLoader(f"script_{name}", str(SCRIPTS / name))
    module = module_from_spec(spec_from_loader(loader.name, loader))
    sys.modules[loader.name] = module
    loader.exec_module(module)
    sys.path.remove(str(SCRIPTS))
    return module


constants = load("constants")
compare = load("fingerprint_compare.py")

RUST = """//! Text with 9.5 in it.
/// Patches; below, a limb is idle: a fifth of those it shows.
const IDLE: f64 = 0.2;
const LEANS: [f64; 4] = [-0.2, 0.2, -0.4, 0.4];
const ALIAS: f64 = IDLE;

const BARE: usize = 7;

fn judge(seen: f64, frames: usize) -> bool {
    // 3.5 in a comment, "4.5" in a string
    let unit = seen * 2.0 + (frames << 9) as f64;
    unit > 1.5 && frames >= 4 && seen.max(1e-9) < 0.7
}

#[cfg(test)]
mod tests {
    const ELSEWHERE: f64 = 8.5;
}
"""


PYTHON = '''"""Text with 9.5 in it."""
BINS, _WIDE = (3, 4), 5
_SHARES = {"a": 0.2, "b": (0.3, 0.4)}
_NOTHING, _FAR = np.empty((0, 3)), np.full((2, 3), 0.9)


@dataclass
class Settings:
    """Gates [m]."""

    STEPS = 7
    gate: float = 0.3
    count: int = 3
    share: float = 0.5


def judge(seen, *, margin: float = 0.25, most: int = 9):
    return seen * 2.0 > 1.5 and len(seen) >= 4 and 0.7 < margin < 1e-9 + seen[3] and seen.ndim == 2 and seen.shape[1] != 3
'''


@pytest.fixture
def tree(tmp_path):
    config = (
        '\nconfig! {\n    /// Steps.\n    steps: usize = 6, "", 1 ..= 9;\n    /// Gate.\n    gate: f64 = 0.3, "m";\n}\n'
    )
    files = {
        "crates/voodoo-core/src/hypotheses/mod.rs": RUST,
        "crates/voodoo-core/src/sizes.rs": "/// Meters.\nconst IDLE: f64 = 0.3;\n",
        "crates/voodoo-core/src/config.rs": config,
        "crates/voodoo-core/src/math/lanes.rs": "const LANES: usize = 8;\n",
        "crates/voodoo-core/src/lib.rs": "mod config;\n#[cfg(test)]\nmod testing;\n",
        "crates/voodoo-core/src/testing.rs": "const WALL: f64 = 4.5;\n",
        "crates/voodoo-core/tests/all.rs": "const MANY: usize = 99;\n",
        "crates/voodoo-ik/src/lib.rs": "/// Meters.\nconst IDLE: f64 = 0.4;\n",
        "python/voodoo/sensors/gate.py": PYTHON,
    }
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    return tmp_path


def test_constants_counts_names_literals_and_keys_of_every_crate_and_of_python(tree):
    observed = {(one.room, one.kind, one.name): one.count for one in constants.read(tree)}
    assert observed == {
        ("voodoo-core/hypotheses", "named", "IDLE"): 1,
        ("voodoo-core/hypotheses", "named", "LEANS"): 4,
        ("voodoo-core/hypotheses", "named", "BARE"): 1,
        ("voodoo-core/hypotheses", "literal", "1.5"): 1,
        ("voodoo-core/hypotheses", "literal", "4"): 1,
        ("voodoo-core/hypotheses", "literal", "0.7"): 1,
        ("voodoo-core/config.rs", "key", "gate"): 1,
        ("voodoo-core/config.rs", "key", "steps"): 1,
        ("voodoo-core/sizes.rs", "named", "IDLE"): 1,
        ("voodoo-ik/lib.rs", "named", "IDLE"): 1,
        ("python/sensors", "named", "BINS"): 2,
        ("python/sensors", "named", "_WIDE"): 1,
        ("python/sensors", "named", "_SHARES"): 3,
        ("python/sensors", "named", "_FAR"): 1,
        ("python/sensors", "named", "STEPS"): 1,
        ("python/sensors", "key", "gate"): 1,
        ("python/sensors", "key", "margin"): 1,
        ("python/sensors", "literal", "1.5"): 1,
        ("python/sensors", "literal", "4"): 1,
        ("python/sensors", "literal", "0.7"): 1,
    }
    lines = "\n".join(constants.table(constants.read(tree)))
    assert re.search(r"^voodoo-core/hypotheses all +3 +6 +3 +0 +9$", lines, re.MULTILINE)
    assert re.search(r"^python all +5 +8 +3 +2 +13$", lines, re.MULTILINE)
    assert re.search(r"^all +10 +16 +6 +4 +26$", lines, re.MULTILINE)


def test_constants_reports_what_has_no_comment_or_two_homes_in_a_crate(tree, monkeypatch):
    monkeypatch.setattr(constants, "LEFT_OUT", ("voodoo-core/math/", "voodoo-core/gone.rs"))
    assert constants.problems(tree) == [
        "voodoo-core/hypotheses/mod.rs:7: BARE has no doc comment with its unit and reason",
        "IDLE is defined in voodoo-core/hypotheses/mod.rs, voodoo-core/sizes.rs",
        "voodoo-core/gone.rs is not there",
    ]


def test_constants_prints_json():
    done = subprocess.run([SCRIPTS / "constants", "--json"], capture_output=True, text=True, check=True)
    sides = {one["file"].split("/")[0] for one in json.loads(done.stdout)}
    crates = {path.parent.name for path in (SCRIPTS.parent / "crates").glob("*/src")}
    assert {"python", "voodoo-core"} < sides <= {"python", *crates}


def test_every_constant_of_the_crates_is_documented_and_has_one_home():
    assert constants.problems(constants.ROOT) == []


def results(*places):
    """Results of a case: one pose a frame, at one place along x."""
    records = [
        {
            "call": "step",
            "poses": array("d", [1.0, 0, 0, place, *range(12)]).tobytes(),
            "sites": b"",
            "status": b"",
            "residuals": b"",
        }
        for place in places
    ]
    return {"records": records, "printed": "", "files": {}}


def test_fingerprint_finds_the_first_frame_and_the_greatest_difference():
    assert compare.compare(results(0.1, 0.2), results(0.1, 0.2)).what == ()
    last_bit = compare.compare(results(0.1, 0.2), results(0.1, 0.2 + 2.0**-55))
    assert (last_bit.what, last_bit.first) == (("poses",), 1)
    assert 0.0 < last_bit.pose_mm < 1e-12
    far = compare.compare(results(0.1, 0.2, 0.3), results(0.1, 0.201, 0.305))
    assert (far.first, round(far.pose_mm, 6)) == (1, 5.0)


def test_fingerprint_sees_a_turn_without_a_shift():
    old, new = results(0.1), results(0.1)
    new["records"][0]["poses"] = array("d", [0.9, 0, 0, 0.1, *range(12)]).tobytes()
    found = compare.compare(old, new)
    assert (found.what, found.pose_mm) == (("poses",), 0.0)


@pytest.mark.parametrize("change", ["frames", "files", "printed", "not a number"])
def test_fingerprint_sees_what_is_no_pose(change):
    old, new = results(0.1, 0.2), results(0.1, 0.2)
    if change == "frames":
        new["records"].pop()
    elif change == "not a number":
        new = results(0.1, float("nan"))
    else:
        new[change] = "other"
    assert compare.compare(old, new).what


def test_fingerprint_runs_the_cases_after_one_that_ends_its_process(tmp_path, monkeypatch):
    fingerprint = load("fingerprint")
    (tmp_path / "worker.py").write_text("""
import json, os, sys, time
for line in sys.stdin:
    if "ends" in json.loads(line)["arguments"]:
        os.close(1)
        time.sleep(0.2)
        os._exit(1)
    print("{}", flush=True)
""")
    monkeypatch.setattr(fingerprint, "SCRIPTS", tmp_path)
    monkeypatch.setattr(fingerprint, "WORKER_FILES", ("worker.py",))
    build = SimpleNamespace(name="old", python=sys.executable, folder=tmp_path, results=tmp_path)
    build.kept, build.result = (lambda _: False), (lambda case, _: tmp_path / case.name)
    cases = [fingerprint.Case(name, "command", (name,)) for name in ("first", "ends", "next", "last")]
    assert fingerprint.run_all(build, cases, {}, tmp_path, 1) == {"ends": "the process ended"}


def test_fingerprint_knows_the_helpers_and_data_of_its_cases(tmp_path):
    fingerprint = load("fingerprint")
    build = object.__new__(fingerprint.Build)
    build.folder, build.package = tmp_path, tmp_path / "site-packages" / "voodoo"
    digests = [build.digest()]
    for name in ("tests/disturbance.py", "benches/in_memory.py", "site-packages/voodoo/data/truth.csv"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("1")
        digests.append(build.digest())
    assert len(set(digests)) == 4
    (tmp_path / "tests" / "disturbance.pyc").write_text("1")
    assert build.digest() == digests[-1]


def test_fingerprint_lists_every_kind_of_case():
    done = subprocess.run([SCRIPTS / "fingerprint", "--list"], capture_output=True, text=True, check=True)
    names = done.stdout.splitlines()
    assert len(names) == len(set(names))
    assert len([name for name in names if name.startswith("utd/")]) == 3 * 40
    kinds = {"bundled", "rendered", "utd", "pose2sim", "markers", "laser", "ik", "virtual", "stress", "perfect_model"}
    assert kinds <= {name.split("/")[0] for name in names}
