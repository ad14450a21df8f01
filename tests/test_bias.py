"""What a cue that may always be off may do: move limbs beyond its bias, and teach no length."""

import numpy as np
import pytest

import voodoo
from scene import rest_pose, standing_joints, surface


@pytest.mark.parametrize("solver", ["limbwise", "chain"])
def test_within_its_bias_a_cue_reports_nothing(solver):
    found = {}
    for away in (0.0, 0.04, 0.15):
        tracker = standing(solver)
        hand = np.array(tracker.estimate.joints["l_hand"]) + (0.0, 0.0, away)
        frame = voodoo.Frame(stamp=1.0)
        frame.add_position("l_hand", hand, weight=20.0, bias=0.05)
        estimate = tracker.step(frame)
        found[away] = np.array(estimate.joints["l_hand"])
        ((count, matched, residual),) = estimate.sources.values()
        assert (count, matched) == (1, 1) and residual == pytest.approx(np.linalg.norm(found[away] - hand), abs=0.03)
    moved = {away: np.linalg.norm(place - found[0.0]) for away, place in found.items()}
    assert moved[0.04] < 1e-4 < 2e-3 < moved[0.15]


def test_a_biased_cue_pulls_but_teaches_no_length():
    person = voodoo.Body.human(height=1.75)
    points = surface(person, rest_pose(person), 3000)
    larger = {name: 1.03 * place for name, place in standing_joints(person).items()}

    def lengths(**cue):
        tracker = voodoo.Tracker(person)
        hand = np.array(tracker.reset(joints=larger, fit_sizes=True).joints["l_hand"])
        frame = voodoo.Frame(stamp=1.0)
        frame.add_points(points, world_from_sensor=np.eye(4))
        if cue:
            frame.add_position("l_hand", hand - (0.0, 0.0, 0.10), **cue)
        tracker.step(frame)
        return np.array([limb.shape.length for limb in tracker.body.limbs])

    alone = lengths()
    # At 10 cm both pull with the same force. What is left of the biased one is that it has moved the limbs.
    biased, unbiased = (
        np.abs(lengths(**cue) / alone - 1.0).max() for cue in ({"weight": 20.0, "bias": 0.05}, {"weight": 10.0})
    )
    assert biased < 0.004 < 0.010 < unbiased


def standing(solver):
    body = voodoo.Body.human(height=1.75)
    tracker = voodoo.Tracker(body, config=voodoo.Config(solver=solver))
    joints = {
        "l_shoulder": (0, 0.2, 1.45),
        "r_shoulder": (0, -0.2, 1.45),
        "l_hip": (0, 0.1, 0.95),
        "r_hip": (0, -0.1, 0.95),
    }
    tracker.reset(joints=joints)
    return tracker


@pytest.mark.parametrize("bias", [-0.1, np.nan])
def test_a_bias_is_a_length(bias):
    tracker = standing("chain")
    frame = voodoo.Frame(stamp=1.0)
    frame.add_ray("l_hand", origin=(0, 0, 0), direction=(0, 0, 1), bias=bias)
    with pytest.raises(voodoo.VoodooError, match="bias"):
        tracker.step(frame)
