"""Keypoints of networks as rays and points."""

import json
from dataclasses import replace

import numpy as np
import pytest

import voodoo
from voodoo import Camera, MeasurementError, RecordingError
from voodoo.measurements import KeypointImage
from voodoo.recordings.keypoint_files import read_openpose_json
from voodoo.recordings.keypoint_layouts import LAYOUTS
from voodoo.sensors.gating import SiteGate
from voodoo.sensors.keypoints import KeypointSensor
from voodoo.sensors.keypoints.sites import assign_keypoints, nearest_person, site_pixels, window_depth

CAMERA = Camera(640, 480, 500.0, 500.0, 319.5, 239.5, (-0.1, 0.02, 0.0, 0.0))
# 3 m in front of the person, 1 m high, looking along world y
POSE = np.array([[1.0, 0, 0, 0], [0, 0, 1, -3.0], [0, -1, 0, 1.0], [0, 0, 0, 1]])


def tracker():
    joints = {
        "l_hip": (0.1, 0, 0.9), "r_hip": (-0.1, 0, 0.9), "l_shoulder": (0.2, 0, 1.45), "r_shoulder": (-0.2, 0, 1.45),
        "l_elbow": (0.3, 0, 1.2), "l_wrist": (0.35, -0.05, 0.95), "r_elbow": (-0.3, 0, 1.2), "r_wrist": (-0.35, -0.05,
        0.95), "l_knee": (0.1, 0, 0.5), "r_knee": (-0.1, 0, 0.5), "l_ankle": (0.1, 0, 0.08), "r_ankle": (-0.1, 0, 0.08),
    }  # fmt: skip
    result = voodoo.Tracker(voodoo.Body.human(height=1.75))
    result.reset(joints=joints, fit_sizes=True)
    return result


def keypoints_of(joints, layout):
    """The picture a perfect network would give: every keypoint that alone makes a site."""
    table = LAYOUTS[layout]
    rows = np.zeros((table.count, 3))
    for part in table.parts:
        if part.site in joints and len(part.weights) == 1:
            camera_point = (joints[part.site] - POSE[:3, 3]) @ POSE[:3, :3]
            rows[next(iter(part.weights))] = [*CAMERA.project(camera_point[None])[0], 0.9]
    return rows


@pytest.mark.parametrize("layout", LAYOUTS)
def test_every_layout_is_consistent(layout):
    table = LAYOUTS[layout]
    sites = [part.site for part in table.parts]
    assert len(set(sites)) == len(sites)
    known = {*voodoo.Body.human().site_names, "l_toe", "r_toe"}
    assert set(sites) <= known
    for joint in ("shoulder", "elbow", "wrist", "hip", "knee", "ankle"):
        assert {f"l_{joint}", f"r_{joint}"} <= set(sites)
    for part in table.parts:
        assert sum(part.weights.values()) == pytest.approx(1.0)
        assert all(0 <= index < table.count for index in part.weights)
        mirrored = {"l": "r_", "r": "l_"}.get(part.site[0] if part.site[1] == "_" else "", "")
        assert not mirrored or mirrored + part.site[2:] in sites


# The indices are facts about the networks; these are spelled out again from their documentation.
@pytest.mark.parametrize(
    ("layout", "left_wrist", "right_ankle"),
    [
        ("coco17", 9, 16),
        ("body25", 7, 11),
        ("body25b", 9, 16),
        ("blazepose33", 15, 28),
        ("halpe26", 9, 16),
        ("h36m17", 13, 3),
    ],
)
def test_indices(layout, left_wrist, right_ankle):
    rows = np.zeros((LAYOUTS[layout].count, 3))
    rows[left_wrist] = (10, 20, 0.8)
    rows[right_ankle] = (30, 40, 0.7)
    observed, unseen = site_pixels(rows, layout=layout)
    assert {(item.site, item.pixel, item.confidence) for item in observed} == {
        ("l_wrist", (10.0, 20.0), 0.8), ("r_ankle", (30.0, 40.0), 0.7)
    }  # fmt: skip
    assert len(observed) + len(unseen) == len(LAYOUTS[layout].parts)


