"""Detectors of one's own: functions, networks in ONNX files, none, and what they may get wrong."""

import importlib.util
import os
import struct
import warnings
from pathlib import Path

import numpy as np
import pytest

import voodoo
from commands import load_script, refused
from commands import run as command
from test_people import WORLD_FROM_SENSOR, frame
from voodoo._core import person_candidates
from voodoo.detectors import JOINTS, LENGTHS, CallableDetector, DetectedPerson, DetectorImage, OnnxDetector
from voodoo.errors import ConfigError, MeasurementError
from voodoo.pipeline.start import stature
from voodoo.recordings import sample_path
from voodoo.synthetic.render import render_depth

EXAMPLES = Path(__file__).resolve().parent.parent / "examples"


FIVE = ("humanoid_root", "l_shoulder", "r_shoulder", "l_ankle", "r_ankle")
STANDING = {
    "humanoid_root": (2.4, 0.0, 0.95), "vc7": (2.4, 0.0, 1.48), "l_shoulder": (2.4, -0.18, 1.42),
    "r_shoulder": (2.4, 0.18, 1.42), "l_hip": (2.4, -0.1, 0.92), "r_hip": (2.4, 0.1, 0.92),
}  # fmt: skip
BODY = voodoo.Body.human(1.75)
NETWORK = Path(os.environ.get("VOODOO_DATA", "../shared/data")).resolve().parent / "prototypes" / "start.onnx"
needs_onnxruntime = pytest.mark.skipif(
    importlib.util.find_spec("onnxruntime") is None, reason="onnxruntime is not installed"
)


@pytest.fixture(scope="module")
def someone():
    tracker = voodoo.Tracker(BODY)
    return tracker.body, tracker.reset(joints=STANDING, fit_sizes=False)


def seeing(estimate, joints=FIVE, **others):
    """A detector that sees somebody at the joints of an estimate, wherever the image shows something nearer than the wall."""

    def detect(image):
        near = (image.depth > 0.0) & (image.depth < 4.0)
        if near.sum() > 100:
            found = {name: estimate.joints[name] for name in joints if name in estimate.joints}
            yield DetectedPerson(found, confidence=0.999, **others)

    return CallableDetector(detect, joints=joints)


def bits(estimate):
    return estimate.joint_positions.tobytes(), estimate.status, dict(estimate.limb_status)


def run(detector, someone, frames=6, start=False):
    tracker = voodoo.Tracker(BODY, detector=detector)
    if start:
        tracker.reset(joints=STANDING, fit_sizes=False)
    found = []
    for index in range(frames):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", voodoo.DetectorWarning)
            found.append(tracker.step(frame(index / 15.0, someone)))
    return tracker, found


def test_a_function_that_sees_five_joints_starts_a_tracker_from_nothing(someone):
    asked = []
    inner = seeing(someone[1], (*FIVE, "nose"))
    detector = CallableDetector(lambda image: asked.append(image) or inner.detect(image), joints=inner.joints)
    tracker, found = run(detector, someone)
    assert tracker.can_search and tracker.detector is detector and found[-1].status == "tracking"
    for name in FIVE:
        assert np.linalg.norm(found[-1].joints[name] - someone[1].joints[name]) < 0.08, name
    first = asked[0]
    assert isinstance(first, DetectorImage) and (first.query, first.near) == ("all", None)
    assert first.depth.dtype == np.float32 and first.depth.shape == (120, 160) and first.camera.fx == 120.0
    assert np.array_equal(first.world_from_sensor, WORLD_FROM_SENSOR)
    world = first.to_world(first.points())[first.depth > 4.0]
    assert np.allclose(world[:, 0], 4.5, atol=1e-6), "the wall"
    later = [image for image in asked if image.query == "near"]
    assert later and np.linalg.norm(later[0].near - STANDING["humanoid_root"]) < 0.3


