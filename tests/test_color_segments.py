"""Which pixels are the body, by its colors: what of them is right, for whom, and that asking changes nothing."""

import numpy as np
import pytest

import color_scene
import voodoo
from color_scene import CAMERA, RATE, pictures, pose, sequence
from voodoo.measurements import ColorImage
from voodoo.pipeline.ik import follow, known_positions
from voodoo.pipeline.start import start_tracker
from voodoo.recordings import open_recording
from voodoo.sensors.silhouettes.regions import RegionSilhouettes
from voodoo.synthetic.render import render_depth

FRAMES, CAMERAS = 8, 4


def frame_of(number):
    frame = voodoo.Frame(number / RATE)
    for camera, image in enumerate(pictures(FRAMES, CAMERAS, 0.0)[number]):
        frame.add_color(image, camera=CAMERA, world_from_sensor=pose(camera), source=f"cam_{camera}")
    return frame


def truth_of(number):
    return sequence(FRAMES).truth(number / RATE)[0]


def overlap(mask, camera, number):
    observed = (
        render_depth(sequence(FRAMES).body, truth_of(number), camera=CAMERA, world_from_sensor=pose(camera)).limb >= 0
    )
    return (mask & observed).sum() / (mask | observed).sum()


def started():
    tracker = voodoo.Tracker(sequence(FRAMES).body)
    tracker.reset_pose(truth_of(0))
    return tracker


def test_the_body_is_cut_out_and_asking_changes_no_pose():
    tracker, silent = started(), started()
    for number in range(5):
        tracker.step(frame_of(number))
        found = tracker.segment(frame_of(number))
        assert tracker.estimate.joints.keys() == silent.step(frame_of(number)).joints.keys()
    for name, place in silent.estimate.joints.items():
        np.testing.assert_array_equal(tracker.estimate.joints[name], place)
    assert list(found) == [f"cam_{camera}" for camera in range(CAMERAS)]
    for camera in range(CAMERAS):
        likely = found[f"cam_{camera}"]
        assert likely.dtype == np.float32 and likely.shape == (180, 240) and likely.min() >= 0.0 and likely.max() <= 1.0
        assert overlap(likely > 0.5, camera, 4) > 0.88


def test_a_prior_that_is_off_is_corrected_by_the_colors():
    silhouettes = RegionSilhouettes(sequence(FRAMES).body)
    items = [
        [
            ColorImage(
                f"cam_{camera}", number / RATE, lambda image=image: image, camera=CAMERA, root_from_sensor=pose(camera)
            )
            for camera, image in enumerate(pictures(FRAMES, CAMERAS, 0.0)[number])
        ]
        for number in (0, 4)
    ]
    silhouettes.of(items[0], truth_of(0))
    silhouettes.learn(items[0], truth_of(0))
    # Four frames later, with the posture of then.
    for camera, (mask, lens) in enumerate(silhouettes.of(items[1], truth_of(0))):
        old = render_depth(sequence(FRAMES).body, truth_of(0), camera=CAMERA, world_from_sensor=pose(camera)).limb >= 0
        assert lens.width == 240 and overlap(mask, camera, 4) > overlap(old, camera, 4) + 0.03
    assert silhouettes.of([], truth_of(0)) == []


def test_without_a_pose_or_with_a_wrong_picture_nothing_is_cut_out():
    tracker = voodoo.Tracker(sequence(FRAMES).body)
    with pytest.raises(voodoo.MeasurementError, match="pose"):
        tracker.segment(frame_of(0))
    assert set(tracker.segment(frame_of(0), world_from_limb=truth_of(0))) == {f"cam_{n}" for n in range(CAMERAS)}
    with pytest.raises(voodoo.BodyError, match="world_from_limb"):
        tracker.learn_colors(frame_of(0), world_from_limb={})
    for ask in (tracker.segment, tracker.learn_colors):
        with pytest.raises(voodoo.MeasurementError, match="found NoneType"):
            ask(None)
    tracker.set_background("cam_0", [np.zeros((4, 4, 3), np.uint8)])
    with pytest.raises(voodoo.MeasurementError, match="empty scene"):
        tracker.learn_colors(frame_of(0), world_from_limb=truth_of(0))


def test_inverse_kinematics_takes_silhouettes_by_region(tmp_path):
    recording = open_recording(color_scene.write_videos(tmp_path / "films", FRAMES, background=False), loader="videos")
    positions, known = known_positions(recording), ["l_shoulder", "r_shoulder", "l_hip", "r_hip"]
    errors = {}
    for kind in ("none", "regions"):
        tracker = start_tracker(recording, model="full")
        steps = list(follow(recording, tracker, positions, sites=known, pictures=kind, rest=False))
        names = ("l_elbow", "r_elbow", "l_wrist", "r_wrist", "l_ankle", "r_ankle")
        errors[kind] = np.mean([[step.errors[name] for name in names] for step in steps])
    assert errors["regions"] < 0.7 * errors["none"] and errors["regions"] < 0.03, errors
