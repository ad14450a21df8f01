"""OAK and Orbbec cameras as live sources, on libraries that are made up: lens, unit, stamps, pose, and what goes wrong."""

import sys

import cv2
import numpy as np
import pytest

import voodoo
from camera_fakes import fake_depthai, fake_orbbec, orbbec_frame, orbbec_profile
from live_rig import HandClock
from voodoo.errors import VoodooError
from voodoo.live import Faults, SourceEnded, SourceGone
from voodoo.live.sources.camera import camera_of
from voodoo.live.sources.words import source_of

K = (400.0, 401.0, 320.0, 200.0)
FULL = tuple(n / 100 for n in range(1, 15))


def opened(monkeypatch, word, module, name, **options):
    monkeypatch.setitem(sys.modules, name, module)
    source, clock = source_of(word, **options), HandClock()
    source.open(clock, Faults())
    return source, clock


def oak(monkeypatch, word="oak", **made):
    dai = fake_depthai(**made)
    return dai, *opened(monkeypatch, word, dai, "depthai")


# Lenses


@pytest.mark.parametrize(
    ("lens", "given", "model", "kept"),
    [
        ("BROWN_CONRADY", FULL[:8], "plumb_bob", FULL[:5]),
        ("MODIFIED_BROWN_CONRADY", FULL[:5], "plumb_bob", FULL[:5]),
        ("INVERSE_BROWN_CONRADY", FULL[:5], "inverse_plumb_bob", FULL[:5]),
        ("BROWN_CONRADY_K6", FULL[:8], "rational_polynomial", FULL[:8]),
        ("Perspective", FULL, "rational_polynomial", FULL),
        ("Perspective", FULL[:5], "rational_polynomial", (*FULL[:5], *[0.0] * 9)),
        ("KANNALA_BRANDT4", FULL[:4], "equidistant", FULL[:4]),
        ("Fisheye", FULL[:4], "equidistant", FULL[:4]),
        ("Fisheye", [0.0] * 4, "plumb_bob", ()),
        ("NONE", [0.0] * 8, "plumb_bob", ()),
    ],
)
def test_a_lens_is_that_of_the_library(lens, given, model, kept):
    assert camera_of("oak", lens, (640, 400), K, given) == voodoo.Camera(640, 400, *K, kept, model)


def test_an_unknown_lens_is_refused():
    with pytest.raises(VoodooError, match=r"oak: expected a lens of brown_conrady, .*, found radialdivision"):
        camera_of("oak", "RadialDivision", (640, 400), K, (0.1,))


def test_the_order_of_orbbec_is_not_opencvs(monkeypatch):
    """Its distortion is k1 ... k6, p1, p2; what is asked for is the pixel where a point is seen."""
    k1, k2, k3, k4, k5, k6, p1, p2 = d = (0.1, -0.05, 0.02, 0.03, -0.02, 0.01, 0.004, -0.003)
    depth = orbbec_profile((640, 576), 30, "Y16", K, "BROWN_CONRADY_K6", d)
    x, y = 0.3, -0.2
    expected = cv2.projectPoints(
        np.array([[x, y, 1.0]]), np.zeros(3), np.zeros(3), np.array([[K[0], 0, K[2]], [0, K[1], K[3]], [0, 0, 1]]),
        np.array([k1, k2, p1, p2, k3, k4, k5, k6]),
    )[0].ravel()  # fmt: skip
    source, _ = orbbec(monkeypatch, depth=depth)[1:]
    assert np.allclose(source._camera(depth).project([[x, y, 1.0]]), expected, atol=1e-6)


# OAK


def test_oak_depth_and_color(monkeypatch):
    dai, source, clock = oak(monkeypatch)
    assert dai.sent["size"] == ((640, 400), 30) and dai.sent["unit"] is dai.LengthUnit.MILLIMETER
    depth = dai.ImgTransformation((4, 2), K, "Perspective", (), x_m=0.075)
    color = dai.ImgTransformation((4, 2), K, "Perspective", FULL, x_m=0.02)
    bgr = np.arange(24, dtype=np.uint8).reshape(2, 4, 3)
    dai.sent["color"](dai.ImgFrame(bgr, 51.0, color))  # it has no pose before the first depth image
    dai.sent["depth"](dai.ImgFrame(np.full((2, 4), 1500, np.uint16), 51.0, depth))
    dai.sent["color"](dai.ImgFrame(bgr, 51.01, color))
    first, second = source.read(0.0)
    item, picture = first.measure(), second.measure()
    assert (first.sensor, first.kind, first.drives) == ("oak/depth", "depth", True)
    assert (item.image * item.meters_per_unit == 1.5).all() and item.camera == voodoo.Camera(4, 2, *K)
    assert first.stamp == pytest.approx(clock.now() + 1.0, abs=1e-6)  # the library's clock was at 50 s
    assert (second.sensor, second.kind, second.drives) == ("oak/color", "color", False)
    assert picture.camera == voodoo.Camera(4, 2, *K, FULL, "rational_polynomial")
    assert (picture.image == bgr).all()
    assert np.allclose(picture.root_from_sensor[:3, 3], (-0.055, 0.0, 0.0))
    assert source.about() == {"name": "oak", "kind": "oak", "camera": "OAK-D"}