def test_a_site_between_keypoints_has_the_least_confidence():
    rows = np.zeros((17, 3))
    rows[3], rows[4] = (100, 50, 0.9), (120, 54, 0.4)
    (head,), _ = site_pixels(rows, layout="coco17")
    assert (head.site, head.pixel, head.confidence) == ("head_center", (110.0, 52.0), 0.4)


def test_wrong_shape_and_layout_are_refused():
    with pytest.raises(MeasurementError, match=r"\(17, 3\)"):
        site_pixels(np.zeros((25, 3)), layout="coco17")
    with pytest.raises(MeasurementError, match="coco17, body25"):
        site_pixels(np.zeros((25, 3)), layout="coco")


@pytest.mark.parametrize("layout", ["coco17", "body25b", "h36m17"])
def test_rays_reach_the_tracker_and_hold_the_pose(layout):
    track = tracker()
    before = dict(track.estimate.joints)
    sensor = KeypointSensor(layout, CAMERA, POSE)
    frame = voodoo.Frame(stamp=0.0)
    report = sensor.add(frame, keypoints_of(before, layout), predicted=before)
    assert {"l_wrist", "r_wrist", "l_ankle"} <= set(report.rays)
    assert not report.dropped
    estimate = track.step(frame)
    assert estimate.sources["keypoints"][0] == len(report.rays)
    assert estimate.sources["keypoints"][2] < 1e-3  # the rays pass through the sites
    for name in ("l_wrist", "r_ankle"):
        assert np.linalg.norm(estimate.joints[name] - before[name]) < 0.01


def test_a_far_keypoint_is_dropped_by_the_gate():
    joints = dict(tracker().estimate.joints)
    rows = keypoints_of(joints, "coco17")
    rows[9, 0] += 150.0
    report = KeypointSensor("coco17", CAMERA, POSE).add(
        voodoo.Frame(stamp=0.0), rows, predicted=joints, gate=SiteGate(radius=0.2)
    )
    assert report.dropped == ("l_wrist",)


def test_registered_depth_gives_points_behind_the_surface():
    joints = dict(tracker().estimate.joints)
    depth = np.full((480, 640), 3000, dtype=np.uint16)
    sensor = KeypointSensor("coco17", CAMERA, POSE, sites=("l_wrist", "r_wrist"))
    rows = keypoints_of(joints, "coco17")
    u, v = (round(float(value)) for value in rows[10, :2])
    depth[v - 3 : v + 4, u - 3 : u + 4] = 0  # no return at the right wrist: stays a ray
    frame = voodoo.Frame(stamp=0.0)
    report = sensor.add(frame, rows, predicted=joints, depth=depth)
    assert (report.points, report.rays) == (("l_wrist",), ("r_wrist",))
    with pytest.raises(MeasurementError, match="480, 640"):
        sensor.add(frame, rows, predicted=joints, depth=depth[:100])


def test_what_the_body_hides_is_a_guess():
    track = tracker()
    joints = dict(track.estimate.joints)
    names = ("l_hip", "r_hip", "l_wrist")
    beside = (3.0, 0.0, 0.9)  # at the person's left
    left, right, wrist = track.body_before([joints[name] for name in names], beside)
    assert left < 0.12 < 0.20 < right  # the pelvis lies before the other hip
    assert wrist < 0.05
    before = dict(zip(names, (left, right, wrist), strict=True))
    _, rays, _ = KeypointSensor("coco17", CAMERA, POSE).observe(
        keypoints_of(joints, "coco17"), stamp=0.0, predicted=joints, before=before
    )
    sigma = {ray.site: ray.sigma for ray in rays}
    assert sigma["r_hip"] > 1.3 * sigma["l_hip"]
    assert sigma["l_wrist"] == sigma["r_wrist"]


def test_window_depth_takes_the_near_surface_and_ignores_holes():
    depth = np.full((20, 20), 4000, dtype=np.uint16)
    depth[:, :10] = 2000
    depth[5:9, 8] = 0
    assert window_depth(depth, (9.0, 7.0)) == pytest.approx(2.0)
    assert window_depth(depth, (16.0, 7.0)) == pytest.approx(4.0)
    assert window_depth(np.zeros((20, 20), np.uint16), (9.0, 7.0)) is None
    assert window_depth(depth, (25.0, 7.0)) is None


