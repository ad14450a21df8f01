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


@pytest.mark.parametrize("name", ["dev_03_punch", "dev_05_walk"])
def test_images_halve_the_error_of_the_inner_joints(voodoo_data, name):
    sequence = ik_tables.rendered(voodoo_data / "rendered" / name)
    plain, one, two = (means(sequence.solve(views), sequence.truth) for views in (0, 1, 2))
    assert (one < 0.5 * plain).all() and (one < 0.025).all()
    # The second view of the walk is the thin model's; it hides the swinging arms before the trunk.
    assert (two < (0.65 if name == "dev_05_walk" else 0.5) * plain).all() and (two < 0.025).all()
    assert one.mean() < two.mean() + 0.005  # one view is nearly as good as two


def test_four_real_cameras(voodoo_data):
    if not (voodoo_data / "pose2sim" / "videos").is_dir():
        pytest.skip("the videos of Pose2Sim are not there")
    trial = ik_pose2sim.four_cameras(voodoo_data / "pose2sim")
    plain, one, four = (
        means(trial.solve(cameras, trial.steady), trial.steady) for cameras in ((), ("cam_01",), tuple(trial.views))
    )
    assert one[0] < 0.5 * plain[0] and four[0] < 0.5 * plain[0] and max(one[0], four[0]) < 0.025
    moved = [np.linalg.norm(trial.steady[name] - places, axis=1).mean() for name, places in trial.truth.items()]
    assert max(moved) < 0.02
    assert not any(view.empty for views, _ in trial.views.values() for view in views)


def test_chains_of_constant_limbs_nearest_to_a_truth():
    rng = np.random.default_rng(4)
    truth = {}
    for joint, (_, first, last) in ik_limbs.LIMBS.items():
        truth[first] = rng.normal(size=(20, 3))
        ways = rng.normal(size=(2, 20, 3))
        ways /= np.linalg.norm(ways, axis=2, keepdims=True)
        truth[joint] = truth[first] + 0.3 * ways[0]
        truth[last] = truth[joint] + 0.25 * ways[1]
    # Exact truth stays.
    for name, places in ik_limbs.steady(truth).items():
        assert np.allclose(places, truth[name], atol=1e-9)
    assert ik_limbs.typical_frame(truth) == 0
    noisy = {name: places + 0.02 * rng.normal(size=places.shape) for name, places in truth.items()}
    found, medians = ik_limbs.steady(noisy), ik_limbs.limb_lengths(noisy)
    for joint, lengths in ik_limbs.limb_lengths(found).items():
        assert np.allclose(lengths, np.median(medians[joint], axis=0), atol=1e-9)
    assert np.mean([np.linalg.norm(found[name] - noisy[name], axis=1) for name in noisy]) < 0.03
