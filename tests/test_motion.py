"""Points of a sensor that measured some time before the frame go on with the limb they lie on."""

from dataclasses import replace

import numpy as np
import pytest

import voodoo
import voodoo.pipeline.front_end as front_end_module
from voodoo.pipeline.front_end import FrontEnd
from voodoo.recordings import LaserScan, RecordedFrame
from voodoo.sensors.motion import LimbMotion
from voodoo.sensors.settings import FrontEndSettings

STEP = 1.0 / 30.0


def turned(angle, shift):
    pose = np.eye(4)
    pose[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    pose[:3, 3] = shift
    return pose


def near(points):
    """Distances from two limbs at the origin and a metre to its left."""
    return np.array([np.linalg.norm(points - place, axis=1) for place in ((0.0, 0.0, 0.0), (0.0, 1.0, 0.0))])


def moving(shift, angle=0.0, **options):
    motion = LimbMotion(velocity_share=1.0, **options)
    still = turned(0.0, (0.0, 0.0, 0.0))
    motion.update(0.0, np.array([still, turned(0.0, (0.0, 1.0, 0.0))]))
    motion.update(STEP, np.array([still, turned(angle, np.add((0.0, 1.0, 0.0), shift))]))
    return motion


POINTS = np.array([[0.0, 0.1, 0.0], [0.1, 1.0, 0.0], [0.0, 0.5, 0.0], [5.0, 5.0, 5.0]])


def test_points_go_on_with_their_limb_and_the_scene_stays():
    found = moving((0.03, 0.0, 0.0)).motion_compensated(POINTS, STEP / 2, near)
    assert np.allclose(found - POINTS, [[0, 0, 0], [0.015, 0, 0], [0, 0, 0], [0, 0, 0]])
    earlier = moving((0.03, 0.0, 0.0)).motion_compensated(POINTS, -STEP / 2, near)
    assert np.allclose(earlier[1], POINTS[1] - (0.015, 0.0, 0.0))


def test_a_turning_limb_moves_what_is_far_from_its_joint_more():
    found = moving((0.0, 0.0, 0.0), angle=0.05).motion_compensated(POINTS, STEP, near)
    assert np.allclose(found[1], [0.1 * np.cos(0.05), 1.0 + 0.1 * np.sin(0.05), 0.0])


def test_what_is_not_known_to_move_stays():
    assert LimbMotion().motion_compensated(POINTS, STEP, near) is POINTS
    assert moving((0.03, 0.0, 0.0)).motion_compensated(POINTS, 0.0, near) is POINTS
    jumped = moving((0.5, 0.0, 0.0))
    assert np.array_equal(jumped.motion_compensated(POINTS, STEP, near), POINTS)
    late = moving((0.03, 0.0, 0.0)).motion_compensated(POINTS, 5.0, near)
    assert late[1, 0] == pytest.approx(0.1 + 0.1 * 0.03 / STEP), "for no longer than 0.1 s"
    another_body = moving((0.03, 0.0, 0.0))
    another_body.update(2 * STEP, np.eye(4)[None])
    assert another_body.motion_compensated(POINTS, STEP, near) is POINTS


def test_an_older_scan_is_moved_along_with_the_leg(monkeypatch):
    """A body that walks at 1.5 m/s, and a scan of its legs half a frame before: what reaches the frame is where they are."""
    tracker = voodoo.Tracker(voodoo.Body.human(height=1.78))
    start = {"l_shoulder": (2.0, 0.2, 1.45), "r_shoulder": (2.0, -0.2, 1.45), "l_hip": (2.0, 0.1, 0.94)}
    start["r_hip"] = (2.0, -0.1, 0.94)
    tracker.reset(joints=start)
    front_end = FrontEnd(tracker, settings=FrontEndSettings(use=("scan",)))
    shift = np.array([0.05, 0.0, 0.0])
    front_end._motion.update(0.0, turned(0.0, -shift) @ tracker.estimate.limb_poses)
    front_end._motion.update(STEP, tracker.estimate.limb_poses)
    pose = turned(0.3, (0.2, 0.1, 0.35))
    legs = [tracker.estimate.world_from_limb[f"{side}_calf"][:3, 3] for side in "lr"]
    places = np.array([[leg[0] - 0.05, leg[1], 0.35] for leg in legs] + [[4.0, 0.5, 0.35]])
    places = (places - pose[:3, 3]) @ pose[:3, :3]
    scan = LaserScan(
        "scan",
        2 * STEP,
        np.linalg.norm(places, axis=1),
        angle_min=0.0,
        angle_increment=0.1,
        range_min=0.1,
        range_max=9.0,
        root_from_sensor=pose,
    )
    monkeypatch.setattr(LaserScan, "points", lambda self: places)
    seen = []

    class Noted:
        def __init__(self, stamp):
            self.stamp = stamp

        def add_points(self, points, *, world_from_sensor, weight, source):
            seen.append((points, world_from_sensor))

    monkeypatch.setattr(front_end_module, "Frame", Noted)
    front_end.frame(RecordedFrame(2 * STEP, (replace(scan, stamp=1.5 * STEP),)))
    (points, used) = seen[0]
    assert np.array_equal(used, pose), "still in the frame of the sensor: what faces it may be seen"
    moved = (points - places) @ pose[:3, :3].T
    assert np.allclose(moved[:2], 0.6 * 0.5 * shift, atol=1e-9)
    assert np.allclose(moved[2], 0.0)
