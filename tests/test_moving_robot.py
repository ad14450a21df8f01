"""A robot that moves: the same made-up walk before a camera that drives and turns, and before one that stands."""

import math

import numpy as np
import pytest

import voodoo
from made_up import WALL
from synthetic.gait import path
from synthetic.people import MadeUpRecording, Scene, Walker
from synthetic.stories import base_from_camera
from voodoo.evaluation import metrics
from voodoo.evaluation.people_evaluate import judge
from voodoo.pipeline.run import track
from voodoo.pipeline.start import AUTO, start_tracker

CUPBOARD = ((3.9, 0.9, 0.0), (4.4, 1.7, 1.8))
SECONDS, MORE_M = 3.4, 0.01


def walk(moving):
    """Somebody crosses the view; from 0.6 s on the camera moves 1.2 m and turns by 24 degrees."""

    def root_from_sensor(time):
        fraction = np.clip((time - 0.6) / 2.6, 0.0, 1.0) if moving else 0.0
        turn = math.radians(24.0) * fraction
        pose = np.eye(4)
        pose[:2, :2] = [[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]]
        pose[:2, 3] = np.array([0.6, -1.04]) * fraction
        return pose @ base_from_camera()

    person = Walker(body=voodoo.Body.human(1.78), stops=path([(0.0, 3.1, 0.8), (1.7, 3.2, 0.0), (SECONDS, 3.1, 0.4)]))
    return MadeUpRecording(
        Scene(
            name="moving" if moving else "standing",
            people=(person,),
            seconds=SECONDS,
            furniture=(WALL, CUPBOARD),
            root_from_sensor=root_from_sensor,
            root_frame="odom",
            color=False,
        )
    )


@pytest.fixture(scope="module")
def both():
    return walk(False), walk(True)


def alone(recording):
    """Mean error [m] of one tracker, which found the person by itself."""
    truth = recording.people
    expected = np.stack([truth.of(name)[:, 0] for name in metrics.JOINTS], axis=1)
    errors = [
        np.linalg.norm([step.estimate.joints[name] for name in metrics.JOINTS] - expected[step.index], axis=1).mean()
        for step in track(recording, start_tracker(recording, init=AUTO))
        if step.estimate.joints
    ]
    assert len(errors) > 0.8 * len(recording)
    return float(np.mean(errors))


def test_one_tracker_follows_as_well_from_a_robot_that_moves(both):
    standing, moving = (alone(recording) for recording in both)
    assert standing < 0.05 and moving < standing + MORE_M


def test_so_do_several(both):
    standing, moving = (judge(recording, voodoo.People()) for recording in both)
    assert moving.joint_error_m < standing.joint_error_m + MORE_M
    assert (moving.ids, moving.switches, moving.false_bodies) == (1, 0, 0)
    assert moving.mota > 0.9