def test_the_shipped_network_may_be_wrapped_and_named(someone):
    """Its detections have the attributes of `DetectedPerson`."""
    shipped = voodoo.Detector()

    def detect(image):
        displayed = voodoo.Frame(0.0)
        displayed.add_depth(
            image.depth, camera=image.camera, meters_per_unit=1.0, world_from_sensor=image.world_from_sensor
        )
        return shipped.detect(displayed)

    tracker, found = run(CallableDetector(detect, joints=JOINTS, lengths=LENGTHS), someone)
    assert tracker.detector_failures == 0 and found[-1].status in ("tracking", "degraded")
    assert [bits(each) for each in run("shipped", someone)[1]] == [bits(each) for each in run(shipped, someone)[1]]


def test_lengths_follow_a_stature_that_is_known(someone):
    def known(height):
        return voodoo.Detector(stature=height)

    statures = [known(height).detect(frame(0.0, someone))[0].stature for height in (1.5, 1.9)]
    assert np.allclose(statures, (1.5, 1.9), rtol=0.05)
    alone = stature(run("shipped", someone)[0].body)
    for height in (1.6, 1.7, 1.9):
        drawn = (stature(run(known(height), someone)[0].body) - alone) / (height - alone)
        assert 0.33 < drawn < 1.0, "a stature is a measurement beside those of the limbs"
    for wrong in ({"stature": 17.0}, {"stature": float("nan")}, {"stature": 1.7, "stature_sigma": 0.0}):
        with pytest.raises(ConfigError, match=r"stature: expected meters from 0\.3 to 3\.0"):
            voodoo.Detector(**wrong)
    for factor in (0.0, -1.0, float("nan")):
        with pytest.raises(MeasurementError, match="enlarged: expected a finite factor above 0"):
            person_candidates(
                np.zeros((2, 3), np.float32), camera=voodoo.Camera(3, 2, 1.0, 1.0, 1.0, 1.0), enlarged=factor
            )


def test_without_a_detector_nobody_is_searched_for(someone):
    tracker = voodoo.Tracker(BODY, detector=None)
    assert not tracker.can_search
    with pytest.raises(MeasurementError):
        tracker.step(frame(0.0, someone))
    tracker.reset(joints=STANDING, fit_sizes=False)
    assert tracker.step(frame(0.0, someone)).status == "tracking"
    people = voodoo.People(BODY, detector=None)
    assert not people.step(frame(0.0, someone)).persons
    assert people.add(STANDING, fit_sizes=False) == 1
    assert len(people.step(frame(0.1, someone))) == 1
    two = CallableDetector(lambda image: [], joints=("l_hip", "r_hip", "nose"))
    assert not voodoo.Tracker(BODY, detector=two).can_search, "two joints fix no pose"


def broken(image):
    raise ValueError("no eyes")


def test_a_detector_that_raises_warns_and_the_step_goes_on_without_it(someone):
    failing = CallableDetector(broken, joints=FIVE)
    tracker = voodoo.Tracker(BODY, detector=failing)
    with pytest.warns(voodoo.DetectorWarning, match="went on without it: ValueError: no eyes"):
        estimate = tracker.step(frame(0.0, someone))
    assert (estimate.status, tracker.detector_failures) == ("searching", 1)
    silent = CallableDetector(lambda image: [], joints=FIVE)
    assert [bits(each) for each in run(failing, someone, start=True)[1]] == [
        bits(each) for each in run(silent, someone, start=True)[1]
    ]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(voodoo.DetectorWarning) as raised:
            tracker.step(frame(0.1, someone))
    assert isinstance(raised.value.__cause__, ValueError)
    people = voodoo.People(BODY, detector=failing)
    with pytest.warns(voodoo.DetectorWarning, match="no eyes"):
        people.step(frame(0.0, someone))
    assert people.detector_failures == 1


def test_ctrl_c_in_a_detector_is_not_swallowed(someone):
    def interrupted(image):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        voodoo.Tracker(BODY, detector=CallableDetector(interrupted, joints=FIVE)).step(frame(0.0, someone))


