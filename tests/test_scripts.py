"""scripts/constants and scripts/fingerprint: what they count and when they speak."""

import json
import re
import subprocess
import sys
from array import array
from importlib.machinery import SourceFileLoader
from importlib.util import module_from_spec, spec_from_loader
from pathlib import Path

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


@pytest.fixture
def source(tmp_path):
    (tmp_path / "hypotheses").mkdir()
    (tmp_path / "hypotheses" / "mod.rs").write_text(RUST)
    (tmp_path / "sizes.rs").write_text("/// Metres.\nconst IDLE: f64 = 0.3;\n")
    config = (
        '\nconfig! {\n    /// Steps.\n    steps: usize = 6, "", 1 ..= 9;\n    /// Gate.\n    gate: f64 = 0.3, "m";\n}\n'
    )
    (tmp_path / "config.rs").write_text(config)
    return tmp_path


def test_constants_counts_names_literals_and_keys(source):
    (source / "hypotheses" / "gate.rs").write_text("fn f(c: &Config) -> f64 { c.gate }\n")
    found, _ = constants.read(source)
    seen = {(one.group, one.kind, one.name): one.count for one in found}
    assert seen == {
        ("hypotheses", "named", "IDLE"): 1,
        ("hypotheses", "named", "LEANS"): 4,
        ("hypotheses", "named", "BARE"): 1,
        ("hypotheses", "literal", "1.5"): 1,
        ("hypotheses", "literal", "4"): 1,
        ("hypotheses", "literal", "0.7"): 1,
        ("hypotheses", "key", "gate"): 1,
        ("rest", "named", "IDLE"): 1,
        ("rest", "key", "steps"): 1,
    }
    lines = constants.table(found)
    assert re.search(r"hypotheses  all +3 +6 +3 +1 +10$", "\n".join(lines), re.MULTILINE)


def test_constants_says_what_has_no_comment_or_two_homes(source):
    assert constants.problems(source) == [
        "hypotheses/mod.rs:7: BARE has no doc comment with its unit and reason",
        "IDLE is defined in hypotheses/mod.rs, sizes.rs",
    ]


def test_constants_prints_json():
    done = subprocess.run([SCRIPTS / "constants", "--json"], capture_output=True, text=True, check=True)
    groups = {one["group"] for one in json.loads(done.stdout)}
    assert groups == {"hypotheses", "relocalize", "assess", "visibility", "rest"}


@pytest.mark.skipif(not (constants.SOURCE / "math").is_dir(), reason="the core's files still lie flat")
def test_every_constant_of_the_core_is_documented_and_has_one_home():
    assert constants.problems(constants.SOURCE) == []


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


def test_fingerprint_lists_every_kind_of_case():
    done = subprocess.run([SCRIPTS / "fingerprint", "--list"], capture_output=True, text=True, check=True)
    names = done.stdout.splitlines()
    assert len(names) == len(set(names))
    assert len([name for name in names if name.startswith("utd/")]) == 3 * 40
    kinds = {"bundled", "rendered", "utd", "pose2sim", "markers", "laser", "ik", "virtual", "stress", "perfect_model"}
    assert kinds <= {name.split("/")[0] for name in names}
