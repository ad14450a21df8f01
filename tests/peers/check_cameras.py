"""Run by test_live_peers.py in an environment with depthai and pyorbbecsdk2: the makers' libraries, without cameras.

Of depthai its messages and queues are real, device and pipeline made up; a .bag is played by Orbbec's library.
"""

import sys
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from live_camera import CAMERA, pictures
from orbbec_bag import Stream, write

sys.path.insert(0, str(Path(__file__).parents[1]))

import voodoo
from camera_fakes import fake_depthai, fake_orbbec
from voodoo.live import Faults, Follower, Live, SourceGone
from voodoo.live.clock import HostClock
from voodoo.live.session import Session
from voodoo.live.sources.orbbec import OrbbecSource
from voodoo.live.sources.words import source_of

K = (400.0, 401.0, 320.0, 200.0)


def check_names(fake, real, path):
    """Whether everything public in classes of the fake is in the library."""
    for name, value in vars(fake).items():
        if name.startswith("_") or name in ("sent", "made"):
            continue
        assert hasattr(real, name), f"{path}.{name}"
        if isinstance(value, SimpleNamespace) or isinstance(value, type):
            check_names(value, getattr(real, name), f"{path}.{name}")


def test_the_fake_of_depthai_has_its_names():
    dai = pytest.importorskip("depthai")
    fake = fake_depthai()
    for attribute in ("size", "k", "model"):  # of instances
        assert not hasattr(fake.ImgTransformation, attribute)
    fake.node.StereoDepth.depth = fake.node.StereoDepth.initialConfig = None
    check_names(fake, dai, "depthai")
    assert hasattr(dai.StereoDepthConfig(), "setDepthUnit")
    for function, words in (
        (dai.node.StereoDepth.build, ("autoCreateCameras", "size", "fps")),
        (dai.node.Camera.requestOutput, ("size", "type", "fps")),
        (dai.Node.Output.createOutputQueue, ("maxSize", "blocking")),
        (dai.ImgTransformation.getExtrinsicsTransformationMatrixTo, ("to", "useSpecTranslation", "sourceUnit")),
    ):
        assert all(f"{word}: " in function.__doc__ for word in words), function.__doc__


def test_oak_with_messages_of_the_library(monkeypatch):
    dai = pytest.importorskip("depthai")
    fake = fake_depthai(types=dai)
    monkeypatch.setitem(sys.modules, "depthai", fake)
    source, clock = source_of("oak"), HostClock()
    source.open(clock, Faults())

    def message(image, kind, x_cm, model, coefficients):
        place = dai.Extrinsics(np.eye(3).tolist(), dai.Point3f(x_cm, 0, 0), dai.CameraBoardSocket.CAM_A)
        k = [[K[0], 0, K[2]], [0, K[1], K[3]], [0, 0, 1]]
        frame = dai.ImgFrame()
        frame.setCvFrame(image, kind)
        frame.setTimestamp(dai.Clock.now())
        return frame.setTransformation(dai.ImgTransformation(640, 400, k, model, coefficients, place))

    depth = np.full((400, 640), 1500, np.uint16)
    bgr = np.random.default_rng(0).integers(0, 255, (400, 640, 3)).astype(np.uint8)
    models, types = dai.CameraModel, dai.ImgFrame.Type
    lens = [n / 128 for n in range(1, 15)]
    for stream, frame in (
        ("depth", message(depth, types.RAW16, 7.5, models.Perspective, [])),
        ("color", message(bgr, types.BGR888i, 2.0, models.Perspective, lens)),
        ("color", message(bgr, types.BGR888i, 2.0, models.Fisheye, lens[:4])),
    ):
        queue = dai.MessageQueue(stream, 1, False)
        queue.addCallback(fake.sent[stream])
        queue.send(frame)
    first, second, third = source.read(1.0)
    assert (first.measure().image == 1500).all() and first.measure().camera == voodoo.Camera(640, 400, *K)
    assert abs(first.stamp - clock.now()) < 0.5
    assert (second.measure().image == bgr).all()
    assert second.measure().camera == voodoo.Camera(640, 400, *K, tuple(lens), "rational_polynomial")
    assert third.measure().camera == voodoo.Camera(640, 400, *K, tuple(lens[:4]), "equidistant")
    assert np.allclose(second.measure().root_from_sensor[:3, 3], (-0.055, 0.0, 0.0), atol=1e-6)


