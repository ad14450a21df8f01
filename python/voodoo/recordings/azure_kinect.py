"""Azure Kinect and Femto Bolt `.mkv`: depth and color with their lenses, as Microsoft's and Orbbec's recorders write them.

Calibration is an attachment, as the device stores it; how a mode of a camera crops and scales it is that of the Azure Kinect
Sensor SDK 1.4, src/transformation/mode_specific_calibration.c.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from voodoo.errors import CameraError, RecordingError, installed, naming, reading
from voodoo.measurements import ColorImage, DepthImage, FloatArray, Measurement, RecordedFrame
from voodoo.model.camera import Camera
from voodoo.model.joint import short
from voodoo.model.transforms import inverse, is_rigid, pose_of
from voodoo.recordings.left_out import LeftOut
from voodoo.recordings.pictures import decode_color
from voodoo.recordings.recording import Recording, SensorInfo, usable
from voodoo.recordings.together import in_turn
from voodoo.stored import MOST_METADATA

FRAME = "depth_camera_optical_frame"
COLOR_FRAME = "rgb_camera_optical_frame"
_DEPTH_PX = 1024
"""Width and height of the depth sensor's whole image, which binning halves."""
_FIELDS = {"NFOV": ((192, 180), (640, 576)), "WFOV": ((0, 0), (_DEPTH_PX, _DEPTH_PX))}
"""Field of view of depth -> first column and row of the image in that of the whole sensor, and its size."""
_COLOR_WIDTHS = {720: 1280, 1080: 1920, 1440: 2560, 1536: 2048, 2160: 3840, 3072: 4096}
"""Height of a color image, which is in its mode's name -> width; it is cropped in the middle of a sensor of 4:3."""
_Size: TypeAlias = tuple[int, int]


