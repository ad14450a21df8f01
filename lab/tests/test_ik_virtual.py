"""J10's experiments in a virtual plane, as lab/experiments/ik_virtual.py makes them, and its planar chains."""

import sys

import numpy as np
import pytest

from voodoo import ik


def test_experiment_1_image_pulls_the_chain_into_the_projection(virtual):
    chain = virtual.planar_chain()
    experiment = virtual.experiments(chain)[0]
    plain = virtual.run(chain, experiment, with_image=False, steps=15)
    image = virtual.run(chain, experiment, with_image=True, steps=15)
    assert plain.residuals[0] < 1e-6 and image.residuals[0] < 1e-6
    assert chain.criterion(plain.angles, [experiment.image])[0] > 5.0
    assert image.h < 0.05
    # Plain IK stops as soon as the end point is reached: more steps change nothing.
    more = virtual.run(chain, experiment, with_image=False, steps=60)
    assert np.array_equal(plain.angles, more.angles)


def test_experiment_2_same_end_point_other_configuration(virtual):
    chain = virtual.planar_chain()
    experiment = virtual.experiments(chain)[1]
    plain = virtual.run(chain, experiment, with_image=False, steps=40)
    image = virtual.run(chain, experiment, with_image=True, steps=40)
    assert np.allclose(plain.angles, experiment.start, atol=1e-6)
    assert image.residuals[0] < 1e-6 and image.h < 0.05
    middle = [chain.forward(angles)[1]["joint_2"] for angles in (experiment.objective, experiment.start, image.angles)]
    assert np.linalg.norm(middle[2] - middle[0]) < 0.06 < 0.3 < np.linalg.norm(middle[1] - middle[0])


def test_experiment_3_object_is_avoided(virtual):
    chain = virtual.planar_chain()
    experiment = virtual.experiments(chain)[2]
    plain = virtual.run(chain, experiment, with_image=False, steps=40)
    image = virtual.run(chain, experiment, with_image=True, steps=40)
    assert chain.criterion(plain.angles, [experiment.image])[0] > 1.0
    assert image.h < 0.05 and image.residuals[0] < 1e-6


def test_experiments_write_their_pictures(virtual, tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "argv", ["ik_virtual.py", "--out", str(tmp_path)])
    virtual.main()
    assert {file.name for file in tmp_path.iterdir()} == {f"experiment_{index}.png" for index in (1, 2, 3)}


def test_a_planar_chain_stays_in_its_plane(virtual):
    chain = virtual.planar_chain(3)
    assert chain.angle_names == ("joint_0_flexion", "joint_1_flexion", "joint_2_flexion")
    for angles in np.random.default_rng(0).uniform(-1, 1, (10, 3)):
        _, sites = chain.forward(angles)
        turns = np.cumsum(angles)
        tip = virtual.SEGMENT * np.array([-np.sin(turns).sum(), np.cos(turns).sum(), 0.0])
        assert sites["tip"] == pytest.approx(tip, abs=1e-9)
    found = ik.solve(chain, {"tip": (0.2, 0.4, 0.7)}, start=[0.1, 0.2, 0.3], steps=100)
    assert found.joints["tip"] == pytest.approx((0.2, 0.4, 0.0), abs=1e-5)
    assert found.residuals[0] == pytest.approx(0.7, abs=1e-6)


def test_sub_chains_of_a_body_from_toml(virtual):
    body = virtual.planar_chain(4).body
    part = ik.Chain(body, limbs=("segment_2", "segment_3"))
    whole = ik.Chain(body, root="fixed")
    angles = np.array([0.3, -0.2, 0.5, 0.4])
    poses, sites = whole.forward(angles)
    _, found = part.forward(angles[2:], world_from_base=poses["segment_1"])
    assert found["tip"] == pytest.approx(sites["tip"], abs=1e-12)
    assert part.site_names == ("joint_2", "joint_3", "tip")