def test_no_oak_is_waited_for():
    dai = pytest.importorskip("depthai")
    assert dai.Device.getAllAvailableDevices() == [] or pytest.skip("there is a camera")
    with pytest.raises(SourceGone, match="oak: expected the camera, found none"):
        source_of("oak").open(HostClock(), Faults())


def test_the_fake_of_orbbec_has_its_names():
    ob = pytest.importorskip("pyorbbecsdk")
    check_names(fake_orbbec({}), ob, "pyorbbecsdk")
    for kind, names in (
        (
            ob.VideoStreamProfile,
            "get_width get_height get_fps get_format get_intrinsic get_distortion get_extrinsic_to",
        ),
        (ob.StreamProfile, "as_video_stream_profile"),
        (ob.StreamProfileList, "get_count get_stream_profile_by_index"),
        (ob.SensorList, "get_count get_type_by_index"),
        (ob.DepthFrame, "get_data get_depth_scale get_timestamp_us get_global_timestamp_us"),
        (ob.FrameSet, "get_depth_frame get_color_frame"),
        (ob.DeviceInfo, "get_name get_serial_number"),
        (ob.OBCameraIntrinsic, "fx fy cx cy width height"),
        (ob.OBCameraDistortion, "k1 k2 k3 k4 k5 k6 p1 p2 model"),
        (ob.OBExtrinsic, "rot transform"),
    ):
        assert all(hasattr(kind, name) for name in names.split()), kind
    lenses = {"NONE", "BROWN_CONRADY", "BROWN_CONRADY_K6", "KANNALA_BRANDT4"}
    assert lenses <= set(ob.OBCameraDistortionModel.__members__)


@pytest.mark.parametrize("encoding", ["rgb8", "mjpg"])
def test_orbbecs_library_plays_a_person(encoding, tmp_path, monkeypatch, capfd):
    pytest.importorskip("pyorbbecsdk")
    monkeypatch.chdir(tmp_path)
    images, size = pictures(30), (CAMERA.width, CAMERA.height)
    d, pixel = (0.01, -0.02, 0.003, 0.0, 0.0, 0.0, 0.001, -0.002), np.uint8((200, 90, 10))
    rgb = np.full((*size[::-1], 3), pixel)
    coded = rgb.tobytes() if encoding == "rgb8" else cv2.imencode(".jpg", rgb[:, :, ::-1])[1].tobytes()
    k = (CAMERA.fx, CAMERA.fy, CAMERA.cx, CAMERA.cy)
    depth = Stream(size, "mono16", [image.tobytes() for image in images], k, (0.0,) * 8, 3)
    color = Stream(size, encoding, [coded] * 30, k, d, 4)
    write(tmp_path / "take.bag", depth, color, (-32.0, 1.0, 2.0))
    source = OrbbecSource(serial=str(tmp_path / "take.bag"))
    with Live([source]) as live:
        session = Session(live, lambda _: Follower(voodoo.Tracker(voodoo.Body.human())))
        session.wait(10.0)
        session.finish()
    report = session.report()
    assert report["received"] == 30 and report["with_pose"] > 15, report
    assert live.faults.counts == {}
    assert [path.name for path in tmp_path.iterdir()] == ["take.bag"]
    assert capfd.readouterr().out == ""

    with Live([OrbbecSource(serial=str(tmp_path / "take.bag"))]) as live:
        frame = next(frame for frame in live if len(frame.measurements) == 2)
    picture, item = frame.measurements
    assert item.image.shape == size[::-1] and item.camera == CAMERA and item.meters_per_unit == 0.001
    assert any(np.array_equal(item.image, image) for image in images)
    kept = [picture.camera.distortion, (d[0], d[1], d[6], d[7], *d[2:6])]
    assert picture.camera.model == "rational_polynomial" and np.allclose(*kept, atol=1e-6)
    assert np.abs(picture.image.astype(int) - pixel[::-1]).max() < 8
    assert np.allclose(picture.root_from_sensor[:3, 3], (0.032, -0.001, -0.002), atol=1e-6)
    assert 5.0 <= frame.stamp < 6.0 and frame.stamp == pytest.approx(
        5.0 + round(30 * (frame.stamp - 5.0)) / 30, abs=2e-6
    )


def test_no_orbbec_is_waited_for():
    pytest.importorskip("pyorbbecsdk")
    with pytest.raises(SourceGone, match="orbbec: expected the camera, found none"):
        source_of("orbbec").open(HostClock(), Faults())
    with pytest.raises(SourceGone, match=r"nothing\.bag: Error opening file"):
        source_of("orbbec:nothing.bag").open(HostClock(), Faults())
