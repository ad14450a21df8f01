"""Writes a .bag as Orbbec's recorder does (SDK 2.4 and later), of which there is none without a camera.

Messages are those of its source: src/media/ros/RosbagWriter.cpp and 3rdparty/rosbag/src/msgs of OrbbecSDK_v2.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rosbags.rosbag1 import Writer

_DEFINITION = (
    "std_msgs/Header header\n" + "=" * 80 + "\nMSG: std_msgs/Header\nuint32 seq\ntime stamp\nstring frame_id\n"
)
_PLACEHOLDER = "0123456789abcdef0123456789abcdef"
"""What the recorder has in place of some checksums."""
FORMATS = {"mono16": 8, "rgb8": 22, "mjpg": 5}


@dataclass(frozen=True)
class Stream:
    """Images (H, W) or coded, and their lens: model as a number of OBCameraDistortionModel, d as k1 ... k6, p1, p2."""

    size: tuple[int, int]
    encoding: str
    images: Sequence[bytes]
    k: Sequence[float]
    d: Sequence[float]
    model: int


def _text(text: str) -> bytes:
    return struct.pack("<I", len(text)) + text.encode()


def _header(us: int) -> bytes:
    return struct.pack("<III", 0, us // 1_000_000, us % 1_000_000 * 1000) + _text("")


def _blob(data: bytes) -> bytes:
    return struct.pack("<I", len(data)) + data


def _profile(us: int, kind: int, stream: Stream, fps: int, color_from_depth_mm: Sequence[float]) -> bytes:
    numbers = (*np.eye(3).ravel(), *color_from_depth_mm)
    return (
        _header(us) + struct.pack("<BB12f", kind, FORMATS[stream.encoding], *numbers)
        + struct.pack("<HHH4f8fB", *stream.size, fps, *stream.k, *stream.d, stream.model)
    )  # fmt: skip


def _image(us: int, stream: Stream, number: int) -> bytes:
    width, height = stream.size
    return (
        _header(us) + struct.pack("<II", height, width) + _text(stream.encoding) + struct.pack("<BI", 0, 2 * width)
        + _blob(stream.images[number]) + struct.pack("<fQQQQ", 0.0, number, us, us + 5, 0)
        + _blob(b"") + struct.pack("<IB", 0, 16)
    )  # fmt: skip


def write(path: Path, depth: Stream, color: Stream, color_from_depth_mm: Sequence[float], fps: int = 30) -> None:
    """A recording of a Femto Bolt that begins at 5 s of its clock, color a microsecond after depth."""
    begin = 5_000_000
    with Writer(path) as writer:

        def add(topic: str, kind: str, checksum: str, us: int, data: bytes) -> None:
            found = [one for one in writer.connections if one.topic == topic]
            connection = found[0] if found else writer.add_connection(topic, kind, msgdef=_DEFINITION, md5sum=checksum)
            writer.write(connection, us * 1000, data)

        for number in range(len(depth.images)):
            for kind, stream in ((3, depth), (2, color)):
                us = begin + round(number * 1e6 / fps) + (kind == 2)
                topic = f"/cam/sensor_{kind}/frameType_{kind}"
                checksum = "060021388200f6f0f447d0fcd9c64743"
                add(topic, "sensor_msgs/msg/Image", checksum, us, _image(us, stream, number))
        names, versions = ("Orbbec Femto Bolt",) * 2 + ("Bolt",), ("uid", "CL8F25300AB", "1.1.2", "1", "1.0", "USB3.0")
        info = _header(begin) + b"".join(map(_text, names)) + struct.pack("<HH", 0x2BC5, 0x066B)
        info += b"".join(map(_text, versions)) + struct.pack("<HB", 0, 0) + _text("") * 2
        add("/cam/deviceInfo", "custom_msg/msg/OBDeviceInfo", "afef5328bb4abebd1a309e1ea8b26b3a", begin, info)
        version = _header(begin) + struct.pack("<I", 0) + _blob(struct.pack("<d", 2.1)) + struct.pack("<I", 8)
        add("/cam/property", "custom_msg/msg/OBProperty", _PLACEHOLDER, begin, version)
        for kind, stream in ((3, depth), (2, color)):
            data = _profile(begin, kind, stream, fps, color_from_depth_mm)
            add(f"/cam/streamProfileType_{kind}", "custom_msg/msg/OBStreamProfileInfo", _PLACEHOLDER, begin, data)
