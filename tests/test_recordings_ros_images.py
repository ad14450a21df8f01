"""Depth and color images of ROS bags, in every encoding and layout the readers claim."""

import struct

import cv2
import numpy as np
import pytest

from ros_bags import DEPTH, INFO, TF, M, bag, compressed_depth, depth_entry, only
from voodoo.errors import RecordingError
from voodoo.recordings import ColorImage, open_recording
from voodoo.recordings.pictures import decode_depth_png


@pytest.mark.parametrize("big", [False, True])
@pytest.mark.parametrize("padding", [0, 6])
@pytest.mark.parametrize("encoding", ["16UC1", "mono16", "32FC1"])
def test_raw_depth_in_any_layout(tmp_path, encoding, padding, big):
    data = DEPTH if encoding != "32FC1" else np.where(DEPTH > 0, DEPTH / 1000, np.nan).astype(np.float32)
    recording = open_recording(
        bag(tmp_path, TF, INFO, depth_entry(data=data, encoding=encoding, padding=padding, big=big))
    )
    (image,) = only(recording)
    np.testing.assert_array_equal(image.image, data)
    assert image.image.dtype == data.dtype and image.image.dtype.isnative
    assert image.meters_per_unit == (1.0 if encoding == "32FC1" else 0.001)


def test_meters_per_unit_can_be_reported(tmp_path):
    (image,) = only(open_recording(bag(tmp_path, TF, INFO, depth_entry()), meters_per_unit=0.00025))
    assert image.meters_per_unit == 0.00025


@pytest.mark.parametrize("header", [b"\0" * 12, b""])
def test_compressed_depth(tmp_path, header):
    (image,) = only(open_recording(bag(tmp_path, TF, INFO, compressed_depth(DEPTH, header=header))))
    np.testing.assert_array_equal(image.image, DEPTH)


def test_compressed_float_depth_is_quantized_inverse_depth(tmp_path):
    """compressed_depth_image_transport: q = A / depth + B."""
    a, b = 1000.0, 50.0
    depth = np.array([[1.0, 2.0, 4.0, 0.5]] * 3)
    quantized = np.round(a / depth + b).astype(np.uint16)
    quantized[0, 0] = 0
    header = struct.pack("<iff", 0, a, b)
    entry = compressed_depth(quantized, "32FC1; compressedDepth png", header)
    (image,) = only(open_recording(bag(tmp_path, TF, INFO, entry)))
    assert np.isnan(image.image[0, 0]) and image.meters_per_unit == 1.0 and image.image.dtype == np.float32
    np.testing.assert_allclose(image.image[1:], depth[1:], rtol=1e-3)


def test_the_raw_depth_is_preferred_to_its_compressed_copy(tmp_path):
    recording = open_recording(bag(tmp_path, TF, INFO, depth_entry(), compressed_depth(DEPTH)))
    assert recording.info().sensors[0].name == "/d/depth/image"


PNG = cv2.imencode(".png", np.random.default_rng(1).integers(0, 9000, (3, 4)).astype(np.uint16))[1].tobytes()


def changed(position):
    data = bytearray(PNG)
    data[position] ^= 0x55
    return bytes(data)


@pytest.mark.parametrize("cut", range(0, len(PNG), 3))
def test_a_cut_png_is_refused(cut):
    with pytest.raises(RecordingError, match=r"^image: expected"):
        decode_depth_png(PNG[:cut], "image", (4, 3))


@pytest.mark.parametrize("position", range(0, len(PNG), 2))
def test_a_changed_png_is_refused(position):
    with pytest.raises(RecordingError, match=r"^image: expected"):
        decode_depth_png(changed(position), "image", (4, 3))


@pytest.mark.parametrize("png", [PNG[:60], changed(60)], ids=["cut", "changed"])
def test_a_damaged_png_of_a_bag_is_refused_by_its_topic_and_stamp(tmp_path, png):
    entry = ("/d/depth/image/compressedDepth", 10.0, M.compressed(10.0, b"\0" * 12 + png, "16UC1; compressedDepth"))
    with pytest.raises(RecordingError, match=r"compressedDepth, stamp 10\.0+: expected"):
        list(open_recording(bag(tmp_path, TF, INFO, entry)))


@pytest.mark.parametrize("encoding", ["rgb8", "bgr8", "bgra8", "rgba8"])
def test_raw_color_becomes_bgr(tmp_path, encoding):
    blue, green, red = 10, 20, 30
    pixel = [red, green, blue, 255] if encoding.startswith("rgb") else [blue, green, red, 255]
    data = np.tile(np.array(pixel[: 4 if "a" in encoding else 3], np.uint8), (3, 4, 1))
    entries = [
        TF,
        ("/c/camera_info", 10.0, M.camera_info(10.0)),
        ("/c/image", 10.0, M.image(10.0, data, encoding, padding=1)),
    ]
    (image,) = only(open_recording(bag(tmp_path, *entries)), ColorImage)
    np.testing.assert_array_equal(image.image, np.tile(np.array([10, 20, 30], np.uint8), (3, 4, 1)))


def test_color_without_calibration_is_left_out_and_reported_so(tmp_path):
    jpeg = cv2.imencode(".jpg", np.zeros((3, 4, 3), np.uint8))[1].tobytes()
    path = bag(tmp_path, TF, INFO, ("/c/image/compressed", 10.0, M.compressed(10.0, jpeg, "jpeg")), depth_entry())
    assert "calibration of /c/image/compressed" in str(open_recording(path).info())
    with pytest.raises(RecordingError, match="calibration of /c/image/compressed"):
        open_recording(path, color_topic="/c/image/compressed")
