"""The tables of lab/experiments/unseen_people.py."""

import sys

import numpy as np
import pytest

import voodoo
from lab_scripts import BUNDLED, load_experiment
from voodoo.evaluation import metrics
from voodoo.measurements import DepthImage


@pytest.fixture
def unseen():
    return load_experiment("unseen_people")


def test_a_mean_radius_is_that_of_a_circle_and_between_those_of_an_ellipse(unseen):
    assert unseen.mean_radius(voodoo.TaperedEllipticCylinder(0.4, 0.05, 0.05, 0.05, 0.05)) == pytest.approx(0.05)
    assert unseen.mean_radius(voodoo.TaperedEllipticCylinder(0.4, 0.08, 0.08, 0.04, 0.04)) == pytest.approx(0.06)
    assert 0.06 < unseen.mean_radius(voodoo.TaperedEllipticCylinder(0.4, 0.04, 0.08, 0.04, 0.08)) < 0.065


def test_lengths_are_those_between_the_joints_of_each_side(unseen):
    joints = np.zeros((12, 3))
    joints[metrics.JOINTS.index("r_elbow")] = [0.0, 0.3, 0.0]
    joints[metrics.JOINTS.index("r_wrist")] = [0.0, 0.3, 0.25]
    np.testing.assert_allclose(unseen.lengths_of(joints), [0.0, 0.3, 0.0, 0.25, 0.0, 0.0, 0.0, 0.0])


def test_what_the_image_does_not_hold_is_not_judged(unseen):
    image = next(
        item for frame in voodoo.open_recording(BUNDLED) for item in frame.measurements if isinstance(item, DepthImage)
    )
    ahead = np.asarray(image.root_from_sensor) @ [0.0, 0.0, 2.0, 1.0]
    aside, behind = (np.asarray(image.root_from_sensor) @ [x, 0.0, z, 1.0] for x, z in ((3.0, 2.0), (0.0, -2.0)))
    assert unseen.inside_image(image, np.array([ahead, aside, behind])[:, :3]).tolist() == [True, False, False]


def test_the_bundled_recording_starts_at_once(unseen, monkeypatch, capsys):
    result = unseen.run(BUNDLED, "auto")
    assert result.frame == 1 and result.first < 0.05 and result.mean < 0.05 and result.lost == ()
    assert result.swapped == (False, False) and np.isnan(result.girths).all()
    assert result.lengths.shape == (3, 8) and np.abs(result.lengths).mean() < 0.03
    cells = unseen.cells([result])
    assert cells[:3] == ["1", "0", "100"] and cells[5:7] == ["0; 0", "0"]
    monkeypatch.setattr(sys, "argv", ["unseen_people.py", str(BUNDLED), "--jobs", "1", "--init", "given"])
    unseen.main()
    printed = capsys.readouterr().out
    assert "| all | 1 | 0 |" in printed and "| length, thigh |" in printed
