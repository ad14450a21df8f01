"""What the tracker says of itself: seen limbs are measured; misplaced and hidden ones, and bodies put on furniture, are not."""

import numpy as np
import pytest

import voodoo
from scene import standing_joints
from synthetic.sequence import CAMERA, METERS_PER_UNIT, VirtualSequence
from voodoo.evaluation import metrics
from voodoo.export import write_trc
from voodoo.export.track import Track
from voodoo.ik import Chain
from voodoo.pipeline.run import track
from voodoo.pipeline.start import start_tracker
from voodoo.recordings import open_recording, sample_path
from voodoo.recordings.keypoint_layouts import LAYOUTS
from voodoo.sensors.keypoints import KeypointSensor
from voodoo.synthetic.render import render_depth

WALL_M, NOISE_M = 3.6, 0.004
HELD = {"gate_start": 0.001, "gate_end": 0.001, "hypotheses": False, "depth_contour": False, "relocalization": False}
"""Matches within a millimeter only, and no other corrections: the body stays where it was put, and is judged there."""
LIMBS = ("upperarm", "forearm", "hand", "thigh", "calf", "foot")
OUT = {"l_shoulder_ry": -0.9, "r_shoulder_ry": 0.9}
DOWN = {"l_shoulder_ry": -0.15, "r_shoulder_ry": 0.15}


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


def estimates(tracker, depth, frames):
    """What the tracker makes of one still scene, frame by frame."""
    world_from_sensor = VirtualSequence(body=tracker.body).world_from_sensor
    rng = np.random.default_rng(3)
    for index in range(frames):
        image = np.rint((depth + rng.normal(0.0, NOISE_M, depth.shape)) / METERS_PER_UNIT).astype(np.uint16)
        frame = voodoo.Frame(stamp=index / 30)
        frame.add_depth(image, camera=CAMERA, meters_per_unit=METERS_PER_UNIT, world_from_sensor=world_from_sensor)
        yield tracker.step(frame)


def judged(body, true, confirmed):
    """The estimate of a tracker held at `confirmed` that is shown `true` once, and the errors of its joints [m]."""
    world_from_sensor = VirtualSequence(body=body).world_from_sensor
    observed = render_depth(body, true[0], camera=CAMERA, world_from_sensor=world_from_sensor).depth
    tracker = voodoo.Tracker(body, config=voodoo.Config(**HELD))
    tracker.reset_pose(confirmed[0])
    (estimate,) = estimates(tracker, np.where(observed > 0.0, observed, WALL_M), 1)
    return estimate, {name: np.linalg.norm(estimate.joints[name] - true[1][name]) for name in metrics.JOINTS}


@pytest.mark.parametrize("arms", [OUT, DOWN, {"l_shoulder_rx": 0.9, "l_elbow_flexion": 1.0, "r_shoulder_ry": 0.9}])
def test_what_is_visible_where_it_is_is_measured(body, arms):
    true = posture(body, **arms)
    estimate, errors = judged(body, true, true)
    assert max(errors.values()) < 0.02
    limbs = [f"{side}_{limb}" for side in "lr" for limb in LIMBS]
    assert {estimate.limb_status[limb] for limb in limbs} == {"measured"} and estimate.status == "tracking"


def test_an_arm_on_the_trunk_is_not_measured(body):
    true = posture(body, **DOWN)
    confirmed = posture(body, l_shoulder_rx=0.3, l_shoulder_rz=0.8, l_elbow_flexion=2.0, r_shoulder_ry=0.15)
    estimate, errors = judged(body, true, confirmed)
    assert errors["l_elbow"] > 0.1 and errors["l_wrist"] > 0.3
    for limb in ("upperarm", "forearm", "hand"):
        assert estimate.limb_status[f"l_{limb}"] != "measured"
        assert estimate.limb_status[f"r_{limb}"] == "measured"


def test_an_arm_that_is_lost_is_reported_within_three_frames(body):
    """It was seen for long; then it hangs down, and the body that is tracked stays as it was."""
    poses = posture(body, **OUT)[0], posture(body, **(OUT | {"l_shoulder_ry": -0.15}))[0]
    world_from_sensor = VirtualSequence(body=body).world_from_sensor
    out, down = (render_depth(body, pose, camera=CAMERA, world_from_sensor=world_from_sensor).depth for pose in poses)
    # A detector cannot know in which direction a body of cylinders faces.
    tracker = voodoo.Tracker(body, config=voodoo.Config(**HELD), detector=None)
    tracker.reset_pose(poses[0])
    message = []
    for index, observed in enumerate([out] * 10 + [down] * 3):
        frame = voodoo.Frame(stamp=index / 30)
        image = np.where(observed > 0.0, observed, WALL_M).astype(np.float32)
        frame.add_depth(image, camera=CAMERA, meters_per_unit=1.0, world_from_sensor=world_from_sensor)
        message.append(dict(tracker.step(frame).limb_status))
    for limb in ("upperarm", "forearm", "hand"):
        assert {status[f"l_{limb}"] for status in message[:10]} == {"measured"}
        assert message[12][f"l_{limb}"] != "measured" and message[12][f"r_{limb}"] == "measured"


@pytest.mark.parametrize("angles, forearm", [((-0.6, 0.1, 1.3, 1.6), "measured"), ((-0.5, 0.2, 0.6, 0.6), "inferred")])
def test_what_is_behind_the_trunk_is_inferred(body, angles, forearm):
    """Of the first forearm the inner part stands out: it is known by that, its hand by nothing."""
    names = ("l_shoulder_rx", "l_shoulder_ry", "l_shoulder_rz", "l_elbow_flexion")
    true = posture(body, **dict(zip(names, angles, strict=True)), r_shoulder_ry=0.9)
    estimate, errors = judged(body, true, true)
    assert max(errors.values()) < 0.02
    assert estimate.limb_status["l_forearm"] == forearm and estimate.limb_status["l_hand"] == "inferred"
    assert estimate.limb_status["r_forearm"] == estimate.limb_status["r_hand"] == "measured"


