"""A sensor is one adapter: front end, overlay and viewer know no types."""

import ast
from copy import copy
from pathlib import Path

import numpy as np
import pytest

import voodoo
from commands import load_script
from core_fakes import CAMERA, FakeRecording
from voodoo.errors import MeasurementError
from voodoo.measurements import (
    ColorImage,
    DepthImage,
    KeypointImage,
    LaserScan,
    MarkerSet,
    PointCloud,
    RecordedFrame,
)
from voodoo.names import INPUTS
from voodoo.pipeline.front_end import FrontEnd, FrontEndSettings
from voodoo.sensors import adapters
from voodoo.sensors.adapters import Memory, adapter_of, adapters_of
from voodoo.sensors.settings import KNOWN
from voodoo.visualization.overlay import Overlay

EXAMPLES = Path(__file__).resolve().parent.parent / "examples"


PACKAGE = Path(voodoo.__file__).parent


@pytest.fixture
def uwb():
    """The example of a new sensor, registered for one test."""
    module = load_script(EXAMPLES / "uwb_tag.py")
    yield module
    adapters.unregister("uwb")


def test_a_new_sensor_in_one_file_tracks_a_body(uwb):
    assert tuple(KNOWN) == (*INPUTS, "uwb") and KNOWN["uwb"] == "uwb"
    assert FrontEndSettings().use == tuple(kind for kind in KNOWN if kind not in ("color", "skin"))
    assert uwb.main(frames=40) < 0.06, "no worse than the tags' own noise (mean length 8 cm)"


def test_a_new_sensor_is_drawn_and_reported_when_it_freezes(uwb):
    chain = voodoo.ik.Chain(voodoo.Body.human(model="full"))
    tracker = voodoo.Tracker(chain.body)
    tracker.reset_pose(uwb.truth(chain, 0.0)[0])
    front_end = FrontEnd(tracker)
    frames = [frame for frame, _ in uwb.recorded(chain, 3)]
    estimate = front_end.step(frames[0])
    recording = FakeRecording(frames=3, depth=False)
    with_tags = Overlay(recording).draw(frames[0], tracker.body, estimate, index=0, front_end=front_end)
    without = Overlay(recording).draw(RecordedFrame(0.0, ()), tracker.body, estimate, index=0, front_end=front_end)
    assert (with_tags == (40, 200, 255)).all(axis=2).sum() > 100 and not np.array_equal(with_tags, without)
    first, *others = frames[1].measurements
    repeated = uwb.UwbTag(first.sensor, first.stamp, first.site, frames[0].measurements[0].position, first.sigma)
    front_end.step(RecordedFrame(frames[1].stamp, (repeated, *others)))
    assert front_end.frozen == (first.sensor,)


def test_what_has_no_adapter_is_refused():
    tracker = voodoo.Tracker(voodoo.Body.human())
    tracker.reset(joints={"l_shoulder": (0, 0.2, 1.4), "r_shoulder": (0, -0.2, 1.4), "l_hip": (0, 0.1, 0.9)})
    front_end = FrontEnd(tracker)
    with pytest.raises(MeasurementError, match=r"expected one of DepthImage, .*MarkerSet, found int"):
        front_end.step(RecordedFrame(0.0, (3,)))
    with pytest.raises(MeasurementError, match=r"use: expected some of depth, .*, found uwb"):
        FrontEndSettings(use=("uwb",))


def test_one_adapter_for_a_kind():
    items = (
        DepthImage("d", 0.0, np.zeros((3, 4), np.uint16), 0.001, CAMERA, np.eye(4)),
        PointCloud("p", 0.0, np.zeros((1, 3)), np.eye(4)),
        LaserScan("s", 0.0, np.ones(3, np.float32), 0.0, 0.1, 0.1, 9.0, np.eye(4)),
        KeypointImage("k", 0.0, (), "coco17", CAMERA, np.eye(4)),
        ColorImage("c", 0.0, lambda: np.zeros((3, 4, 3), np.uint8), CAMERA, np.eye(4)),
        MarkerSet("m", 0.0, {}),
    )
    assert tuple(adapter.kind for item in items for adapter in adapters_of(item)) == INPUTS == tuple(KNOWN)
    recorded = ("depth", "points", "scan", "keypoints", "color", "markers")
    assert set(KNOWN.values()) == set(recorded)
    assert KNOWN["skin"] == KNOWN["color"] == "color" and adapter_of(items[4]).kind == "skin"
    known = adapter_of(MarkerSet("m", 0.0, {}))
    with pytest.raises(MeasurementError, match="expected a new kind, found 'markers' for MarkerSet"):
        adapters.register(known)


def test_memory_is_copied_thing_by_thing():
    memory = Memory()
    memory.get("list", "a", list).append(1)

    twin = copy(memory)
    twin.get("list", "a", list).append(2)
    assert (memory.all("list"), twin.all("list")) == ({"a": [1]}, {"a": [1, 2]})


@pytest.mark.parametrize(
    "path", ["pipeline/front_end.py", "pipeline/frozen.py", "visualization/overlay.py", "visualization/rerun_viewer.py"]
)
def test_who_knows_adapters_knows_no_types(path):
    tree = ast.parse((PACKAGE / path).read_text(encoding="utf-8"))
    names = {alias.name for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) for alias in node.names}
    assert not names & {"DepthImage", "ColorImage", "KeypointImage", "LaserScan", "PointCloud", "MarkerSet"}