def test_openpose_json(tmp_path):
    path = tmp_path / "frame.json"
    flat = list(range(75))
    path.write_text(json.dumps({"version": 1.3, "people": [{"pose_keypoints_2d": flat}]}))
    (person,) = read_openpose_json(path, layout="body25")
    np.testing.assert_array_equal(person[1], [3, 4, 5])
    with pytest.raises(RecordingError, match="17 keypoints for coco17, found 25"):
        read_openpose_json(path, layout="coco17")
    path.write_text(json.dumps({"people": [{"pose_keypoints_2d": [float("nan")] * 3 + flat[3:]}]}))
    (person,) = read_openpose_json(path, layout=None)
    np.testing.assert_array_equal(person[:2], [[0, 0, 0], [3, 4, 5]])  # what is not a number was not seen
    path.write_text(json.dumps({"people": [{"pose_keypoints_2d": [0.0, 0.0, 0.9, *flat[3:]]}]}))
    (person,) = read_openpose_json(path, layout=None)
    np.testing.assert_array_equal(person[:2], [[0, 0, 0], [3, 4, 5]])  # nor what is at exact zeros
    path.write_text('{"people": [')
    with pytest.raises(RecordingError, match="OpenPose JSON"):
        read_openpose_json(path, layout="body25")
    path.write_text('{"people": [{}]}')
    assert read_openpose_json(path, layout="body25b") == []
    path.write_text('{"people": []}')
    assert read_openpose_json(path, layout="body25") == []


def test_the_person_nearest_to_the_prediction_is_chosen():
    joints = dict(tracker().estimate.joints)
    mine = keypoints_of(joints, "body25")
    other = mine + np.array([150.0, 0.0, 0.0])
    image = KeypointImage("camera", 0.0, (other, mine), "body25", CAMERA, POSE)
    assert nearest_person(image, predicted=joints) is mine
    assert nearest_person(replace(image, people=()), predicted=joints) is None


@pytest.mark.parametrize("least", [0.02, 0.2])
def test_the_least_confidence_holds_where_people_are_told_apart(least):
    joints = dict(tracker().estimate.joints)
    mine = keypoints_of(joints, "body25")
    doubtful, other = mine * [1.0, 1.0, 0.05], mine + [20.0, 0.0, 0.0]
    image = KeypointImage("camera", 0.0, (other, doubtful), "body25", CAMERA, POSE)
    expected = doubtful if least < 0.05 else other
    assert nearest_person(image, predicted=joints, min_confidence=least) is expected
    of, _ = assign_keypoints(image, {7: joints}, min_confidence=least)
    assert of[7].people[0] is expected


def test_other_programs_of_the_same_keypoints(tmp_path):
    rows = np.column_stack([np.arange(17) + 1.0, np.arange(17) + 2.0, np.full(17, 0.5)])
    flat, pairs = rows.ravel().tolist(), rows[:, :2].tolist()
    alphapose = [{"image_id": "0.jpg", "keypoints": flat}]
    mmpose = {"meta_info": {}, "instance_info": [{"keypoints": pairs, "keypoint_scores": [0.5] * 17}]}
    nested = {"people": [{"pose_keypoints_2d": rows.tolist()}]}
    first = {"version": 1.1, "people": [{"pose_keypoints": flat}]}
    path = tmp_path / "0.json"
    for content in (alphapose, mmpose, nested, first):
        path.write_text(json.dumps(content))
        (person,) = read_openpose_json(path, layout="coco17")
        np.testing.assert_array_equal(person, rows)
    path.write_text(json.dumps([*alphapose, {"image_id": "1.jpg", "keypoints": flat}]))
    with pytest.raises(RecordingError, match="a file for each image, found 2 image_id"):
        read_openpose_json(path, layout="coco17")
    path.write_text(json.dumps({"instance_info": [{"keypoints": pairs, "keypoint_scores": [0.5]}]}))
    with pytest.raises(RecordingError, match="a score for each"):
        read_openpose_json(path, layout="coco17")
