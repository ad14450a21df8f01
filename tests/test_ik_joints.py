"""Chains and joint angles: any body and parts of one, poses projected onto the chain, result files."""

import numpy as np
import pytest

import voodoo
from voodoo import ik
from voodoo.export.track import Track
from voodoo.ik.angles import angle_names, joint_angles


def test_jacobian_of_a_site(arm):
    angles = np.array([0.3, -0.4, 0.2, 0.9])
    analytic = arm.jacobian("l_hand", angles)
    for index, row in enumerate(np.eye(4) * 1e-6):
        difference = arm.forward(angles + row)[1]["l_hand"] - arm.forward(angles - row)[1]["l_hand"]
        assert np.allclose(analytic[:, index], difference / 2e-6, atol=1e-8)


def test_joint_angles_of_an_estimate(tmp_path):
    body = voodoo.Body.human(1.75, model="papers")
    chain = ik.Chain(body)
    rng = np.random.default_rng(1)
    expected = chain.rest()
    expected[6:] = np.clip(rng.uniform(-0.6, 0.6, len(expected) - 6), chain.limits[6:, 0], chain.limits[6:, 1])
    poses, _ = chain.forward(expected)
    tracker = voodoo.Tracker(body)
    estimate = tracker.reset_pose(dict(poses))
    found = joint_angles(body, estimate)
    assert tuple(found) == angle_names(body) == chain.angle_names[6:]
    assert list(found.values()) == pytest.approx(expected[6:], abs=1e-6)
    assert found["l_elbow_flexion"] == pytest.approx(expected[chain.angle_names.index("l_elbow_flexion")], abs=1e-6)


def test_apart_joints_are_projected_onto_the_chain():
    chain = ik.Chain(voodoo.Body.human(1.75, model="papers"))
    poses = {name: pose.copy() for name, pose in chain.forward(chain.rest())[0].items()}
    poses["l_forearm"][:3, 3] += (0.02, 0.0, 0.0)
    angles = chain.project(poses)
    closed, _ = chain.forward(angles)
    read = chain.project(poses, closest=False)
    assert np.isfinite(angles).all()
    apart = [
        np.linalg.norm(pose["l_forearm"][:3, 3] - poses["l_forearm"][:3, 3])
        for pose in (closed, chain.forward(read)[0])
    ]
    assert apart[0] < apart[1]


def test_angles_in_result_files(tmp_path):
    track = Track(
        stamps=np.array([0.0, 0.1]), status=("tracking",) * 2, residual=np.zeros(2), joint_names=("a",),
        joints=np.ones((2, 1, 3)), limb_names=(), world_from_limb=np.empty((2, 0, 4, 4)),
        angle_names=("l_elbow_flexion",), angles=np.array([[0.5], [0.25]]),
    )  # fmt: skip
    for suffix in ("csv", "npz"):
        file = tmp_path / f"pose.{suffix}"
        track.save(file)
        again = Track.load(file)
        assert again.angle_names == track.angle_names and np.array_equal(again.angles, track.angles)
    assert "l_elbow_flexion_rad" in (tmp_path / "pose.csv").read_text().splitlines()[0]
