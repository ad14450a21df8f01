"""J10's tables on rendered recordings and real cameras, as examples/ik_tables.py makes them."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "examples"))
import ik_limbs
import ik_pose2sim
import ik_tables


def means(found, truth):
    errors = ik_limbs.errors(found, truth)
    return np.array([np.mean([errors[f"{side}_{joint}"] for side in "lr"]) for joint in ("elbow", "knee")])


@pytest.mark.parametrize(("name", "halved"), [("dev_03_punch", ("elbow", "knee")), ("dev_05_walk", ("knee",))])
def test_images_halve_the_error_of_the_inner_joints(voodoo_data, name, halved):
    sequence = ik_tables.rendered(voodoo_data / "rendered" / name)
    plain, one, two = (means(sequence.solve(views), sequence.truth) for views in (0, 1, 2))
    for index, joint in enumerate(("elbow", "knee")):
        assert max(one[index], two[index]) < 0.025
        # An elbow of a walking person is within about a pixel without images, too.
        assert max(one[index], two[index]) < (0.5 if joint in halved else 0.85) * plain[index]
    assert one.mean() < two.mean() + 0.005  # one view is nearly as good as two


def test_four_real_cameras(voodoo_data):
    if not (voodoo_data / "pose2sim" / "videos").is_dir():
        pytest.skip("the videos of Pose2Sim are not there")
    trial = ik_pose2sim.four_cameras(voodoo_data / "pose2sim")
    reach = ik_limbs.reachable(trial.truth)
    plain, four = (means(trial.solve(cameras), reach) for cameras in ((), tuple(trial.views)))
    assert (four < 0.85 * plain).all()
    assert not any(view.empty for views, _ in trial.views.values() for view in views)


def test_what_constant_limbs_can_reach():
    rng = np.random.default_rng(4)
    truth = {}
    for joint, (_, first, last) in ik_limbs.LIMBS.items():
        truth[first] = rng.normal(size=(20, 3))
        ways = rng.normal(size=(2, 20, 3))
        ways /= np.linalg.norm(ways, axis=2, keepdims=True)
        truth[joint] = truth[first] + 0.3 * ways[0]
        truth[last] = truth[joint] + 0.25 * ways[1]
    for joint, places in ik_limbs.reachable(truth).items():
        assert np.allclose(places, truth[joint], atol=1e-9)
    assert ik_limbs.typical_frame(truth) == 0
