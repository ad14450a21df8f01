"""Run by test_live_peers.py in an environment with pyrealsense2: the maker's library with a device of software."""

import json
import time

import numpy as np
import pytest
from live_camera import CAMERA, SoftwareCamera, pictures

import voodoo
from voodoo.live import Follower, Live
from voodoo.live.session import Session
from voodoo.live.sources.realsense import RealSenseSource

pytest.importorskip("pyrealsense2", reason="it needs libusb of the system", exc_type=ImportError)


@pytest.fixture(scope="module")
def images():
    return pictures()


def follower(_frame):
    return Follower(voodoo.Tracker(voodoo.Body.human()))


def test_images_arrive_as_they_were_taken(images):
    camera = SoftwareCamera(30.0, images)
    with voodoo.live.open(RealSenseSource(device=camera.device)) as live:
        camera.send()
        frame = live.next(2.0)
        (item,) = frame.measurements
        assert np.array_equal(item.image, images[0])
        assert item.meters_per_unit == 0.001
        assert item.camera == CAMERA
        assert abs(time.time() - frame.stamp) < 0.5
        assert live.by_host_clock
        assert live.root_frame == "camera_depth_optical_frame"


@pytest.mark.parametrize("rate", [30, 90])
def test_a_person_is_tracked(images, rate):
    camera = SoftwareCamera(rate, images)
    with Live([RealSenseSource(device=camera.device, rate=rate)]) as live:
        session = Session(live, follower)
        with camera:
            session.wait(4.0)
        session.finish()
    report = session.report()
    print(json.dumps({key: report[key] for key in ("rate_hz", "latency_ms", "tracking_ms", "dropped")}))
    assert report["received"] == camera.sent
    assert report["published"] + report["dropped"] + report["refused"] == camera.sent
    assert report["with_pose"] > 0.8 * camera.sent
    assert report["latency_ms"]["p50"] < 10.0
    assert session.persons() == {1: "lost"} or session.live.status == "ended"


def test_a_calibration_reports_where_it_is(images, tmp_path):
    file = tmp_path / "place.toml"
    file.write_text(
        "width = 640\nheight = 480\nfx = 525.0\nfy = 525.0\ncx = 319.5\ncy = 239.5\nroot_frame = 'base_link'\n"
        "root_from_sensor = [[0, 0, 1, 0.1], [-1, 0, 0, 0], [0, -1, 0, 1.0], [0, 0, 0, 1]]\n"
    )
    camera = SoftwareCamera(30.0, images)
    with voodoo.live.open(RealSenseSource(device=camera.device, calibration=file)) as live:
        assert live.root_frame == "base_link"
        camera.send()
        pose = live.next(2.0).measurements[0].root_from_sensor
        assert pose[:3, 3].tolist() == [0.1, 0.0, 1.0]
        step = Follower(voodoo.Tracker(voodoo.Body.human())).step
        camera.send()
        camera.send()
        frame = live.next(2.0)
        step(frame)


def test_a_stalled_camera_publishes_nothing(images):
    camera = SoftwareCamera(30.0, images)
    message = []
    with Live([RealSenseSource(device=camera.device)], on_message=message.append) as live:
        session = Session(live, follower)
        with camera:
            session.wait(2.0)
        time.sleep(0.5)
        published = session.published
        assert session.persons() == {1: "lost"}
        assert live.status == "lost"
        time.sleep(0.5)
        assert session.published == published
        again = time.monotonic()
        while session.published == published and time.monotonic() < again + 1.0:
            camera.send()
            time.sleep(1 / 30)
        session.wait(0.1)
        assert session.published > published
        assert session.persons() == {1: "tracking"}
        session.finish()
    assert live.faults.counts == {"stalled": 1}
    assert any("data again" in line for line in message)


def test_no_camera_is_waited_for():
    message = []
    with voodoo.live.open(RealSenseSource(serial="000000000000"), on_message=message.append) as live:
        assert live.next(0.7) is None
        assert live.status == "waiting"
    assert any("expected the camera, found none" in line for line in message)