def _modes() -> Iterator[tuple[str, tuple[_Size, _Size, _Size]]]:
    """Modes with the size of the whole image of their sensor, first column and row of their image in it, and its size."""
    for field, ((left, top), (width, height)) in _FIELDS.items():
        for name, by in (("2X2BINNED", 2), ("UNBINNED", 1)):
            whole = _DEPTH_PX // by
            yield f"{field}_{name}", ((whole, whole), (left // by, top // by), (width // by, height // by))
    for height, width in _COLOR_WIDTHS.items():
        whole = 3 * width // 4
        yield f"{height}P", ((width, whole), (0, (whole - height) // 2), (width, height))


_MODES = dict(_modes())
_DEPTH, _COLOR = "CALIBRATION_CameraPurposeDepth", "CALIBRATION_CameraPurposePhotoVideo"
_EXPECTED = "a .mkv of an Azure Kinect or Femto Bolt (other cameras: docs/how-to/cameras.md)"


class AzureKinectRecording(Recording):
    """A recording of an Azure Kinect or Femto Bolt.

    The root frame is the depth camera's optical frame (x right, y down, z forward). There is one frame for each depth image,
    with the color images since the previous one (MJPG; other formats, infrared and IMU are not used). Stamps are those of the
    device's clock [s].

    Args:
        path: the .mkv file.
        left_out: counts unusable images, which are then left out; None: they are errors.

    Raises:
        RecordingError: PyAV is not installed, no depth track, or a calibration that is missing or damaged.
    """

    loader = "azure-kinect"

    def __init__(self, path: Path, *, left_out: LeftOut | None = None) -> None:
        """Read the tracks, the calibration and the stamps; see the class."""
        self.path, self.name, self.root_frame = path, path.stem, FRAME
        self._left_out = left_out
        self.numbers: dict[tuple[str, float], int] = {}
        with reading(path, _EXPECTED), _opened(path) as film:
            tags = {word: value for word, value in film.metadata.items() if word.startswith("K4A_")}
            tracks: dict[str, tuple[int, str]] = {}
            for stream in film.streams:
                tags |= stream.metadata
                if (title := stream.metadata.get("title")) in ("DEPTH", "COLOR"):
                    tracks[title] = (stream.index, stream.codec_context.name)
            if "DEPTH" not in tracks or "K4A_DEPTH_MODE" not in tags:
                raise RecordingError(
                    f"{path}: expected {_EXPECTED}, found a film without its depth track; films of several cameras are read from "
                    "a folder with their calibration, Calib*.toml (docs/how-to/color.md)"
                )
            cameras = _calibration(path, film)
            self._offset = int(tags.get("K4A_START_OFFSET_NS", 0)) * 1e-9
            self._tracks = {tracks["DEPTH"][0]: "depth"}
            self._camera = _camera(path, cameras, _DEPTH, tags["K4A_DEPTH_MODE"])
            if "COLOR" in tracks and tracks["COLOR"][1] != "mjpeg":
                self._unused = (("color", f"{tracks['COLOR'][1]}, expected MJPG"),)
            elif "COLOR" in tracks:
                self._tracks[tracks["COLOR"][0]] = "color"
                mode = tags.get("K4A_COLOR_MODE", "").removeprefix("MJPG_")
                self._color = _camera(path, cameras, _COLOR, mode)
                self._depth_from_color = inverse(_pose(path, cameras, _COLOR))
            self._times: dict[str, list[float]] = {sensor: [] for sensor in self._tracks.values()}
            self._stamps = self._times["depth"]
            for sensor, stamp, _ in self._packets(film):
                self._times[sensor].append(stamp)
        if not self._stamps:
            raise RecordingError(f"{path}: expected depth images, found none")

    def _packets(self, film: Any) -> Iterator[tuple[str, float, Any]]:  # noqa: ANN401 - PyAV
        """Sensor, stamp and packet of each image, in the order of the file."""
        for packet in film.demux([film.streams[index] for index in self._tracks]):
            if packet.size and packet.pts is not None:
                stamp = float(packet.pts * packet.time_base) + self._offset
                yield self._tracks[packet.stream.index], stamp, packet

    def __iter__(self) -> Iterator[RecordedFrame]:
        """Read the images; see Recording."""
        return in_turn(self._measurements(), "depth")

    def _measurements(self) -> Iterator[Measurement]:
        number = -1
        with reading(self.path, _EXPECTED), _opened(self.path) as film:
            for sensor, stamp, packet in self._packets(film):
                if sensor == "color":
                    size = (self._color.width, self._color.height)
                    load = partial(decode_color, bytes(packet), f"{self.path}, color at {stamp:.6f}", size)
                    yield ColorImage("color", stamp, load, self._color, self._depth_from_color)
                    continue
                number += 1
                make = partial(self._depth_image, stamp, bytes(packet))
                if item := usable(make, number, f"{self.path}, depth", self._left_out, self.numbers):
                    yield item

    def _depth_image(self, stamp: float, content: bytes) -> DepthImage:
        where, size = f"{self.path}, depth", (self._camera.height, self._camera.width)
        if len(content) != 2 * size[0] * size[1]:
            raise RecordingError(f"{where}: expected {2 * size[0] * size[1]} bytes, found {len(content)}")
        image = np.frombuffer(content, dtype=">u2").reshape(size).astype(np.uint16)
        return DepthImage("depth", stamp, image, 0.001, self._camera, np.eye(4))

    def _sensors(self) -> Iterator[SensorInfo]:
        for sensor, stamps in self._times.items():
            camera, frame = (self._camera, FRAME) if sensor == "depth" else (self._color, COLOR_FRAME)
            detail = f"{camera.width}x{camera.height} {'16UC1' if sensor == 'depth' else 'MJPG'}"
            yield SensorInfo.of(sensor, sensor, frame, stamps, detail)


def _opened(path: Path) -> Any:  # noqa: ANN401 - PyAV
    missing = f"{path}: expected {_EXPECTED}, which PyAV reads, found no PyAV: pip install 'voodoo-tracker[azure]'"
    av = installed("av", missing, error=RecordingError)
    # Another demuxer might follow links in the file.
    return av.open(f"file:{path.absolute()}", format="matroska")


def _calibration(path: Path, film: Any) -> dict[str, Any]:  # noqa: ANN401 - PyAV
    """Purpose -> camera, as the device's calibration describes it.

    Raises:
        RecordingError: no such attachment, or not JSON with cameras.
    """
    attached = [one for one in film.streams if one.type == "attachment" and str(one.name).endswith(".json")]
    if not attached:
        raise RecordingError(f"{path}: expected the attachment calibration.json, found none")
    content = bytes(attached[0].data)
    if len(content) > MOST_METADATA:
        raise RecordingError(
            f"{path}: {attached[0].name}: expected {MOST_METADATA} bytes at most, found {len(content)}"
        )
    with reading(f"{path}, {attached[0].name}", "the calibration of an Azure Kinect"):
        cameras = json.loads(content.rstrip(b"\0"))["CalibrationInformation"]["Cameras"]
        return {str(camera["Purpose"]): camera for camera in cameras}


def _camera(path: Path, cameras: dict[str, Any], purpose: str, mode: str) -> Camera:
    """The camera of a mode.

    Raises:
        RecordingError: an unknown mode, or a calibration without what is needed.
    """
    if mode not in _MODES:
        raise RecordingError(f"{path}: expected one of the modes {', '.join(_MODES)}, found {short(mode)}")
    (wide, high), (left, top), (width, height) = _MODES[mode]
    with reading(f"{path}, calibration", f"{purpose} with 14 parameters of its lens"):
        numbers = [float(number) for number in cameras[purpose]["Intrinsics"]["ModelParameters"]]
        cx, cy, fx, fy, k1, k2, k3, k4, k5, k6, _, _, p2, p1 = numbers
        with naming(f"{path}, calibration", CameraError, error=RecordingError):
            # The device's pixel coordinates begin at the corner of the first pixel, ours in its center.
            return Camera(
                width, height, fx * wide, fy * high, cx * wide - left - 0.5, cy * high - top - 0.5,
                (k1, k2, p1, p2, k3, k4, k5, k6), "rational_polynomial",
            )  # fmt: skip


def _pose(path: Path, cameras: dict[str, Any], purpose: str) -> FloatArray:
    """camera_from_depth (4, 4).

    Raises:
        RecordingError: the calibration has none, or it is not rigid.
    """
    with reading(f"{path}, calibration", f"{purpose} with a rigid transform from the depth camera"):
        turn, place = (list(map(float, cameras[purpose]["Rt"][name])) for name in ("Rotation", "Translation"))
        pose = pose_of(np.reshape(turn, (3, 3)), place)
        if not is_rigid(pose, off=1e-3):
            raise ValueError(f"no rotation: {turn}")
        return pose