def test_oak_without_color(monkeypatch):
    dai, _, _ = oak(monkeypatch, color=False)
    assert "color" not in dai.sent


def test_oak_without_stereo(monkeypatch):
    with pytest.raises(VoodooError, match="oak: expected a camera with a stereo pair, found none"):
        oak(monkeypatch, pairs=False)


def test_oak_is_lost_and_found(monkeypatch):
    dai, source, clock = oak(monkeypatch)
    assert source.read(0.0) == []
    dai.made[0].closed = True
    with pytest.raises(SourceGone, match="it was unplugged"):
        source.read(0.0)
    source.close()
    source.open(clock, Faults())
    clock.at += 6.0
    with pytest.raises(SourceGone, match=r"no image for 6\.0 s"):
        source.read(0.0)


@pytest.mark.parametrize(("word", "index"), [("oak", 0), ("oak:2222", 1), ("oak:10.0.0.1", 1)])
def test_oak_by_id_or_address(monkeypatch, word, index):
    dai, _, _ = oak(monkeypatch, word, serials=("1111", "2222"))
    assert dai.made[0].info.deviceId == ("1111", "2222")[index]


def test_oak_that_is_busy_or_not_there(monkeypatch):
    with pytest.raises(SourceGone, match=r"oak:3: expected the camera, found 1111, 10\.0\.0\.0"):
        oak(monkeypatch, "oak:3", serials=("1111",))
    with pytest.raises(SourceGone, match="oak: expected the camera, found none"):
        oak(monkeypatch, serials=())
    dai = fake_depthai()

    def busy(info):
        raise RuntimeError("X_LINK_DEVICE_ALREADY_IN_USE")

    dai.Device.__init__ = lambda self, info: busy(info)
    with pytest.raises(SourceGone, match="oak: X_LINK_DEVICE_ALREADY_IN_USE"):
        opened(monkeypatch, "oak", dai, "depthai")


def test_an_image_of_another_size_is_an_error_of_the_source(monkeypatch):
    dai, source, _ = oak(monkeypatch)
    depth = dai.ImgTransformation((4, 3), K, "Perspective", ())
    dai.sent["depth"](dai.ImgFrame(np.full((2, 4), 1500, np.uint16), 51.0, depth))
    with pytest.raises(VoodooError, match="oak: an image that cannot be used"):
        source.read(0.0)


# Orbbec


def orbbec(monkeypatch, word="orbbec", *, depth=None, color=None, options=None, **made):
    """The module, the source and the clock."""
    profiles = {"DEPTH_SENSOR": [depth]} if color is None else {"DEPTH_SENSOR": [depth], "COLOR_SENSOR": color}
    ob = fake_orbbec(profiles, **made)
    return ob, *opened(monkeypatch, word, ob, "pyorbbecsdk", **(options or {}))


DEPTH = ((4, 2), 30, "Y16")


def test_orbbec_depth_and_color(monkeypatch):
    color = [orbbec_profile((4, 2), 30, "RGB", x_mm=32.0), orbbec_profile((1920, 1080), 30, "RGB")]
    ob, source, _ = orbbec(monkeypatch, depth=orbbec_profile(*DEPTH, k=K), color=color[::-1])
    assert [profile.get_width() for profile in ob.sent["streams"]] == [4, 4]
    image, rgb = np.full((2, 4), 6000, np.uint16), np.arange(24, dtype=np.uint8).reshape(2, 4, 3)
    ob.sent["frames"](depth=orbbec_frame(image, 7_000_123, scale=0.25), color=orbbec_frame(rgb, 7_000_100))
    second, first = source.read(0.0)
    item, picture = first.measure(), second.measure()
    assert (first.sensor, first.stamp, first.drives) == ("orbbec/depth", 7.000123, True)
    assert item.meters_per_unit == 0.00025 and (item.image == 6000).all() and item.camera == voodoo.Camera(4, 2, *K)
    assert (second.sensor, second.stamp, second.drives) == ("orbbec/color", 7.0001, False)
    assert (picture.image == rgb[:, :, ::-1]).all()
    assert np.allclose(picture.root_from_sensor[:3, 3], (0.032, 0.0, 0.0))
    source.close()  # though stopping fails, as of a camera that was unplugged


