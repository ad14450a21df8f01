"""Small ROS bags for the tests, written message by message."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

ROS2 = get_typestore(Stores.ROS2_HUMBLE)
ROS1 = get_typestore(Stores.ROS1_NOETIC)
ROS1.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", "tf2_msgs/msg/TFMessage"))


class Messages:
    """Makes messages of one ROS version."""

    def __init__(self, ros: int = 2) -> None:
        self.ros = ros
        self.store = ROS2 if ros == 2 else ROS1
        self.types = self.store.types

    def new(self, kind: str, /, **fields: object) -> object:
        return self.types[kind](**fields)

    def header(self, stamp: float, frame: str) -> object:
        sec = int(stamp)
        time = self.new("builtin_interfaces/msg/Time", sec=sec, nanosec=round((stamp - sec) * 1e9))
        extra = {"seq": 0} if self.ros == 1 else {}
        return self.new("std_msgs/msg/Header", **extra, stamp=time, frame_id=frame)

    def image(self, stamp, data, encoding, *, frame="cam", padding=0, big=False, step=None, cut=0):
        rows = np.ascontiguousarray(data.astype(data.dtype.newbyteorder(">" if big else "<")))
        rows = rows.view(np.uint8).reshape(data.shape[0], -1)
        rows = np.hstack([rows, np.full((len(rows), padding), 0xAB, np.uint8)])
        flat = rows.ravel()[: rows.size - cut]
        return self.new(
            "sensor_msgs/msg/Image",
            header=self.header(stamp, frame),
            height=data.shape[0],
            width=data.shape[1],
            encoding=encoding,
            is_bigendian=int(big),
            step=rows.shape[1] if step is None else step,
            data=flat,
        )

    def compressed(self, stamp, data: bytes, fmt: str, *, frame="cam"):
        array = np.frombuffer(data, np.uint8)
        return self.new("sensor_msgs/msg/CompressedImage", header=self.header(stamp, frame), format=fmt, data=array)

    def camera_info(self, stamp, *, frame="cam", width=4, height=3, f=5.0, d=(), model="plumb_bob", binning=0):
        k = np.array([f, 0, 1.5, 0, f, 1.0, 0, 0, 1])
        p = np.array([f, 0, 1.5, 0, 0, f, 1.0, 0, 0, 0, 1, 0])
        names = ("D", "K", "R", "P") if self.ros == 1 else ("d", "k", "r", "p")
        values = (np.array(d, dtype=float), k, np.eye(3).ravel(), p)
        roi = self.new("sensor_msgs/msg/RegionOfInterest", x_offset=0, y_offset=0, height=0, width=0, do_rectify=False)
        return self.new(
            "sensor_msgs/msg/CameraInfo",
            header=self.header(stamp, frame),
            height=height,
            width=width,
            distortion_model=model,
            **dict(zip(names, values, strict=True)),
            binning_x=binning,
            binning_y=binning,
            roi=roi,
        )

    def scan(self, stamp, ranges, *, frame="laser", increment=0.1):
        return self.new(
            "sensor_msgs/msg/LaserScan",
            header=self.header(stamp, frame),
            angle_min=-0.1,
            angle_max=0.1,
            angle_increment=increment,
            time_increment=0.0,
            scan_time=0.0,
            range_min=0.1,
            range_max=8.0,
            ranges=np.array(ranges, np.float32),
            intensities=np.empty(0, np.float32),
        )

    def cloud(self, stamp, table: np.ndarray, fields, *, frame="cam", row_padding=0, height=1, big=False):
        """`table` is a structured array; `fields` are (name, offset, datatype)."""
        step = table.dtype.itemsize
        rows = table.view(np.uint8).reshape(height, -1)
        rows = np.hstack([rows, np.full((height, row_padding), 0xCD, np.uint8)])
        return self.new(
            "sensor_msgs/msg/PointCloud2",
            header=self.header(stamp, frame),
            height=height,
            width=len(table) // height,
            fields=[
                self.new("sensor_msgs/msg/PointField", name=n, offset=o, datatype=t, count=1) for n, o, t in fields
            ],
            is_bigendian=big,
            point_step=step,
            row_step=rows.shape[1],
            data=rows.ravel(),
            is_dense=False,
        )

    def tf(self, *edges):
        """Edges are (stamp, parent, child, (x, y, z), (x, y, z, w))."""
        transforms = []
        for stamp, parent, child, t, q in edges:
            transform = self.new(
                "geometry_msgs/msg/Transform",
                translation=self.new("geometry_msgs/msg/Vector3", **dict(zip("xyz", map(float, t), strict=True))),
                rotation=self.new("geometry_msgs/msg/Quaternion", **dict(zip("xyzw", map(float, q), strict=True))),
            )
            transforms.append(
                self.new(
                    "geometry_msgs/msg/TransformStamped",
                    header=self.header(stamp, parent),
                    child_frame_id=child,
                    transform=transform,
                )
            )
        return self.new("tf2_msgs/msg/TFMessage", transforms=transforms)


def write_bag(path: Path, entries, *, storage: str = "mcap", ros: int = 2) -> Path:
    """Write (topic, log time [s], message) entries; returns the path."""
    store = ROS2 if ros == 2 else ROS1
    if ros == 1:
        writer = Writer1(path)
    else:
        writer = Writer2(path, version=9, storage_plugin=StoragePlugin[storage.upper()])
    connections = {}
    with writer:
        for topic, time, message in entries:
            kind = message.__msgtype__
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=store)
            raw = store.serialize_cdr(message, kind) if ros == 2 else store.serialize_ros1(message, kind)
            writer.write(connections[topic], round(time * 1e9), raw)
    return path
