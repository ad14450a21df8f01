"""Converts ROS messages (as deserialized by rosbags) to images, points, ranges and cameras."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from functools import partial
from typing import Any, Literal, TypeAlias, TypeVar

import numpy as np
import numpy.typing as npt

from voodoo.errors import CameraError, RecordingError, naming, reading
from voodoo.measurements import ByteImage, ColorImage, DepthImage, FloatArray, LaserScan, Measurement, PointCloud
from voodoo.model.camera import Camera
from voodoo.recordings.pictures import check_size, decode_color, decode_depth_png, decode_rvl

T = TypeVar("T")
Message: TypeAlias = Any
"""A message of rosbags; its class is generated from the definition in the bag."""

DEPTH_ENCODINGS: dict[str, np.dtype[Any]] = {
    "16UC1": np.dtype(np.uint16),
    "mono16": np.dtype(np.uint16),
    "32FC1": np.dtype(np.float32),
}
"""16-bit depth is in millimeters (REP-118), 32-bit float depth in meters."""
_NO_DEPTH = re.compile(
    r"infra|(^|[/_])n?ir(?![a-z])|disparity|confidence|amplitude|intensity|thermal|reflectiv|variance", re.I
)
"""Names of topics whose images have an encoding of depth but are something else."""
COLOR_CHANNELS = {"bgr8": 3, "rgb8": 3, "bgra8": 4, "rgba8": 4, "8UC3": 3, "8UC4": 4, "mono8": 1, "8UC1": 1}

NO_DISTANCES = (
    "expected depth as PNG or RVL, found JPEG, in which the distances are lost; record raw depth or compressedDepth"
)

# sensor_msgs/PointField: INT8, UINT8, INT16, UINT16, INT32, UINT32, FLOAT32, FLOAT64
_POINT_FIELDS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}


def stamp_of(message: Message, source: str) -> float:
    """Header stamp in seconds; double precision keeps about 0.2 microseconds of a Unix time's nanoseconds.

    Raises:
        RecordingError: the stamp is zero (a driver without a clock) or its nanoseconds are out of range.
    """
    stamp = message.header.stamp
    if stamp.sec <= 0 and stamp.nanosec == 0:
        raise RecordingError(f"{source}: expected a header stamp, found zero", reason="without a stamp")
    if not (0 <= stamp.nanosec < 1_000_000_000 and stamp.sec >= 0):
        found = f"{stamp.sec} s {stamp.nanosec} ns"
        raise RecordingError(f"{source}: expected a header stamp, found {found}", reason="without a stamp")
    return seconds(stamp)


def seconds(stamp: Any) -> float:  # noqa: ANN401 - rosbags has no class for it
    """A builtin_interfaces/Time in seconds."""
    return float(stamp.sec) + float(stamp.nanosec) * 1e-9


def frame_of(message: Message) -> str:
    """frame_id of the header, without the leading slash ROS 1 sometimes writes."""
    return str(message.header.frame_id).lstrip("/")


def base_topic(topic: str) -> str:
    """Name of an image topic without its image_transport suffix."""
    return topic.removesuffix("/compressedDepth").removesuffix("/compressed")


def is_depth(topic: str, message: Message) -> bool:
    """Whether an image or compressed image is depth, by its encoding or format; its topic only tells what is none."""
    if _NO_DEPTH.search(topic):
        return False
    if hasattr(message, "encoding"):
        return message.encoding in DEPTH_ENCODINGS
    gray = message.data[:26].tobytes()  # a PNG's first chunk has the bits of a value, and 0 for gray
    words = message.format.split(";")[0].strip()
    return "compressedDepth" in topic + message.format or words in DEPTH_ENCODINGS or gray[24:] == b"\x10\x00"


def channels_of(topic: str, message: Message) -> int:
    """Number of channels of an image or compressed image, for which it is the most there may be; 0: it is no picture."""
    if hasattr(message, "format"):
        return 0 if is_depth(topic, message) else max(COLOR_CHANNELS.values())
    return COLOR_CHANNELS.get(message.encoding, 0)


def has_distances(message: Message) -> bool:
    """Whether a compressed depth image is not a JPEG, whose values of 8 bits are no distances."""
    return message.data[:3].tobytes() != b"\xff\xd8\xff"


def camera_of(info: Message, topic: str, source: str) -> Camera:
    """Camera of a CameraInfo message, for the images on `topic`.

    For rectified images (image_rect and similar) P is used instead of K and D.

    Raises:
        RecordingError: uncalibrated, invalid numbers, or binning or a region of interest, which are not
            supported.
    """
    names = ("K", "D", "P") if hasattr(info, "K") else ("k", "d", "p")
    k, d, p = (getattr(info, name) for name in names)
    region = info.roi
    if info.binning_x > 1 or info.binning_y > 1 or region.x_offset or region.y_offset:
        raise RecordingError(
            f"{source}: expected the calibration of the full image, found binning {info.binning_x}x{info.binning_y} "
            f"and a region of interest at ({region.x_offset}, {region.y_offset})"
        )
    rectified = "rect" in base_topic(topic).rsplit("/", 1)[-1]
    with naming(source, CameraError, error=RecordingError):
        return Camera.from_camera_info(
            width=info.width, height=info.height, k=k, d=d, model=info.distortion_model, p=p, rectified=rectified
        )


def _encoded(message: Message, kind: str, encodings: Mapping[str, T], source: str) -> T:
    """What an image's encoding stands for."""
    if message.encoding not in encodings:
        expected = f"a {kind} encoding ({', '.join(encodings)})"
        raise RecordingError(f"{source}: expected {expected}, found {message.encoding!r}")
    return encodings[message.encoding]


