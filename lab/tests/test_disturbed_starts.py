"""The table of lab/experiments/disturbed_starts.py."""

import sys
from dataclasses import replace

import numpy as np
import pytest

import voodoo
from lab_scripts import BUNDLED, load_experiment


@pytest.fixture
def disturbed():
    return load_experiment("disturbed_starts")


def test_the_first_start_is_the_recordings_own_and_the_others_are_near_it(disturbed, monkeypatch, capsys):
    started = []
    reset = voodoo.Tracker.reset

    def noted(self, *, joints, **how):
        started.append(np.array(list(joints.values())))
        return reset(self, joints=joints, **how)

    monkeypatch.setattr(voodoo.Tracker, "reset", noted)
    monkeypatch.setattr(sys, "argv", ["disturbed_starts.py", str(BUNDLED), "--starts", "2"])
    disturbed.main()
    own = voodoo.open_recording(BUNDLED).start["joints"]
    assert np.array_equal(started[0], np.array(list(own.values())))
    assert 0.002 < (started[1] - started[0]).std() < 0.006
    row, _, total, far, near, *calibration = capsys.readouterr().out.strip().splitlines()[2:]
    errors = [float(word) for word in row.split("|")[2].split()]
    assert len(errors) == 2 and 0.5 < min(errors) <= max(errors) < 6.0, row
    assert "of 2 runs end with a joint lost" in total
    assert "limbs off by 10 cm: " in far
    assert int(near.split()[0]) > 100 and 0.0 <= float(near.split("nearer: ")[1].split()[0]) < 25.0
    assert "## Standard deviations against exact truth" in calibration


@pytest.fixture
def still(monkeypatch):
    class Still(voodoo.Tracker):
        """It stays where it started: nothing is near enough to be matched."""

        def __init__(self, body):
            blind = voodoo.Config(
                gate_start=0.001, gate_end=0.001, hypotheses=False, relocalization=False, depth_contour=False
            )
            super().__init__(body, config=blind)

    monkeypatch.setattr(voodoo, "Tracker", Still)


def test_a_lost_joint_is_named(disturbed, still):
    recording = voodoo.open_recording(BUNDLED, use=("depth",))
    error, kind, lost, (far, near), _ = disturbed.run(recording, np.random.default_rng(0), 0.0)
    assert error > 0.10 and kind == 0
    assert 0 < far[0] <= far[1] and near[1] > 0
    assert "l_wrist" in lost or "r_wrist" in lost, lost
    unknown = disturbed.Played(recording, backwards=False, every=1)
    unknown.reference = replace(unknown.reference, positions=unknown.reference.positions.copy())
    unknown.reference.positions[-3:] = np.nan
    assert "r_wrist" in disturbed.run(unknown, np.random.default_rng(0), 0.0)[2], "in the last frame with a truth"


def test_what_contradicts_itself_in_a_reference_skeleton_is_no_error(disturbed):
    """In every third frame a knee of the skeleton is where its ankle is."""
    recording = disturbed.Played(voodoo.open_recording(BUNDLED, use=("depth",)), backwards=False, every=1)
    truth = recording.reference
    positions = truth.positions.copy()
    positions[::3, truth.names.index("l_ankle")] = positions[::3, truth.names.index("l_knee")]
    recording.reference = replace(truth, positions=positions, exact=False)
    error, kind, lost, (far, _), _ = disturbed.run(recording, np.random.default_rng(0), 0.0)
    assert error < 0.03 and kind == 2 and not lost and far[1] == 0, (error, kind, lost, far)


def test_a_recording_without_truth_is_refused(disturbed):
    class Bare:
        name, start, reference = "bare", None, None

    with pytest.raises(SystemExit, match="bare: expected a recording with a start and a reference, found none"):
        disturbed.run(Bare(), np.random.default_rng(0), 0.0)


def test_a_recording_played_backwards_is_tracked_from_its_end(disturbed):
    """Its truth is mirrored with it: from the same place the error stays small, and frames come in the order of time."""
    recording = voodoo.open_recording(BUNDLED, use=("depth",))
    played = disturbed.Played(recording, backwards=True, every=2)
    stamps = [frame.stamp for frame in played]
    assert len(stamps) == (len(recording) + 1) // 2 and (np.diff(stamps) > 0).all()
    last = recording.reference.positions[-1]
    names = recording.reference.names
    assert np.array_equal(played.start["joints"]["l_wrist"], last[names.index("l_wrist")])
    error, _, lost, _, found = disturbed.run(played, np.random.default_rng(0), 0.0)
    assert error < 0.06 and not lost, (error, lost)
    assert np.linalg.norm(found.errors, axis=2).mean() == pytest.approx(error) and np.isfinite(found.sigma).all()
