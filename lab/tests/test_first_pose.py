"""The table of lab/experiments/first_pose.py."""

import sys

import numpy as np
import pytest

from lab_scripts import BUNDLED, load_experiment
from voodoo.evaluation.metrics import JOINTS


@pytest.fixture
def first_pose():
    return load_experiment("first_pose")


def standing():
    """Joints (12, 3) of somebody with the left side at y > 0."""
    heights = {"shoulder": 1.4, "elbow": 1.1, "wrist": 0.9, "hip": 0.9, "knee": 0.5, "ankle": 0.1}
    return np.array([[2.0, 0.2 if name.startswith("l_") else -0.2, heights[name[2:]]] for name in JOINTS])


def test_the_bundled_person_is_found_in_the_first_frames(first_pose, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["first_pose.py", str(BUNDLED), "--jobs", "1"])
    monkeypatch.setattr(first_pose, "LATER", 2)
    first_pose.main()
    lines = capsys.readouterr().out.strip().splitlines()
    cells = [cell.strip() for cell in lines[2].split("|")[1:-1]]
    assert cells[:4] == ["exact truth", "1", "0; 0", "0 (0.0 %)"]
    assert 1.0 < float(cells[5]) < 12.0
    assert lines[-2:] == ["exchanged: none", "late: none"]


def test_who_is_turned_about_or_mirrored_is_swapped(first_pose):
    joints = standing()
    about = joints * (1.0, -1.0, 1.0)
    assert not first_pose.swapped(joints + 0.1, joints)
    assert first_pose.swapped(about, joints)


def test_late_starts_and_constant_offsets_are_reported(first_pose):
    """A skeleton whose hips are always 8 cm higher: no error once the offset is removed."""
    ours, theirs = standing(), standing()
    theirs[[JOINTS.index("l_hip"), JOINTS.index("r_hip")], 2] += 0.06
    nowhere = np.full((12, 3), np.nan)
    right = [first_pose.First(f"a{n}", False, n, ours, theirs, (False, False)) for n in (1, 5, 6)]
    none = first_pose.First("never", False, None, nowhere, nowhere, (False, False))
    turned = first_pose.First("turned", False, 2, ours, theirs, (True, False))
    cells = [cell.strip() for cell in first_pose.row("skeleton", [*right, none, turned]).split("|")[1:-1]]
    assert cells == ["skeleton", "5", "1; 0", "2 (40.0 %)", "5; never", "1.0", "0.0"]


def test_a_recording_without_a_reference_is_left_out(first_pose, tmp_path):
    (tmp_path / "bag").symlink_to(BUNDLED / "bag")
    assert first_pose.first(tmp_path) is None
