"""What a site moves before the published solver moves each limb alone."""

import numpy as np
import pytest

import voodoo

START = {
    "l_shoulder": (2.4, -0.2, 1.45),
    "r_shoulder": (2.4, 0.2, 1.45),
    "l_hip": (2.4, -0.09, 0.94),
    "r_hip": (2.4, 0.09, 0.94),
}
TRUNK = ("humanoid_root", "vc7", "l_hip", "r_hip", "r_shoulder")
LEGS = ("l_knee", "r_knee", "l_ankle", "r_ankle")


def start() -> tuple[voodoo.Tracker, dict[str, np.ndarray]]:
    tracker = voodoo.Tracker(voodoo.Body.human(1.78, model="papers"), config=voodoo.Config(solver="limbwise"))
    joints = tracker.reset(joints=START).joints
    return tracker, {name: np.array(place) for name, place in joints.items()}


def surface_points(tracker: voodoo.Tracker, limbs: tuple[str, ...]) -> np.ndarray:
    """Points all around `limbs`, on their surfaces."""
    points = []
    for limb in tracker.body.limbs:
        if limb.name in limbs:
            along, angle = (grid.ravel() for grid in np.meshgrid(np.linspace(0.1, 0.9, 12), np.arange(0, 6.2, 0.4)))
            shape, pose = limb.shape, tracker.estimate.world_from_limb[limb.name]
            a = shape.a0 + along * (shape.a1 - shape.a0)
            b = shape.b0 + along * (shape.b1 - shape.b0)
            local = np.column_stack([a * np.cos(angle), b * np.sin(angle), along * shape.length])
            points.append(local @ pose[:3, :3].T + pose[:3, 3])
    return np.concatenate(points)


def test_a_hand_moves_its_arm_and_leaves_trunk_and_legs_on_their_points():
    tracker, before = start()
    observed = before["l_hand"] + (-0.3, 0.0, 0.3)
    frame = voodoo.Frame(stamp=0.0)
    legs = ("l_thigh", "r_thigh", "l_calf", "r_calf")
    frame.add_points(surface_points(tracker, ("torso", *legs)), on_body=True, source="depth")
    frame.add_position("l_hand", observed, weight=20.0)
    after = tracker.step(frame).joints
    assert np.linalg.norm(after["l_hand"] - observed) < 0.08
    for name in (*TRUNK, *LEGS):
        assert np.linalg.norm(after[name] - before[name]) < 0.02, name


@pytest.mark.parametrize("side", ["l", "r"])
def test_limbs_without_points_are_carried(side):
    """A leg that nothing measures goes where the trunk goes; its joints stay closed."""
    tracker, before = start()
    frame = voodoo.Frame(stamp=0.0)
    shift = np.array([0.0, 0.04, 0.0])
    other = "r" if side == "l" else "l"
    frame.add_points(surface_points(tracker, ("torso", f"{other}_thigh", f"{other}_calf")) + shift, on_body=True)
    frame.add_position("l_hand", before["l_hand"] + shift, weight=20.0)
    estimate = tracker.step(frame)
    assert max(estimate.joint_gaps.values()) < 0.02
    assert np.linalg.norm(estimate.joints[f"{side}_ankle"] - before[f"{side}_ankle"] - shift) < 0.04