@pytest.mark.parametrize(
    "turn", [{"l_shoulder_rx": -0.45}, {"l_shoulder_rx": 0.45}, {"l_shoulder_ry": -1.35}, {"l_shoulder_ry": -0.45}]
)
def test_an_elbow_off_by_twelve_centimeters_is_not_measured(body, turn):
    """Forwards, backwards, up and down: in depth the arm covers the pixels it should, and no camera sees past it."""
    estimate, errors = judged(body, posture(body, **OUT), posture(body, **(OUT | turn)))
    assert 0.12 < errors["l_elbow"] < 0.16
    assert estimate.limb_status["l_upperarm"] != "measured" and estimate.limb_status["l_forearm"] != "measured"
    assert estimate.limb_status["r_upperarm"] == "measured"


@pytest.mark.parametrize("width", [0.45, 0.7])
def test_a_cupboard_of_a_persons_size_is_no_body(body, width):
    """A track started on it, which the search must not start on it again either."""
    across = (np.arange(CAMERA.width) - CAMERA.cx) / CAMERA.fx * 2.3
    height = 1.0 - (np.arange(CAMERA.height) - CAMERA.cy) / CAMERA.fy * 2.3
    cupboard = (np.abs(across) < width / 2)[None, :] & ((height > 0.0) & (height < 1.75))[:, None]
    tracker = voodoo.Tracker(body)
    tracker.reset_pose(posture(body, **DOWN)[0])
    status = [str(estimate.status) for estimate in estimates(tracker, np.where(cupboard, 2.3, WALL_M), 40)]
    assert status[20:] == ["lost"] * 20
    assert set(tracker.estimate.limb_status.values()) == {"lost"}


def test_keypoints_alone_track_a_person_who_is_visible():
    """Hips tell of the pelvis, shoulders of the clavicles: no depth image is needed to call that tracked."""
    body = voodoo.Body.human(1.75)
    tracker = voodoo.Tracker(body)
    standing = standing_joints(body)
    sites = [f"{side}_{name}" for side in "lr" for name in ("shoulder", "elbow", "wrist", "hip", "knee", "ankle")]
    tracker.reset(joints={name: standing[name] for name in sites}, fit_sizes=False)
    for number in range(5):
        frame = voodoo.Frame(stamp=number / 30.0)
        for name in sites:
            frame.add_position(name, standing[name], weight=20.0)
        estimate = tracker.step(frame)
        assert estimate.status == "tracking"
    assert {limb for limb, word in estimate.limb_status.items() if word != "measured"} <= {"thorax", "neck", "head"}
    # A leg that nobody sees is not measured, whatever its hip tells of the pelvis.
    for later in range(4):
        frame = voodoo.Frame(stamp=1.0 + later / 30.0)
        for name in ("l_shoulder", "r_shoulder", "l_hip", "r_hip"):
            frame.add_position(name, standing[name], weight=20.0)
        estimate = tracker.step(frame)
    assert estimate.limb_status["r_calf"] != "measured" and estimate.status != "tracking"


VIEW_FROM = (
    np.array([[0.0, 0.0, 1.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 1.0], [0.0, 0.0, 0.0, 1.0]]),
    np.array([[1.0, 0.0, 0.0, 3.0], [0.0, 0.0, 1.0, -3.0], [0.0, -1.0, 0.0, 1.0], [0.0, 0.0, 0.0, 1.0]]),
)
"""Before the person of the bundled recording, and to the right of it."""


def test_a_whole_recording_of_markers_alone_is_tracked(tmp_path):
    reference = open_recording(sample_path()).reference
    paired = [name for name in reference.names if name[:2] in ("l_", "r_")]
    count, columns = len(reference.stamps), [reference.names.index(name) for name in paired]
    places, nothing = reference.positions[:, columns], np.empty((count, 0, 4, 4))
    truth = Track(reference.stamps, ("tracking",) * count, np.zeros(count), tuple(paired), places, (), nothing)
    write_trc(tmp_path / "m.trc", truth)
    recording = open_recording(tmp_path / "m.trc")
    states = [str(step.estimate.status) for step in track(recording, start_tracker(recording))]
    assert states == ["tracking"] * 90


def test_a_whole_recording_of_keypoints_alone_is_tracked():
    """As a network sees the true joints in two cameras, with errors of three pixels."""
    recording, layout = open_recording(sample_path()), LAYOUTS["coco17"]
    reference, rng = recording.reference, np.random.default_rng(5)
    alone = {part.site: next(iter(part.weights)) for part in layout.parts if len(part.weights) == 1}
    tracker = voodoo.Tracker(voodoo.Body.human(height=recording.start["height_m"]))
    tracker.reset(joints=recording.start["joints"])
    states = []
    for stamp, places in zip(reference.stamps, reference.positions, strict=True):
        frame, true = voodoo.Frame(stamp=float(stamp)), dict(zip(reference.names, places, strict=True))
        for pose in VIEW_FROM:
            rows = np.zeros((layout.count, 3))
            for site in sorted(alone.keys() & true.keys()):
                pixel = CAMERA.project((true[site] - pose[:3, 3])[None] @ pose[:3, :3])[0]
                rows[alone[site]] = [*(pixel + rng.normal(0.0, 3.0, 2)), 0.9]
            KeypointSensor("coco17", CAMERA, pose).add(frame, rows, predicted=dict(tracker.estimate.joints))
        states.append(str(tracker.step(frame).status))
    assert states == ["tracking"] * 90
