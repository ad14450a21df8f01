"""Records measurements and results of a live session as a ROS 2 bag (MCAP), which `voodoo track` can read."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
from rosbags.interfaces import Connection
from rosbags.rosbag2 import StoragePlugin, Writer

from voodoo.drawing.surfaces import entity
from voodoo.errors import VoodooError
from voodoo.export import ros2
from voodoo.live.follow import Step
from voodoo.live.session import Output
from voodoo.measurements import ColorImage, DepthImage, FloatArray, LaserScan, Measurement, PointCloud
from voodoo.model.camera import Camera
from voodoo.model.rotations import quaternions
from voodoo.whole import Hidden, move_whole

_QUALITY = 95


class Recorder(Output):
    """Writes depth, clouds, scans, color (JPEG), calibrations, poses of sensors, and the skeletons.

    Frames that were dropped because the tracker was late are not recorded; nor are keypoints and markers, for which ROS has no
    message.

    Args:
        path: .mcap file; it appears when the recording ends.
        root_frame: returns the frame of the poses, once a frame has arrived.

    Raises:
        VoodooError: another suffix, or a file that exists.
    """

    name = "record"
    waiting = 64

    def __init__(self, path: Path, *, root_frame: Callable[[], str]) -> None:
        """Open a bag beside the file."""
        if path.suffix != ".mcap":
            raise VoodooError(f"{path}: expected a name that ends in .mcap, found {path.suffix!r}")
        if path.exists():
            raise VoodooError(f"{path}: expected a file that does not exist yet, found one")
        self._path, self._root = path, root_frame
        self._hidden = Hidden(path)
        self._hidden.keep(paths=[path.name])
        self._folder = self._hidden.folder / path.name
        self._writer = Writer(self._folder, version=9, storage_plugin=StoragePlugin.MCAP)
        self._writer.open()
        self._topics: dict[str, Connection] = {}
        self._cameras: dict[str, Camera] = {}
        self._described: set[str] = set()
        self._at = 0

    def publish(self, step: Step) -> None:
        """See Output."""
        self._at = max(self._at + 1, round(step.frame.arrived * 1e9))
        for item in sorted(step.frame.measurements, key=lambda item: item.stamp == step.stamp):
            self._write_item(item)
        for number, estimate in step.estimates.items():
            person = ros2.person_id(number)
            how: Any = {"root_frame": self._root(), "person": person, "turn": step.turn}
            messages = ros2.instant(estimate, step.bodies[number], **how)
            if estimate.joints and person not in self._described:
                messages |= ros2.description(step.bodies[number], person)
                self._described.add(person)
            for topic, message in messages.items():
                self._write(topic, message)
        there = [ros2.person_id(number) for number, one in step.estimates.items() if one.joints]
        for topic, message in ros2.tracked(step.stamp, there, root_frame=self._root()).items():
            self._write(topic, message)

    def _write_item(self, item: Measurement) -> None:
        if not isinstance(item, DepthImage | ColorImage | PointCloud | LaserScan):
            return
        topic, made = next(one for kind, one in _WRITTEN.items() if isinstance(item, kind))
        name = entity(item.sensor)
        frame = f"{name}_frame"
        self._write("/tf", transforms(self._root(), frame, item.stamp, item.root_from_sensor))
        header = ros2.header_at(item.stamp, frame)
        if isinstance(item, DepthImage | ColorImage) and self._cameras.get(item.sensor) != item.camera:
            self._cameras[item.sensor] = item.camera
            self._write(f"/{name}/{topic.partition('/')[0]}/camera_info", camera_info(header, item.camera))
        self._write(f"/{name}/{topic}", made(header, item))

    def _write(self, topic: str, message: Any) -> None:  # noqa: ANN401
        if topic not in self._topics:
            self._topics[topic] = self._writer.add_connection(topic, message.__msgtype__, typestore=ros2.STORE)
        self._at += 1
        self._writer.write(self._topics[topic], self._at, ros2.cdr(message))

    def close(self) -> None:
        """Finish the file.

        Raises:
            VoodooError: it cannot be written; names the folder in which the recording is kept then.
        """
        try:
            self._writer.close()
            move_whole(next(self._folder.glob("*.mcap")), self._path)
        except OSError as error:
            raise VoodooError(
                f"{self._path}: {error.strerror or error}; what was recorded is in {self._folder}"
            ) from error
        self._hidden.remove()


def transforms(parent: str, child: str, stamp: float, parent_from_child: FloatArray) -> Any:  # noqa: ANN401
    """A tf2_msgs/TFMessage of one transform (4, 4)."""
    row = [*parent_from_child[:3, 3].tolist(), *quaternions(parent_from_child[:3, :3]).tolist()]
    return ros2.transforms_message(stamp, [(parent, child, row)])


def camera_info(header: Any, camera: Camera) -> Any:  # noqa: ANN401
    """A sensor_msgs/CameraInfo."""
    lens = {"distortion_model": camera.model, "d": np.array(camera.distortion, dtype=np.float64)}
    about: dict[str, Any] = {"header": header, "height": camera.height, "width": camera.width, **lens}
    matrices = {"k": camera.matrix, "r": np.eye(3), "p": np.pad(camera.matrix, ((0, 0), (0, 1)))}
    flat = {name: matrix.ravel() for name, matrix in matrices.items()}
    return ros2.new("sensor_msgs/msg/CameraInfo", **about, **flat)


def _depth(header: Any, item: DepthImage) -> Any:  # noqa: ANN401
    image: npt.NDArray[Any] = np.ascontiguousarray(item.image)
    if image.dtype.kind == "u" and item.meters_per_unit != 0.001:
        image = np.where(image > 0, image * np.float64(item.meters_per_unit), np.nan).astype(np.float32)
    elif image.dtype.kind == "f" and item.meters_per_unit != 1.0:
        image = (image * item.meters_per_unit).astype(np.float32)
    encoding = "16UC1" if image.dtype.kind == "u" else "32FC1"
    return _rows("sensor_msgs/msg/Image", header, image, encoding=encoding, step=image.shape[1] * image.itemsize)


def _rows(kind: str, header: Any, rows: npt.NDArray[Any], **fields: Any) -> Any:  # noqa: ANN401
    """A message of an array (H, W, ...): its size, its bytes, and other fields."""
    size = {"height": rows.shape[0], "width": rows.shape[1]}
    return ros2.new(kind, header=header, **size, data=rows.view(np.uint8).ravel(), **fields)


def _color(header: Any, item: ColorImage) -> Any:  # noqa: ANN401
    _, data = cv2.imencode(".jpg", item.image, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])
    return ros2.new("sensor_msgs/msg/CompressedImage", header=header, format="bgr8; jpeg compressed bgr8", data=data)


def _cloud(header: Any, item: PointCloud) -> Any:  # noqa: ANN401
    points = np.ascontiguousarray(item.points, dtype=np.float32)
    fields = [
        ros2.new("sensor_msgs/msg/PointField", name=name, offset=4 * index, datatype=7, count=1)
        for index, name in enumerate("xyz")
    ]
    about: dict[str, Any] = {"point_step": 12, "row_step": points.nbytes, "is_dense": True}
    return _rows("sensor_msgs/msg/PointCloud2", header, points[None], fields=fields, **about)


def _scan(header: Any, item: LaserScan) -> Any:  # noqa: ANN401
    fields = {name: getattr(item, name) for name in ("angle_min", "angle_increment", "range_min", "range_max")}
    fields["angle_max"] = item.angle_min + item.angle_increment * (len(item.ranges) - 1)
    return ros2.new("sensor_msgs/msg/LaserScan", header=header, ranges=item.ranges.astype(np.float32), **fields)


_WRITTEN: dict[type, tuple[str, Callable[[Any, Any], Any]]] = {
    DepthImage: ("depth/image_raw", _depth),
    ColorImage: ("color/image_raw/compressed", _color),
    PointCloud: ("points", _cloud),
    LaserScan: ("scan", _scan),
}