@pytest.mark.parametrize(
    ("found", "words"),
    [
        ([3], "has no attribute 'joints'"),
        (3, "not iterable"),
        ([DetectedPerson({"tail": (0, 0, 1)}, 0.9)], 'expected some of .*, found "tail"'),
        ([DetectedPerson({"l_shoulder": (0, 1)}, 0.9)], r"joints\[l_shoulder\]"),
        ([DetectedPerson({"l_shoulder": (0, 1, np.nan)}, 0.9)], r"joints\[1\]: expected finite meters"),
        ([DetectedPerson({}, 2.0)], "confidence: expected a probability"),
        ([DetectedPerson({}, 0.9, facing="yes")], "facing: expected a probability"),
        ([DetectedPerson({"l_shoulder": (0, 1, 0)}, 0.9, joint_sigma=-1.0)], "sigma: expected finite meters > 0"),
        ([DetectedPerson({"l_shoulder": (0, 1, 0)}, 0.9, visible=2.0)], "visible: expected 0 to 1, found 2"),
        (
            [DetectedPerson({"l_shoulder": (0, 1, 0)}, 0.9, mask=np.ones((3, 3), bool))],
            "mask: expected an array of shape",
        ),
        ([DetectedPerson({}, 0.9, lengths={"thigh": 0.4})], "lengths"),
        ([DetectedPerson(None, 0.9)], "joints: expected a mapping from names, found None"),
        ([DetectedPerson(7, 0.9)], "joints: expected a mapping from names"),
        ([DetectedPerson({}, 0.9, floor=3)], "floor: expected a unit normal"),
        ([DetectedPerson({}, 0.9, floor=((0, 0, 2), 1.0))], r"floor\[0\]: expected a unit normal"),
    ],
)
def test_what_cannot_be_meant_is_named_and_changes_nothing(someone, found, words):
    detector = CallableDetector(lambda image: found, joints=FIVE, lengths=("thigh",))
    tracker = voodoo.Tracker(BODY, detector=detector)
    with pytest.warns(voodoo.DetectorWarning, match=words):
        assert tracker.step(frame(0.0, someone)).status == "searching"


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: voodoo.Tracker(BODY, detector=3), 'detector: expected "shipped", None, .*, found 3'),
        (lambda: voodoo.Tracker(BODY, detector="best"), "found 'best'"),
        (lambda: voodoo.People(BODY, detector=3), "found 3"),
        (lambda: CallableDetector(3, joints=FIVE), "function: expected something that can be called, found int"),
        (lambda: CallableDetector(broken, joints="l_hip"), "joints: expected a sequence of names"),
        (lambda: CallableDetector(broken, joints=("l_hip", "l_hip")), "found 'l_hip' twice"),
    ],
)
def test_what_is_no_detector_is_refused(make, words):
    with pytest.raises(ConfigError, match=words):
        make()


def test_persons_on_several_threads_ask_one_function_and_get_the_same(someone):
    """A worker takes the GIL that the step has released."""

    def followed(threads):
        people = voodoo.People(BODY, config=voodoo.Config(threads=threads), detector=seeing(someone[1]))
        return [[bits(each.estimate) for each in people.step(frame(i / 15.0, someone))] for i in range(8)]

    alone = followed(1)
    assert alone[-1] and alone == followed(2)


def field(number, value):
    """A field of a protocol buffer: whole numbers, bytes and text."""
    if isinstance(value, int):
        return varint(number << 3) + varint(value)
    value = value.encode() if isinstance(value, str) else value
    return varint(number << 3 | 2) + varint(len(value)) + value


def varint(value):
    out = b""
    while value > 127:
        out, value = out + bytes([value & 127 | 128]), value >> 7
    return out + bytes([value])


def constant_network(path, **outputs):
    """An ONNX file that says the same of every picture: name -> array."""

    def shaped(name, shape):
        dims = b"".join(field(1, field(1, size)) for size in shape)
        return field(1, name) + field(2, field(1, field(1, 1) + field(2, dims)))

    graph = b""
    for name, values in outputs.items():
        values = np.asarray(values, dtype="<f4")
        tensor = b"".join(field(1, size) for size in values.shape) + field(2, 1) + field(9, values.tobytes())
        graph += field(
            1, field(2, name) + field(4, "Constant") + field(5, field(1, "value") + field(5, tensor) + field(20, 4))
        )
    graph += field(2, "constant") + field(11, shaped("x", (1, 2, 96, 96)))
    graph += b"".join(field(12, shaped(name, np.shape(values))) for name, values in outputs.items())
    path.write_bytes(field(1, 8) + field(8, field(2, 13)) + field(7, graph))
    return path


