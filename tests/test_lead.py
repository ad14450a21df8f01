"""What a site moves before the published solver moves each limb alone."""

import numpy as np

import voodoo

START = {
    "l_shoulder": (2.4, -0.2, 1.45),
    "r_shoulder": (2.4, 0.2, 1.45),
    "l_hip": (2.4, -0.09, 0.94),
    "r_hip": (2.4, 0.09, 0.94),
}


def test_a_hand_moves_its_arm_and_leaves_the_legs_where_they_were():
    tracker = voodoo.Tracker(voodoo.Body.human(1.78, model="papers"), config=voodoo.Config(solver="limbwise"))
    before = {name: np.array(place) for name, place in tracker.reset(joints=START).joints.items()}
    seen = before["l_hand"] + (-0.3, 0.0, 0.3)
    frame = voodoo.Frame(stamp=0.0)
    frame.add_position("l_hand", seen, weight=20.0)
    after = tracker.step(frame).joints
    assert np.linalg.norm(after["l_hand"] - seen) < 0.05
    for name in ("l_knee", "r_knee", "l_ankle", "r_ankle"):
        assert np.linalg.norm(after[name] - before[name]) < 0.02, name
