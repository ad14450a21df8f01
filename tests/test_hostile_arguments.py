"""Arguments of the wrong kind or beyond the world: an error of our own that names them, at once, and nothing else."""

from pathlib import Path

import numpy as np
import pytest

import voodoo
from scene import standing_joints
from voodoo import ik
from voodoo.batch.storage import find_sources
from voodoo.errors import BodyError, CameraError, ConfigError, MeasurementError, RecordingError, VoodooError
from voodoo.export.track import Track
from voodoo.model.camera import MOST_PIXELS
from voodoo.pipeline.start import Init
from voodoo.recordings import open_recording

BODY = voodoo.Body.human()
FAR = standing_joints(BODY) | {"l_wrist": (1e300, 0.0, 0.0)}


@pytest.mark.parametrize(
    ("call", "error", "words"),
    [
        (lambda: voodoo.Body.load(None), BodyError, "path: expected a file or folder, found NoneType"),
        (lambda: voodoo.Config.load(None), ConfigError, "path: expected a file or folder, found NoneType"),
        (lambda: Track.load(None), VoodooError, "path: expected a file or folder, found NoneType"),
        (lambda: voodoo.Body.human(height="x"), BodyError, "height: expected a stature in meters, found 'x'"),
        (lambda: voodoo.Body.human(height=None), BodyError, "height: expected a stature in meters, found None"),
        (lambda: voodoo.Body.human(height=10**400), BodyError, "height: expected a stature in meters, found 1000"),
        (lambda: voodoo.Body.human(model=3), BodyError, "'3'|3"),
        (lambda: BODY.scaled("x"), BodyError, "factor: expected a number, found 'x'"),
        (lambda: ik.Options(bones=0), MeasurementError, "bones: expected a list of .site, site, radius., found 0"),
        (lambda: ik.Chain(BODY, limbs=None), MeasurementError, "limbs: expected a list of names, found None"),
        (lambda: ik.Chain(BODY, limbs=[3]), MeasurementError, "limbs: expected a list of names"),
        (lambda: ik.Chain(None), BodyError, "body: expected a voodoo.Body, found NoneType"),
        (lambda: voodoo.Frame(stamp="x"), MeasurementError, "stamp: expected a number, found 'x'"),
        (lambda: frame().add_position("vc7", (0, 0, 1), weight="x"), MeasurementError, "weight: expected a number"),
        (lambda: frame().add_position(3, (0, 0, 1)), MeasurementError, "site: expected a name, found 3"),
        (lambda: frame().set_ground(normal=(0, 0, 1), offset=None), MeasurementError, "offset: expected a number"),
        (lambda: frame().add_points(np.zeros((1, 3)), weight=[]), MeasurementError, "weight: expected a number"),
        (lambda: voodoo.TaperedEllipticCylinder("x", 1, 1, 1, 1), BodyError, "length: expected meters, found 'x'"),
        (lambda: voodoo.Tracker(BODY).step(None), MeasurementError, "frame: expected a voodoo.Frame, found NoneType"),
        (lambda: voodoo.Tracker(BODY).scale("x"), BodyError, "factor: expected a number, found 'x'"),
        (lambda: voodoo.Tracker(BODY).set_shape("head", 2), BodyError, "shape: expected a voodoo.TaperedElliptic"),
        (lambda: voodoo.Tracker(BODY).remove_limb(None), BodyError, "name: expected a name, found NoneType"),
        (
            lambda: voodoo.Tracker(BODY).add_limb("box", parent="head", shape=None, joint=None),
            BodyError,
            "shape: expected a voodoo.TaperedEllipticCylinder, found NoneType",
        ),
        (
            lambda: voodoo.Tracker(BODY).reset(joints=FAR),
            MeasurementError,
            r"joints\[l_wrist\]: expected finite meters, 1e9 at most",
        ),
        (lambda: open_recording("a\0b"), RecordingError, "path: expected a file or folder, found a name with a NUL"),
        (lambda: open_recording("~nobody-of-that-name/x"), RecordingError, "found the home of an unknown user"),
        (lambda: voodoo.Body.load("a\0b"), BodyError, "found a name with a NUL"),
        (lambda: Init.load(Path("a\0b")), VoodooError, "found a name with a NUL"),
        (lambda: find_sources(["~nobody-of-that-name/x"]), VoodooError, "found the home of an unknown user"),
    ],
)
def test_arguments_are_refused_by_name(call, error, words):
    with pytest.raises(error, match=words):
        call()


def frame():
    return voodoo.Frame(stamp=0.0)


def test_what_is_far_beyond_the_world_is_refused_without_a_trace():
    tracker = voodoo.Tracker(BODY)
    before = tracker.reset(joints=standing_joints(BODY)).joint_positions.copy()
    for make in (
        lambda f: f.add_position("vc7", (1e300, 0, 0)),
        lambda f: f.add_ray("vc7", origin=(1e12, 0, 0), direction=(1, 0, 0)),
        lambda f: f.add_points(np.full((3, 3), 1e10)),
        lambda f: f.add_points(np.full((3, 3), 1e30, np.float32)),
        lambda f: f.add_points(np.zeros((3, 3)), world_from_sensor=np.eye(4) + np.eye(4, k=3) * 1e200),
    ):
        wrong = voodoo.Frame(stamp=1.0)
        make(wrong)
        with pytest.raises(MeasurementError):
            tracker.step(wrong)
    np.testing.assert_array_equal(tracker.estimate.joint_positions, before)


@pytest.mark.parametrize(
    "size", [(100_000, 100_000), (2**31 - 1, 1), (2**31 - 1, 2**31 - 1), (10**400, 1), (8192, 4097)]
)
def test_cameras_have_a_greatest_size(size):
    with pytest.raises(CameraError, match=r"camera (size|width): expected .*\b1 to 33554432\b.*, found "):
        voodoo.Camera(*size, 500.0, 500.0, 0.0, 0.0)
    assert voodoo.Camera(8192, 4096, 500.0, 500.0, 0.0, 0.0).width * 4096 == MOST_PIXELS


def test_rays_of_a_lens_are_those_of_its_pixels():
    bent = voodoo.Camera(150, 101, 90.0, 90.0, 74.5, 49.5, (0.1, -0.05, 0.0, 0.0))
    u, v = np.meshgrid(np.arange(150.0), np.arange(101.0))
    expected = bent.undistorted(np.stack([u, v], axis=-1).reshape(-1, 2)).reshape(101, 150, 2)
    np.testing.assert_array_equal(bent.rays(), expected.astype(np.float32))
