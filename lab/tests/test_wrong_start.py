"""The table of lab/experiments/wrong_start.py."""

import sys
from itertools import islice

import numpy as np
import pytest

import voodoo
from lab_scripts import BUNDLED, load_experiment
from voodoo.pipeline.front_end import FrontEnd
from voodoo.pipeline.pairing import paired
from voodoo.recordings import open_recording, sample_path
from voodoo.sensors.settings import FrontEndSettings

UP = np.array([0.0, 0.0, 1.0])


@pytest.fixture
def wrong():
    return load_experiment("wrong_start")


def test_a_start_is_turned_about_the_vertical_through_the_root(wrong):
    joints = {"humanoid_root": np.array([2.0, 1.0, 0.9]), "l_shoulder": np.array([2.0, 1.2, 1.4])}
    about = wrong.disturbed(joints, 180.0, 0.0, UP, 0.3)
    assert about["humanoid_root"] == pytest.approx([2.0, 1.0, 0.9])
    assert about["l_shoulder"] == pytest.approx([2.0, 0.8, 1.4])
    assert wrong.disturbed(joints, 90.0, 0.0, UP, 0.3)["l_shoulder"] == pytest.approx([1.8, 1.0, 1.4])
    down = np.array([0.0, -1.0, 0.0])
    moved = wrong.disturbed(joints, 0.0, 0.4, down, 1.0)
    for name, place in joints.items():
        step = moved[name] - place
        assert np.linalg.norm(step) == pytest.approx(0.4) and step[1] == pytest.approx(0.0)


def test_right_again_is_right_to_the_end(wrong):
    stamps = np.arange(6) / 10.0
    right = np.array([0.02, 0.02, 0.02, 0.02, 0.02, 0.08])
    assert wrong.seconds_until_right(np.array([0.3, 0.09, 0.2, 0.1, 0.05, 0.11]), right, stamps) == pytest.approx(0.3)
    assert wrong.seconds_until_right(np.full(6, 0.05), right, stamps) == 0.0
    assert wrong.seconds_until_right(np.array([0.05, 0.05, 0.05, 0.05, 0.05, 0.13]), right, stamps) == np.inf
    assert wrong.seconds_until_right(np.full(6, np.inf), right, stamps) == np.inf


def test_the_table_has_a_row_for_every_disturbance(wrong, monkeypatch, capsys):
    """Over two tenths of a second; a start that is one meter off is not right in its first frame by chance."""
    monkeypatch.setattr(wrong, "WINDOW_S", 0.2)
    monkeypatch.setattr(wrong, "CASES", [(0.0, 0.0), (180.0, 0.0)])
    monkeypatch.setattr(sys, "argv", ["wrong_start.py", str(BUNDLED), "--at", "0.1"])
    wrong.main()
    lines = capsys.readouterr().out.strip().splitlines()
    same, about, together = ([cell.strip() for cell in line.split("|")[1:-1]] for line in lines[2:5])
    assert same == ["moved by 0 m", "0.00", "100 %", "100 %", "0", "1", "100 %", "none"]
    assert about[0] == "turned by 180 degrees" and about[5] == "1"
    assert together[5] == "2"
    assert lines[-1].endswith(": 0")


def test_fractions_count_runs_that_are_never_right(wrong):
    reported = [(True, 0, 0), (True, 0, 0), (True, 3, 10), (False, 1, 10)]
    cells = [cell.strip() for cell in wrong.row("all", [0.1, 0.3, 0.9, np.inf], reported).split("|")[1:-1]]
    assert cells == ["all", "0.60", "50 %", "75 %", "1", "4", "75 %", "20 % of 20"]
    assert wrong.row("all", [], []).count("|") == 9


def test_a_wrong_start_is_reported_by_being_right_or_by_the_status(wrong):
    stamps = np.arange(6) / 10.0
    bad, good = np.zeros(6, dtype=bool), np.ones(6, dtype=bool)
    tracking = np.ones(6, dtype=bool)
    assert wrong.reported_counts(bad, tracking, stamps) == (False, 2, 2)
    assert wrong.reported_counts(good, tracking, stamps) == (True, 0, 0)
    late = np.array([1, 1, 1, 1, 0, 1], dtype=bool)
    assert wrong.reported_counts(bad, late, stamps) == (False, 1, 2), "too late"
    soon = np.array([1, 1, 1, 0, 1, 1], dtype=bool)
    assert wrong.reported_counts(bad, soon, stamps) == (True, 2, 2)


@pytest.mark.parametrize("scale", [0.75, 1.25])
def test_a_start_elsewhere_that_had_another_stature_leaves_it_too(scale):
    """Half a meter beside the person, and of a child's or a giant's size."""
    recording = open_recording(sample_path())
    names, truth = recording.reference.names, recording.reference.positions
    root = truth[0][names.index("humanoid_root")]
    given = {
        name: tuple(root + scale * (place - root) + [0.0, 0.5, 0.0])
        for name, place in zip(names, truth[0], strict=True)
    }
    tracker = voodoo.Tracker(voodoo.Body.human())
    tracker.reset(joints=given)
    front_end = FrontEnd(tracker, settings=FrontEndSettings(use=("depth",)))
    *_, (last, estimate) = ((index, front_end.step(frame)) for index, frame in enumerate(islice(paired(recording), 16)))
    apart = [np.linalg.norm(estimate.joints[name] - place) for name, place in zip(names, truth[last], strict=True)]
    assert np.mean(apart) < 0.05