def test_orbbec_color_as_jpeg(monkeypatch):
    color = [orbbec_profile((64, 48), 30, "MJPG"), orbbec_profile((64, 48), 30, "YUYV")]
    ob, source, _ = orbbec(monkeypatch, depth=orbbec_profile(*DEPTH), color=color)
    coded = cv2.imencode(".jpg", np.full((48, 64, 3), (10, 90, 200), np.uint8))[1].tobytes()
    ob.sent["frames"](color=orbbec_frame(coded, 1_000_000))
    (arrival,) = source.read(0.0)
    assert np.abs(arrival.measure().image.astype(int) - (10, 90, 200)).max() < 6


def test_orbbec_stamps_by_the_hosts_clock(monkeypatch):
    ob, source, _ = orbbec(monkeypatch, depth=orbbec_profile(*DEPTH), related=True)
    assert ob.sent["related"] is True
    image = np.full((2, 4), 6000, np.uint16)
    ob.sent["frames"](depth=orbbec_frame(image, 7_000_000))  # not related yet
    ob.sent["frames"](depth=orbbec_frame(image, 7_033_000, global_us=1_700_000_000_033_000))
    assert [arrival.stamp for arrival in source.read(0.0)] == [1_700_000_000.033]


def test_orbbec_is_lost(monkeypatch):
    ob, source, clock = orbbec(monkeypatch, depth=orbbec_profile(*DEPTH), serials=("A", "B"))
    assert ob.sent["serial"] == "A"
    ob.sent["there"] = ["A"]
    assert source.read(0.0) == []
    ob.sent["there"] = ["B"]
    with pytest.raises(SourceGone, match="it was unplugged"):
        source.read(0.0)
    source.close()
    ob.sent["there"] = ["B", "A"]
    source.open(clock, Faults())
    assert source.read(0.0) == [] and ob.sent["serial"] == "B"


def test_orbbec_that_is_not_there_or_has_no_depth(monkeypatch):
    with pytest.raises(SourceGone, match="orbbec:C: expected the camera, found A, B"):
        orbbec(monkeypatch, "orbbec:C", depth=orbbec_profile(*DEPTH), serials=("A", "B"))
    with pytest.raises(SourceGone, match="orbbec: expected the camera, found none"):
        orbbec(monkeypatch, depth=orbbec_profile(*DEPTH), serials=())
    with pytest.raises(VoodooError, match="orbbec: expected a stream of 16-bit depth, found none"):
        orbbec(monkeypatch, depth=orbbec_profile((4, 2), 30, "YUYV"))


def test_a_recording_of_orbbec_ends(monkeypatch):
    ob, source, _ = orbbec(monkeypatch, "orbbec:take.bag", depth=orbbec_profile(*DEPTH))
    assert ob.sent["serial"] == "take.bag" and not source.stays
    ob.sent["frames"](depth=orbbec_frame(np.full((2, 4), 6000, np.uint16), 7_000_000))
    source._device._status = ob.OBPlaybackStatus.STOPPED
    assert len(source.read(0.0)) == 1
    with pytest.raises(SourceEnded, match="at its end"):
        source.read(0.0)


def test_a_calibration_says_where_a_camera_is(monkeypatch, tmp_path):
    file = tmp_path / "place.toml"
    file.write_text(
        "width = 4\nheight = 2\nfx = 5.0\nfy = 5.0\ncx = 2.0\ncy = 1.0\nroot_frame = 'base_link'\n"
        "root_from_sensor = [[0, 0, 1, 0.1], [-1, 0, 0, 0], [0, -1, 0, 1.0], [0, 0, 0, 1]]\n"
    )
    ob, source, _ = orbbec(monkeypatch, depth=orbbec_profile(*DEPTH, k=K), options={"calibration": file})
    ob.sent["frames"](depth=orbbec_frame(np.full((2, 4), 6000, np.uint16), 7_000_000))
    (arrival,) = source.read(0.0)
    assert source.root_frame == "base_link" and source.placed
    assert arrival.measure().root_from_sensor[:3, 3].tolist() == [0.1, 0.0, 1.0]
    assert arrival.measure().camera.fx == K[0]
