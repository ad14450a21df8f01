"""Feet that are seen to stand are held where they are; those that make a step, or that nobody sees, are not."""

import numpy as np
import pytest

import voodoo
from voodoo.walks import Stop, Walk

ANKLES = ("l_ankle", "r_ankle")
TRUNK = ("humanoid_root", "l_hip", "r_hip", "vc7", "l_shoulder", "r_shoulder")


@pytest.fixture(scope="module")
def body():
    return voodoo.Body.human(height=1.78, model="full")


def follow(body, ways, *, stance, trunk=False, feet=True):
    """Displacement (F, 3) [m] of the ankles, mean of both, when they, and the trunk, are seen displaced by `ways` (F, 3) [m]."""
    tracker = voodoo.Tracker(body, config=voodoo.Config(stance=stance))
    chain = voodoo.ik.Chain(body)
    # Knees a little bent: a stretched leg cannot become longer.
    bent = np.array([0.2 if "knee" in name else 0.0 for name in chain.angle_names])
    start, found = tracker.reset_pose(chain.forward(bent)[0]).joints, []
    for index, way in enumerate(ways):
        frame = voodoo.Frame(index / 30.0)
        for name in TRUNK:
            frame.add_position(name, start[name] + way * trunk, weight=100.0)
        for name in ANKLES if feet else ():
            frame.add_position(name, start[name] + way, weight=20.0)
        estimate = tracker.step(frame)
        found.append(np.mean([estimate.joints[name] - start[name] for name in ANKLES], axis=0))
    return np.array(found)


def test_feet_that_stand_tremble_less(body):
    ways = np.zeros((40, 3))
    ways[:, 0] = 0.01 * (-1.0) ** np.arange(40)
    held, free = (np.abs(follow(body, ways, stance=stance)[10:, 0]).mean() for stance in (True, False))
    assert 0.001 < held < 0.8 * free


def test_a_step_is_followed(body):
    ways = np.zeros((8, 3))
    ways[3:, 0] = 0.15
    found = follow(body, ways, stance=True)
    assert found[2, 0] == pytest.approx(0.0, abs=0.005)
    assert found[-1, 0] == pytest.approx(0.15, abs=0.01)


def test_feet_that_nobody_sees_go_along_with_the_body(body):
    ways = np.linspace(0.0, 0.3, 20)[:, None] * np.array([1.0, 0.0, 0.0])
    held, free = (follow(body, ways, stance=stance, trunk=True, feet=False) for stance in (True, False))
    assert held == pytest.approx(free, abs=1e-9)
    assert held[-1, 0] > 0.2


def test_feet_that_walk_are_not_late(body):
    source = Walk(body=body, stops=(Stop(0.0, 3.0, -0.6, 1.57), Stop(1.2, 3.0, 0.6, 1.57)))
    tracker, errors = voodoo.Tracker(body, config=voodoo.Config(stance=True)), []
    for frame in source:
        if not errors:
            tracker.reset_pose(frame.world_from_limb)
        found = tracker.step(source.measurement(frame)).joints
        errors.append([np.linalg.norm(found[name] - frame.joints[name]) for name in ANKLES])
    assert np.max(errors) < 0.02
