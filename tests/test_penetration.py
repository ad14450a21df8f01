"""Axes of limbs keep out of other limbs and out of the floor, and only where that is asked for."""

import numpy as np
import pytest

import voodoo

# Hanging arms of this person lie in the hips.
START = {"l_shoulder": (0, 0.2, 1.45), "r_shoulder": (0, -0.2, 1.45), "l_hip": (0, 0.1, 0.95), "r_hip": (0, -0.1, 0.95)}


def deepest(tracker):
    """How deep [m] an arm's axis lies in a thigh or the trunk."""
    limbs = {limb.name: limb.shape for limb in tracker.body.limbs}
    poses = tracker.estimate.world_from_limb
    depth = 0.0
    for side in "lr":
        for name in (f"{side}_forearm", f"{side}_hand"):
            along = np.linspace(0.0, limbs[name].length, 11)[:, None] * poses[name][:3, 2] + poses[name][:3, 3]
            for other in ("pelvis", "l_thigh", "r_thigh"):
                inverse = np.linalg.inv(poses[other])
                inside = limbs[other].closest_points(along @ inverse[:3, :3].T + inverse[:3, 3]).signed_distance
                depth = max(depth, -float(np.min(inside)))
    return depth


@pytest.mark.parametrize("penetration", [True, False])
def test_an_arm_is_pushed_out_of_the_hip_where_that_is_asked_for(penetration):
    tracker = voodoo.Tracker(voodoo.Body.human(height=1.75), config=voodoo.Config(penetration=penetration))
    tracker.reset(joints=START)
    before = deepest(tracker)
    assert before > 0.005
    for step in range(5):
        frame = voodoo.Frame(stamp=0.1 * step)
        frame.add_position("skull_tip", tracker.estimate.joints["skull_tip"])
        tracker.step(frame)
    assert deepest(tracker) < 0.5 * before if penetration else abs(deepest(tracker) - before) < 1e-3


@pytest.mark.parametrize("penetration", [True, False])
def test_nobody_stands_in_the_floor_where_that_is_asked_for(penetration):
    tracker = voodoo.Tracker(voodoo.Body.human(height=1.75), config=voodoo.Config(penetration=penetration))
    tracker.reset(joints=START)
    feet = ("l_ankle", "r_ankle")
    low = min(tracker.estimate.joints[name][2] for name in feet)
    # The floor is 20 cm above where the feet are: knees must bend, for the head stays.
    for step in range(10):
        frame = voodoo.Frame(stamp=0.1 * step)
        frame.set_ground(normal=(0.0, 0.0, 1.0), offset=low + 0.2)
        frame.add_position("skull_tip", tracker.estimate.joints["skull_tip"])
        tracker.step(frame)
    raised = min(tracker.estimate.joints[name][2] for name in feet) - low
    assert raised > 0.15 if penetration else abs(raised) < 0.01
