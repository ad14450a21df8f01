"""Arms that hide at the body's side."""

import numpy as np

import voodoo
from room_walk import Walk
from synthetic.gait import path

ARMS = ("l_elbow", "l_wrist", "r_elbow", "r_wrist")
REST = tuple(f"{side}_{joint}" for side in "lr" for joint in ("shoulder", "hip", "knee", "ankle"))


def test_an_arm_that_hides_at_the_side_of_who_walks_past_does_not_go_to_the_other_hand():
    """There and back: one arm hides, then the other. A hidden one swings on, unseen: it is off by half a swing at times."""
    ends = ((2.8, -0.9), (2.8, 0.9))
    walk = Walk(body=voodoo.Body.human(1.78), stops=path([(0.0, *ends[0]), (1.9, *ends[1]), (3.8, *ends[0])]))
    tracker, chance = voodoo.Tracker(voodoo.Body.human()), np.random.default_rng(3)
    errors, apart = [], []
    for frame in walk:
        if not errors:
            names = ("humanoid_root", "vc7", *ARMS, *REST)
            tracker.reset(joints={name: frame.joints[name] + chance.normal(0.0, 0.004, 3) for name in names})
        joints = tracker.step(walk.measurement(frame)).joints
        errors.append([np.linalg.norm(joints[name] - frame.joints[name]) for name in ARMS])
        apart.append(np.linalg.norm(joints["l_wrist"] - joints["r_wrist"]))
    found = np.array(errors)
    assert found.mean() < 0.04 and found.max() < 0.35, f"{found.mean(0)} {found.max(0)}"
    assert min(apart) > 0.3, f"the hands are {min(apart)} m apart"
