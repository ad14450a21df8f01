"""What cannot be meant is refused by name, with what was expected and what was found."""

from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from pydantic_core.core_schema import ErrorType

import voodoo
from voodoo.errors import BodyError, ConfigError, MeasurementError, RecordingError, VoodooError
from voodoo.export.people import PeopleTrack
from voodoo.export.track import Track
from voodoo.model.joint import expectation
from voodoo.pipeline.inputs import join
from voodoo.pipeline.start import Init, start_tracker
from voodoo.recordings import ColorImage, open_recording, sample_path
from voodoo.recordings.marker_files import MarkerMap
from voodoo.recordings.marker_trajectories import read_trc
from voodoo.recordings.pose2sim import Pose2SimRecording
from voodoo.recordings.truth import read_positions
from voodoo.sensors.depth import DepthFilter
from voodoo.sensors.gating import SiteGate
from voodoo.sensors.keypoints import KeypointSensor
from voodoo.sensors.settings import FrontEndSettings
from voodoo.sensors.skin.tracker import SkinTracker

CAMERA = voodoo.Camera(32, 24, 30.0, 30.0, 15.5, 11.5)
HERE = np.eye(4)
NAN = float("nan")


def depth(image, camera=CAMERA):
    voodoo.Frame(stamp=0.0).add_depth(image, camera=camera, meters_per_unit=0.001, world_from_sensor=HERE)


def sensor(**changes):
    return KeypointSensor(**({"layout": "coco17", "camera": CAMERA, "world_from_sensor": HERE} | changes))


def skin(image, camera=CAMERA):
    SkinTracker().observe(ColorImage("rgb", 0.0, lambda: image, camera, HERE), {})


@pytest.mark.parametrize(
    ("call", "error", "words"),
    [
        (
            lambda: depth(np.zeros((24, 33), np.uint16)),
            MeasurementError,
            "image: expected 24 rows of 32 pixels, as its camera has, found shape [24, 33]",
        ),
        (lambda: depth(np.zeros((24, 32), np.uint16), None), MeasurementError, "camera: expected a Camera"),
        (lambda: voodoo.Tracker(None), BodyError, "body: expected a voodoo.Body, found NoneType"),
        (
            lambda: voodoo.Tracker(voodoo.Body.human(height=1.7), config={}),
            ConfigError,
            "config: expected a voodoo.Config, found dict",
        ),
        (lambda: voodoo.Joint(name="grip", weight="x"), BodyError, "Joint: weight: expected a number, found"),
        (lambda: voodoo.Joint(weight=2.0), BodyError, "Joint: name: expected an entry, found none"),
        (
            lambda: voodoo.Joint(name="grip", on_parent={"position": (0.0, NAN, 0.0)}),
            BodyError,
            "Joint: on_parent.position.1: expected a finite number, found nan",
        ),
        (lambda: voodoo.Place(rotation="x"), BodyError, "Place: rotation: expected a list of numbers, found 'x'"),
        (lambda: voodoo.Body.from_toml(None), BodyError, "body: expected TOML text, found NoneType"),
        (
            lambda: voodoo.render_depth(voodoo.Body.human(height=1.7), [HERE], camera=CAMERA),
            BodyError,
            "world_from_limb: expected a mapping of limbs to poses, found list",
        ),
        (lambda: open_recording(None), RecordingError, "path: expected a file or folder, found NoneType"),
        (lambda: sensor(layout="coco"), MeasurementError, "layout 'coco': expected one of coco17"),
        (
            lambda: sensor(camera=None),
            MeasurementError,
            "camera: expected a voodoo.Camera, found",
        ),
        *(
            (
                lambda pose=pose: sensor(world_from_sensor=pose),
                MeasurementError,
                f"world_from_sensor: expected a rigid 4x4 transform, found {pose!r}",
            )
            for pose in (np.eye(3), np.full((4, 4), NAN), np.diag([1.0, 1.0, 1.0, 2.0]), "here")
        ),
        (lambda: sensor(min_confidence=NAN), MeasurementError, "min_confidence: expected a finite number, found nan"),
        (
            lambda: sensor(min_confidence="0.3"),
            MeasurementError,
            "min_confidence: expected a finite number, found '0.3'",
        ),
        (
            lambda: FrontEndSettings(min_confidence=NAN),
            MeasurementError,
            "min_confidence: expected a finite number, found nan",
        ),
        *(
            (
                lambda pose=pose: voodoo.ik.Silhouette(np.ones((24, 32)), camera=CAMERA, world_from_camera=pose),
                MeasurementError,
                f"world_from_camera: expected a rigid 4x4 transform, found {pose!r}",
            )
            for pose in (np.diag([2.0, 2.0, 2.0, 1.0]), np.diag([1.0, 1.0, -1.0, 1.0]), np.diag([1.0, 1.0, 1.0, 2.0]))
        ),
        (lambda: sensor(sites=("l_wirst",)), MeasurementError, "sites: expected some of l_shoulder"),
        (
            lambda: sensor().observe("seen", stamp=0.0, predicted={}),
            MeasurementError,
            "keypoints: expected numbers (u, v, confidence), found 'seen'",
        ),
        (
            lambda: SiteGate(radius=0.5),
            MeasurementError,
            "gate: expected 0 < radius <= widest and growth >= 0, found radius",
        ),
        (lambda: skin([[1]]), MeasurementError, "image: expected an array (H, W, 3) of uint8, found list"),
        (lambda: skin(np.zeros((24, 32, 3), np.uint8), None), MeasurementError, "camera: expected a voodoo.Camera"),
        (lambda: DepthFilter().apply([[1, 2]]), MeasurementError, "depth: expected an array (H, W), found list"),
        (
            lambda: DepthFilter().apply(np.zeros((2, 2), np.uint16), meters_per_unit=NAN),
            MeasurementError,
            "meters_per_unit: expected a finite length > 0, found nan",
        ),
        (
            lambda: voodoo.Tracker(voodoo.Body.human()).reset(joints=[(0.0, 0.0, 0.0)]),
            BodyError,
            "joints: expected a mapping of names to positions, found list",
        ),
        *(
            (
                lambda option=option: open_recording(sample_path(), **option),
                RecordingError,
                f"{next(iter(option))}: expected {words}, found {next(iter(option.values()))!r}",
            )
            for option, words in (
                ({"tf_max_age": "1"}, "seconds >= 0"),
                ({"tf_max_age": None}, "seconds >= 0"),
                ({"meters_per_unit": "0.001"}, "a length > 0"),
                ({"meters_per_unit": NAN}, "a length > 0"),
            )
        ),
        *(
            (lambda rate=rate: Pose2SimRecording(Path("x"), rate=rate), RecordingError, f"x: rate: {words}{rate!r}")
            for rate in ("30", 0.0, None)
            for words in ("expected images per second > 0, found ",)
        ),
        (lambda: read_trc("nowhere.trc"), RecordingError, "nowhere.trc: expected a .trc file, found no such file"),
    ],
)
def test_a_wrong_argument(call, error, words):
    with pytest.raises(error) as caught:
        call()
    assert words in str(caught.value)