def depth_image(message: Message, camera: Camera, source: str) -> npt.NDArray[Any]:
    """(H, W) uint16 or float32 of a raw sensor_msgs/Image.

    Raises:
        RecordingError: another encoding, fewer bytes than announced, or another size than the camera's.
    """
    dtype = _encoded(message, "depth", DEPTH_ENCODINGS, source)
    rows = _rows(message, dtype.itemsize, source)
    check_size((message.width, message.height), source, (camera.width, camera.height))
    order: Literal["<", ">"] = ">" if message.is_bigendian else "<"
    image: npt.NDArray[Any] = np.ascontiguousarray(rows).view(dtype.newbyteorder(order)).astype(dtype, copy=False)
    return image


def compressed_depth_image(message: Message, camera: Camera, source: str) -> npt.NDArray[Any]:
    """(H, W) uint16 or float32 of a sensor_msgs/CompressedImage written by compressed_depth_image_transport.

    The PNG, or columns, rows and RVL data, follow a header of 12 bytes (a format number and two floats A, B); 32FC1
    images are stored as quantized inverse depth q with depth = A / (q - B); q = 0 means no depth.

    Raises:
        RecordingError: damaged, or of another size than the camera's.
    """
    data = message.data.tobytes()
    if not has_distances(message):
        raise RecordingError(f"{source}: {NO_DISTANCES}", reason="of JPEG, which has no distances")
    header = b"" if data.startswith(b"\x89PNG") else data[:12]
    decode = decode_rvl if "rvl" in message.format.lower() else decode_depth_png
    image: npt.NDArray[Any] = decode(data[len(header) :], source, (camera.width, camera.height))
    if "32FC1" in message.format:
        if len(header) != 12:
            raise RecordingError(f"{source}: expected the 12-byte header of compressed depth, found none")
        a, b = (float(value) for value in np.frombuffer(header, "<f4", count=2, offset=4))
        if not (math.isfinite(a) and math.isfinite(b) and a > 0.0):
            raise RecordingError(f"{source}: expected quantization A > 0 and B, found {a!r} and {b!r}")
        steps = image.astype(np.float64) - b
        with np.errstate(divide="ignore"):
            image = np.where((image > 0) & (steps > 0.0), a / steps, np.nan).astype(np.float32)
    check_size((image.shape[1], image.shape[0]), source, (camera.width, camera.height))
    return image


def color_image(message: Message, camera: Camera, source: str) -> ByteImage:
    """(H, W, 3) BGR uint8 of a raw sensor_msgs/Image, or of a JPEG or PNG sensor_msgs/CompressedImage.

    Raises:
        RecordingError: it cannot be decoded, or has another encoding or size.
    """
    with reading(source, "a readable picture"):
        if hasattr(message, "format"):
            return decode_color(message.data.tobytes(), source, (camera.width, camera.height))
        channels = _encoded(message, "color", COLOR_CHANNELS, source)
        check_size((message.width, message.height), source, (camera.width, camera.height))
        image = _rows(message, channels, source).reshape(message.height, message.width, channels)
        if channels == 1:
            return np.repeat(image, 3, axis=2)
        return np.ascontiguousarray(image[:, :, 2::-1] if message.encoding.startswith("rgb") else image[:, :, :3])


