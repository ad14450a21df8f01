"""Statistics of how people move: turns from directions of limbs, and the table that the core has."""

import sys
from pathlib import Path

import numpy as np
import pytest
from lab.training import pose_prior
from lab.training.poses import Pose, arm, leg

TABLE = Path(__file__).resolve().parents[2] / "crates/voodoo-core/src/body/pose_statistics.rs"


def posed(left_hip, left_knee, right_elbow):
    limbs = np.stack(
        [
            np.concatenate([arm(0, 0, 0, 0, 0.5), leg(0, left_hip, 0, 0, left_knee)]),
            np.concatenate([arm(1, 0.3, 0, 0, right_elbow), leg(1, 0, 0, 0, 0.4)]),
        ]
    )
    return Pose(np.eye(3), np.eye(3), np.eye(3), limbs, np.stack([np.eye(3)] * 2))


def test_bends_are_turns_about_the_joints_first_axis():
    angles = [(0.2 + 0.1 * k, 0.5 + 0.05 * k, 1.0 + 0.1 * k) for k in range(8)]
    turns = pose_prior.turns([posed(*each) for each in angles])
    for row, (hip, knee, elbow) in zip(turns, angles, strict=True):
        found = {joint: row[pose_prior.columns(joint)] for joint in pose_prior.JOINTS}
        np.testing.assert_allclose(found["l_hip"], [hip, 0, 0], atol=1e-6)
        np.testing.assert_allclose(found["r_shoulder"], [0.3, 0, 0], atol=1e-6)
        np.testing.assert_allclose([found["l_knee"][0], found["r_elbow"][0]], [knee, elbow], atol=1e-6)
        np.testing.assert_allclose(found["vl3"], 0, atol=1e-9)


def test_the_turns_of_a_mirrored_pose_are_the_mirrored_turns():
    poses = [posed(0.2 + 0.1 * k, 0.9, 1.0 + 0.1 * k).turned(np.eye(3)) for k in range(8)]
    swapped = pose_prior.turns([pose.mirrored() for pose in poses])
    np.testing.assert_allclose(swapped, pose_prior.mirrored(pose_prior.turns(poses)), atol=1e-6)


def test_hidden_joints_are_guessed_from_the_others():
    chance = np.random.default_rng(2)
    found = chance.normal(0.0, 0.3, (2000, pose_prior.SIZE))
    knees = [pose_prior.columns(joint).start for joint in ("l_knee", "r_knee")]
    found[:, knees[0]] = 0.8 * found[:, knees[1]] + chance.normal(0.0, 0.05, 2000)
    guessed = pose_prior.conditional_mean(found, *pose_prior.statistics(found), ["l_knee"])
    before, after = (np.sqrt(np.mean((found[:, knees[0]] - guess) ** 2)) for guess in (0.0, guessed[:, knees[0]]))
    assert after < 0.5 * before
    others = np.delete(np.arange(pose_prior.SIZE), knees[0])
    np.testing.assert_array_equal(guessed[:, others], found[:, others])


@pytest.mark.long
def test_the_table_of_the_core_is_what_the_script_makes(voodoo_data, tmp_path, monkeypatch, capsys):
    if not (voodoo_data / "mocap").is_dir():
        pytest.skip(f"no mocap in {voodoo_data}")
    made = tmp_path / "table.rs"
    monkeypatch.setattr(sys, "argv", ["pose_prior", str(voodoo_data / "mocap"), str(made)])
    pose_prior.main()
    assert made.read_text(encoding="utf-8") == TABLE.read_text(encoding="utf-8")
    assert "| l_knee | 25 | 18 |" in capsys.readouterr().out
