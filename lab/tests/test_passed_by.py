"""Somebody walks by in front of the person of a recording: the table of lab/experiments/passer_by.py."""

from itertools import cycle
from types import SimpleNamespace

import numpy as np
import pytest

from lab_scripts import load_experiment
from synthetic.passer_by import WithPasserBy
from voodoo.recordings import open_recording, sample_path


@pytest.fixture(scope="module")
def both():
    recording = open_recording(sample_path())
    return recording, WithPasserBy(recording, speed=1.2)


def test_wrong_frames_are_those_called_tracking_far_from_the_person(both):
    example = load_experiment("passer_by")
    _, passed = both
    begin, end = passed.passes
    truth = passed.people
    roots = truth.of("humanoid_root")[
        np.abs(truth.stamps[:, None] - [frame.stamp for frame in passed]).argmin(axis=0), 0
    ]
    near, far = np.array([0.0, 0.4, 0.0]), np.array([0.0, 0.7, 0.0])

    def reported(root, shift, status):
        return SimpleNamespace(joints={"humanoid_root": root + shift}, status=status)

    turns = [(near, "tracking"), (far, "tracking"), (far, "lost"), None]
    estimates = [turn and reported(root, *turn) for turn, root in zip(cycle(turns), roots, strict=False)]
    counts = example.passed(passed, estimates)
    inside = [index % 4 for index, frame in enumerate(passed) if begin <= frame.stamp <= end]
    assert counts.frames == len(inside) > 20
    assert (counts.wrong, counts.without) == (inside.count(1), inside.count(3))
    assert counts.far == inside.count(1) + inside.count(2)
    assert counts.greatest == pytest.approx(0.7)


@pytest.mark.parametrize("speed", [0.8, *(pytest.param(speed, marks=pytest.mark.long) for speed in (0.3, 1.4))])
def test_whoever_is_hidden_in_a_cartwheel_is_not_taken_for_the_one_in_front(voodoo_data, speed):
    """The passer-by is tracked as well, and owns their pixels, also where they touch in the first frame."""
    example = load_experiment("passer_by")
    passed = WithPasserBy(open_recording(voodoo_data / "rendered" / "dev_06_cartwheel"), speed=speed)
    counts = example.passed(passed, example.alone(passed))
    assert counts.frames > 80 and counts.wrong == counts.far == 0