def cloud_points(message: Message, source: str) -> FloatArray:
    """(N, 3) of a sensor_msgs/PointCloud2 with any field layout; rows that are not finite are dropped.

    Raises:
        RecordingError: no x, y, z, an unknown field type, or inconsistent sizes.
    """
    fields = {field.name: (field.datatype, field.offset) for field in message.fields if field.name in ("x", "y", "z")}
    height, width, step = int(message.height), int(message.width), int(message.point_step)
    order = ">" if message.is_bigendian else "<"
    try:
        formats = [order + _POINT_FIELDS[fields[name][0]] for name in "xyz"]
        offsets = [fields[name][1] for name in "xyz"]
        layout = np.dtype({"names": list("xyz"), "formats": formats, "offsets": offsets, "itemsize": step})
    except (KeyError, ValueError, OverflowError):
        expected = f"fields x, y, z of datatype 1 to 8, none of which leaves the point of {step} bytes"
        raise RecordingError(f"{source}: expected {expected}, found {fields} as (datatype, offset)") from None
    if height * width == 0:
        return np.empty((0, 3))
    row_step = int(message.row_step) or width * step
    if row_step < width * step or len(message.data) < row_step * (height - 1) + width * step:
        raise RecordingError(
            f"{source}: expected {height} rows of {width} points of {step} bytes, found {len(message.data)} bytes "
            f"in rows of {row_step}"
        )
    view = np.ndarray((height, width), layout, buffer=message.data.tobytes(), strides=(row_step, step))
    points = np.stack([view[name].astype(np.float64).ravel() for name in "xyz"], axis=1)
    kept: FloatArray = points[np.isfinite(points).all(axis=1)]
    return kept


def scan_fields(message: Message, source: str) -> dict[str, Any]:
    """Ranges and geometry of a sensor_msgs/LaserScan, as keyword arguments of LaserScan.

    Raises:
        RecordingError: angles or limits that are not finite, or a zero increment.
    """
    names = ("angle_min", "angle_increment", "range_min", "range_max")
    numbers = {name: float(getattr(message, name)) for name in names}
    finite = all(math.isfinite(value) for name, value in numbers.items() if name != "range_max")
    if not finite or math.isnan(numbers["range_max"]) or numbers["angle_increment"] == 0.0:
        raise RecordingError(f"{source}: expected finite angles and limits and an increment, found {numbers}")
    if abs(numbers["angle_increment"]) * max(len(message.ranges) - 1, 0) > 2.0 * math.pi + 0.1:
        raise RecordingError(
            f"{source}: expected one turn at most, found {len(message.ranges)} rays by {numbers['angle_increment']} rad"
        )
    return {"ranges": message.ranges.astype(np.float32), **numbers}


def depth_units(meters_per_unit: float | None) -> tuple[float, float]:
    """Meters of a unit of 16-bit depth, and of float depth; None: those of REP-118."""
    return (0.001, 1.0) if meters_per_unit is None else (meters_per_unit, meters_per_unit)


def measured(
    kind: str,
    message: Message,
    source: str,
    about: tuple[str, float],
    pose: FloatArray,
    camera: Camera | None,
    units: tuple[float, float],
) -> Measurement:
    """The measurement in a message.

    Args:
        kind: "scan", "points", "depth" or "color".
        message: of that kind.
        source: named in errors.
        about: its topic and stamp [s].
        pose: root_from_sensor (4, 4).
        camera: of an image.
        units: meters of a unit of 16-bit depth, and of float depth.

    Raises:
        RecordingError: the message cannot be used, or is an image without a camera.
    """
    if kind == "scan":
        return LaserScan(*about, **scan_fields(message, source), root_from_sensor=pose)
    if kind == "points":
        return PointCloud(*about, cloud_points(message, source), pose)
    if camera is None:
        raise RecordingError(f"{source}: expected a calibrated camera, found none")
    if kind == "color":
        return ColorImage(*about, partial(color_image, message, camera, source), camera, pose)
    image = (compressed_depth_image if hasattr(message, "format") else depth_image)(message, camera, source)
    return DepthImage(*about, image, units[image.dtype.kind == "f"], camera, pose)


def _rows(message: Message, pixel_bytes: int, source: str) -> ByteImage:
    """(H, W * pixel_bytes) bytes without the padding at the end of the rows."""
    height, width, step = int(message.height), int(message.width), int(message.step)
    expected = width * pixel_bytes
    if height < 1 or width < 1 or step < expected or len(message.data) < step * (height - 1) + expected:
        raise RecordingError(
            f"{source}: expected {height} rows of {expected} bytes for {width}x{height} {message.encoding}, "
            f"found {len(message.data)} bytes in rows of {step}"
        )
    return np.lib.stride_tricks.as_strided(message.data, (height, expected), (step, 1))