def test_the_writer_of_networks_writes_floats():
    assert field(9, struct.pack("<f", 1.0)) == b"\x4a\x04\x00\x00\x80\x3f" and varint(300) == b"\xac\x02"


@needs_onnxruntime
def test_an_onnx_file_of_other_joints_reports_where_they_are(tmp_path, someone):
    root = np.array(STANDING["humanoid_root"])
    places = np.array([[0.0, 0.1, 0.1], [-0.18, -0.35, 0.1], [0.18, -0.35, 0.1], [-0.1, 0.9, 0.1], [0.1, 0.9, 0.1]])
    path = constant_network(tmp_path / "five.onnx", p=places[None], vis=[[4.0] * 5 + [5.0, 6.0]])
    detector = OnnxDetector(path, joints=FIVE, most=1)
    tracker, _ = run(detector, someone, frames=2)
    assert tracker.detector_failures == 0 and tracker.estimate.joints
    assert np.linalg.norm(tracker.estimate.joints["humanoid_root"] - root) < 0.25
    for outputs, words in (
        ({"p": places[None], "vis": [[4.0] * 5]}, "expected outputs of shape .* for 5 joints"),
        ({"q": places[None], "vis": [[4.0] * 7]}, "the outputs p, vis, found 1 and q, vis"),
    ):
        with pytest.raises(ConfigError, match=words):
            OnnxDetector(constant_network(tmp_path / "wrong.onnx", **outputs), joints=FIVE)
    (tmp_path / "no.onnx").write_bytes(b"nothing")
    with pytest.raises(ConfigError, match=r"no\.onnx: expected an ONNX file"):
        OnnxDetector(tmp_path / "no.onnx")
    refused(command("track", sample_path(), "--detector", tmp_path / "no.onnx"), "no.onnx: expected an ONNX file")


@needs_onnxruntime
@pytest.mark.skipif(not NETWORK.exists(), reason=f"{NETWORK} is missing")
def test_a_trained_onnx_file_sees_what_the_shipped_network_sees(someone):
    tracker, _ = run(OnnxDetector(NETWORK), someone)
    assert tracker.detector_failures == 0 and tracker.estimate.status in ("tracking", "degraded")
    for name in ("humanoid_root", "l_shoulder", "r_hip"):
        assert np.linalg.norm(tracker.estimate.joints[name] - someone[1].joints[name]) < 0.15, name


def test_the_example_finds_the_bundled_person():
    errors = load_script(EXAMPLES / "custom_detector.py").main()
    assert errors < 0.12


def test_a_person_at_the_lower_border_is_found_in_images_of_any_size():
    near = {name: (x - 0.9, y, z) for name, (x, y, z) in STANDING.items()}
    poses = voodoo.Tracker(BODY).reset(joints=near, fit_sizes=False).world_from_limb
    for width, height in ((319, 241), (320, 241), (401, 263)):
        camera = voodoo.Camera(width, height, 0.8 * width, 0.8 * width, width / 2.0, height / 2.0)
        depth = render_depth(BODY, poses, camera=camera, world_from_sensor=WORLD_FROM_SENSOR).depth
        assert (depth[-1] > 0.0).any(), "the border cuts the body"
        image = np.where(depth > 0.0, depth, 4.5).astype(np.float32)
        observed = voodoo.Frame(0.0)
        observed.add_depth(image, camera=camera, meters_per_unit=1.0, world_from_sensor=WORLD_FROM_SENSOR)
        with warnings.catch_warnings():
            warnings.simplefilter("error", voodoo.DetectorWarning)
            assert voodoo.Tracker(BODY).step(observed).status != "searching", (width, height)
