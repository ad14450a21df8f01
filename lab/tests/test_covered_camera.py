"""The table of lab/experiments/covered_camera.py."""

import sys

import pytest

from lab_scripts import BUNDLED, load_experiment


@pytest.fixture
def covered():
    return load_experiment("covered_camera")


def test_a_covered_camera_is_called_lost_and_the_person_is_found_again(covered, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["covered_camera.py", str(BUNDLED), "--seconds", "0.5"])
    covered.main()
    cells = capsys.readouterr().out.strip().splitlines()[-1].split("|")
    assert cells[3].strip() == "100 %"
    assert 0.5 < float(cells[4]) < 8.0


def test_a_recording_that_is_too_short_is_refused(covered):
    with pytest.raises(SystemExit, match="expected more than 61 s, found"):
        covered.run(BUNDLED, 60.0, relocalization=True)
