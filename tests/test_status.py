"""What the tracker says of arms and legs: seen ones are measured; put on the trunk, hidden, or with an elbow off, they are not."""

import numpy as np
import pytest

import voodoo
from voodoo import metrics
from voodoo.ik import Chain
from voodoo.rendering import render_depth
from voodoo.virtual import CAMERA, METRES_PER_UNIT, VirtualSequence

WALL_M = 3.6
HELD = {"gate_start": 0.001, "gate_end": 0.001, "hypotheses": False, "outline": False, "recovery": False}
"""No point this near, no correction: the body stays where it was put, and what is said of it can be asked."""
LEGS = ("l_thigh", "l_calf", "r_thigh", "r_calf")


@pytest.fixture(scope="module")
def body():
    return voodoo.Body.human(height=1.78, model="full")


def posture(body, **angles):
    """Poses and joints of a person 2.4 m before the camera, facing it."""
    chain = Chain(body)
    values = np.zeros(len(chain.angle_names))
    for name, value in angles.items():
        values[chain.angle_names.index(name)] = value
    base = np.array([[-1.0, 0.0, 0.0, 2.4], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.86], [0.0, 0.0, 0.0, 1.0]])
    return chain.forward(values, world_from_base=base)


def judged(body, true, believed, frames=4):
    """The estimate after some frames that show `true` to a tracker held at `believed`; and the errors of the joints [m]."""
    world_from_sensor = VirtualSequence(body=body).world_from_sensor
    seen = render_depth(body, true[0], camera=CAMERA, world_from_sensor=world_from_sensor).depth
    noise = np.random.default_rng(3).normal(0.0, 0.004, seen.shape)
    image = np.rint((np.where(seen > 0.0, seen, WALL_M) + noise) / METRES_PER_UNIT).astype(np.uint16)
    tracker = voodoo.Tracker(body, config=voodoo.Config(**HELD))
    tracker.reset_pose(believed[0])
    for index in range(frames):
        frame = voodoo.Frame(stamp=index / 30)
        frame.add_depth(image, camera=CAMERA, metres_per_unit=METRES_PER_UNIT, world_from_sensor=world_from_sensor)
        estimate = tracker.step(frame)
    return estimate, {name: np.linalg.norm(estimate.joints[name] - true[1][name]) for name in metrics.JOINTS}


OUT = {"l_shoulder_ry": -0.9, "r_shoulder_ry": 0.9}


def test_what_is_seen_where_it_is_is_measured(body):
    true = posture(body, **OUT)
    estimate, errors = judged(body, true, true)
    assert max(errors.values()) < 0.02
    assert set(estimate.limb_status.values()) == {"measured"} and estimate.status == "tracking"


