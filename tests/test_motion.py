"""Points of a sensor that measured some time before the frame go on with the limb they lie on."""

from dataclasses import replace

import numpy as np
import pytest

import voodoo
import voodoo._core as _core
import voodoo.pipeline.front_end as front_end_module
from voodoo.pipeline.front_end import FrontEnd
from voodoo.recordings import LaserScan, RecordedFrame
from voodoo.sensors.settings import FrontEndSettings

STEP = 1.0 / 30.0


def turned(angle, shift):
    pose = np.eye(4)
    pose[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    pose[:3, 3] = shift
    return pose


def moving(shift, *, interval=STEP):
    """A tracker of a standing body that has moved by (3,) in a frame, and world_from_limb before it did."""
    tracker = voodoo.Tracker(voodoo.Body.human(height=1.78))
    start = {"l_shoulder": (2.0, 0.2, 1.45), "r_shoulder": (2.0, -0.2, 1.45), "l_hip": (2.0, 0.1, 0.94)}
    start["r_hip"] = (2.0, -0.1, 0.94)
    joints = tracker.reset(joints=start).joints
    for stamp, moved in ((STEP - interval, np.zeros(3)), (STEP, np.asarray(shift))):
        before = tracker.estimate.world_from_limb
        frame = voodoo.Frame(stamp)
        for site, place in joints.items():
            frame.add_position(site, place + moved, weight=1e4)
        tracker.step(frame)
    return tracker, before


def went_on(before, now, point):
    """What a limb did to a place on it."""
    return (now @ np.linalg.inv(before) @ [*point, 1.0])[:3] - point


def on_limb(tracker, limb):
    """A place 2 cm outside a limb's surface, halfway along it."""
    shape, pose = next(part.shape for part in tracker.body.limbs if part.name == limb), tracker.estimate.world_from_limb
    return (pose[limb] @ [0.5 * (shape.a0 + shape.a1) + 0.02, 0.0, 0.5 * shape.length, 1.0])[:3]


def test_sites_are_expected_where_a_fraction_of_the_last_motion_takes_them():
    tracker, _ = moving((0.05, 0.0, 0.0))
    now, rest = tracker.estimate.joints, voodoo.Tracker(voodoo.Body.human())
    for elapsed, fraction in ((0.0, 0.0), (0.5, 0.3), (-0.5, -0.3)):
        expected = tracker.predict(STEP + elapsed * STEP)
        assert list(expected) == list(now)
        moved = np.array([expected[site] - now[site] for site in now])
        assert np.allclose(moved, fraction * np.array([0.05, 0.0, 0.0]), atol=0.002)
    jumped, _ = moving((0.5, 0.0, 0.0))
    for site, place in jumped.predict(2 * STEP).items():
        assert np.array_equal(place, jumped.estimate.joints[site])
    with pytest.raises(voodoo.MeasurementError):
        rest.predict(0.0)


def test_points_go_on_with_their_limb_and_the_scene_stays():
    tracker, before = moving((0.03, 0.01, 0.0))
    now = tracker.estimate.world_from_limb
    limb = on_limb(tracker, "l_calf")
    points = np.array([limb, [5.0, 5.0, 5.0], limb + (0.0, 0.0, 3.0)])
    for elapsed in (STEP / 2, -STEP / 2):
        found = _core.carried(points, tracker._core, elapsed=elapsed)
        fraction = 0.6 * elapsed / STEP
        assert np.allclose(found[0], limb + fraction * went_on(before["l_calf"], now["l_calf"], limb), atol=1e-12)
        assert np.array_equal(found[1:], points[1:])
    pose = turned(0.3, (0.2, 0.1, 0.35))
    observed = (points - pose[:3, 3]) @ pose[:3, :3]
    found = _core.carried(observed, tracker._core, elapsed=-STEP / 2, world_from_sensor=pose)
    assert np.allclose(found @ pose[:3, :3].T + pose[:3, 3], _core.carried(points, tracker._core, elapsed=-STEP / 2))


def test_what_is_not_known_to_move_stays():
    tracker, before = moving((0.03, 0.0, 0.0))
    limb = on_limb(tracker, "l_calf")
    points = limb[None]
    assert _core.carried(points, tracker._core, elapsed=0.0) is None
    late = _core.carried(points, tracker._core, elapsed=5.0)
    step = went_on(before["l_calf"], tracker.estimate.world_from_limb["l_calf"], limb)
    assert np.allclose(late[0], limb + 0.6 * 0.1 / STEP * step), "for no longer than 0.1 s"
    jumped, _ = moving((0.5, 0.0, 0.0))
    place = on_limb(jumped, "l_calf")[None]
    assert np.array_equal(_core.carried(place, jumped._core, elapsed=STEP), place)
    tracker.reset_pose(tracker.estimate.world_from_limb)
    assert _core.carried(points, tracker._core, elapsed=STEP) is None


def test_an_older_scan_is_moved_along_with_the_leg(monkeypatch):
    """A body that walks at 1.5 m/s, and a scan of its legs half a frame before: what reaches the frame is where they are."""
    tracker, before = moving((0.05, 0.0, 0.0))
    front_end = FrontEnd(tracker, settings=FrontEndSettings(use=("scan",)))
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
    observed = []

    class Noted:
        def __init__(self, stamp):
            self.stamp = stamp

        def add_points(self, points, *, world_from_sensor, weight, source):
            observed.append((points, world_from_sensor))

    monkeypatch.setattr(front_end_module, "Frame", Noted)
    front_end.frame(RecordedFrame(2 * STEP, (replace(scan, stamp=1.5 * STEP),)))
    (points, used) = observed[0]
    assert np.array_equal(used, pose), "still in the frame of the sensor: what faces it may be seen"
    moved = (points - places) @ pose[:3, :3].T
    now = tracker.estimate.world_from_limb
    world = places @ pose[:3, :3].T + pose[:3, 3]
    for limb, place, found in zip(("l_calf", "r_calf"), world, moved, strict=False):
        assert np.allclose(found, 0.6 * 0.5 * went_on(before[limb], now[limb], place), atol=1e-9)
        assert found[0] == pytest.approx(0.6 * 0.5 * 0.05, abs=0.005)
    assert np.allclose(moved[2], 0.0)