@pytest.fixture(scope="module")
def recording():
    return open_recording(sample_path())


def test_a_layout_nobody_knows_and_an_offset_that_is_none(recording):
    """Also where nothing is joined that would use them."""
    with pytest.raises(VoodooError, match="layout 'coco': expected one of coco17"):
        join(recording, layout="coco")
    with pytest.raises(VoodooError, match="offset: expected a finite number of seconds, found nan"):
        join(recording, offset=NAN)


def test_inputs_that_the_recording_has_not(recording):
    with pytest.raises(MeasurementError, match=r"\(color, depth, scan, skin\), found markers, keypoints"):
        FrontEndSettings.of(recording, use=("markers", "keypoints"))
    assert FrontEndSettings.of(recording, use=("markers", "scan")).use == ("markers", "scan")
    assert FrontEndSettings.of(recording).ground_z == 0.0


def test_a_marker_that_stands_for_no_site(recording):
    with pytest.raises(VoodooError, match=r"marker LWRA: expected one of the sites .*l_wrist.*, found 'l_wirst'"):
        start_tracker(recording, markers=MarkerMap(sites={"LWRA": "l_wirst"}))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('{"joints": {}}', "joints: expected at least 1 entries, found {}"),
        ('{"height_m": 1.7}', "joints: expected an entry, found none"),
        ('{"joints": 3}', "joints: expected a table of names, found 3"),
        ('{"joints": {"l_knee": [1, 2]}}', "joints.l_knee.2: expected an entry, found none"),
        ('{"joints": {"l_knee": [1, 2, 3, 4]}}', "joints.l_knee: expected at most 3 entries"),
        ('{"joints": {"l_knee": [1, 2, "x"]}}', "joints.l_knee.2: expected a number, found 'x'"),
        ('{"height_m": 176, "joints": {"l_knee": [1, 2, 3]}}', "height_m: expected a number below 3, found 176"),
        ('{"heigth_m": 1.7, "joints": {"l_knee": [1, 2, 3]}}', "heigth_m: expected a known key, found 1.7"),
        ("{", "expected JSON, found EOF"),
    ],
)
def test_refusals_of_files_are_sentences_of_our_own(text, words, tmp_path):
    (tmp_path / "start.json").write_text(text)
    with pytest.raises(VoodooError) as refused:
        Init.load(tmp_path / "start.json")
    assert words in str(refused.value) and "should" not in str(refused.value)


def test_no_kind_of_pydantics_errors_is_passed_on():
    """Also those that no file causes today: an unknown kind is still expected and found."""
    for kind in get_args(ErrorType):
        context = dict.fromkeys(("gt", "ge", "lt", "le", "min_length", "max_length", "expected", "error"), 1)
        said = expectation({"type": kind, "ctx": context, "input": "x", "msg": "Input should be 7"})
        assert "Input" not in said and (kind == "value_error" or said.startswith("expected "))


@pytest.mark.parametrize(
    "read",
    [Track.load, PeopleTrack.load, lambda path: read_positions(path, ("stamp_s",))],
    ids=["track", "people", "truth"],
)
def test_a_header_is_not_dumped(read, tmp_path):
    (tmp_path / "a.csv").write_text("time," + ",".join(f"{'column' * 8}{number}" for number in range(50)) + "\n1,2\n")
    with pytest.raises(VoodooError, match=r"expected columns .*stamp_s.*, found time, column") as refused:
        read(tmp_path / "a.csv")
    assert len(str(refused.value).removeprefix(str(tmp_path))) < 180 and "['" not in str(refused.value)
