"""The counts of lab/experiments/gaps.py, and that a track goes on after a second without frames."""

from lab_scripts import BUNDLED, load_experiment


def test_a_track_goes_on_after_a_second_without_frames():
    gaps = load_experiment("gaps")
    at_once, later = gaps.after(BUNDLED, begin=0.5, length=1.0)
    for right, wrong, count in (at_once, later):
        assert count == gaps.FRAMES and right + wrong <= count
    assert at_once[0] >= 6 and later[0] == gaps.FRAMES
