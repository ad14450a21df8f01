"""A RealSense camera, through the vendor's library `pyrealsense2`."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from voodoo.errors import CameraError, VoodooError, naming
from voodoo.live.clock import Clock
from voodoo.live.faults import Faults
from voodoo.live.source import Arrival, Source, SourceGone
from voodoo.measurements import ColorImage, DepthImage, FloatArray
from voodoo.model.camera import Camera
from voodoo.model.transforms import pose_of
from voodoo.recordings.calibration import read_calibration

_SIZE, _RATE = (640, 480), 30
"""Requested resolution and rate, if the camera supports them."""
_WAITING = 4
_SILENT_S = 5.0
"""A stream that stops for this long is opened again; some stop after minutes."""
_LENSES = {
    "brown_conrady": "plumb_bob",
    "modified_brown_conrady": "plumb_bob",
    "inverse_brown_conrady": "inverse_plumb_bob",
    "kannala_brandt4": "equidistant",
}


class RealSenseSource(Source):
    """Depth, and color if available, of a RealSense camera.

    Args:
        serial: of the camera; None: the first one.
        calibration: a calibration.toml whose `root_frame` and `root_from_sensor` give the pose of the depth camera.
        size: (width, height) [px] to request.
        rate: images per second to request.
        color: whether color is used.
        device: a device of `pyrealsense2`, instead of a search for one.
    """

    def __init__(
        self,
        *,
        serial: str | None = None,
        calibration: Path | None = None,
        size: tuple[int, int] = _SIZE,
        rate: int = _RATE,
        color: bool = True,
        device: Any = None,  # noqa: ANN401 - of a library that may not be installed
    ) -> None:
        """Nothing is opened yet."""
        self._rs = _library()
        self.name = "realsense" if serial is None else f"realsense:{serial}"
        self._serial, self._size, self._rate, self._with_color = serial, size, rate, color
        self._root, self._root_from_depth = "camera_depth_optical_frame", np.eye(4)
        self.placed = calibration is not None
        if calibration is not None:
            place = read_calibration(calibration)
            self._root, self._root_from_depth = place.root_frame, place.depth.root_from_sensor
        self._given = device
        self._device: Any = None
        self._sensors: list[Any] = []
        self._arrivals: deque[Arrival] = deque(maxlen=_WAITING)
        self._came = threading.Condition()
        self._depth_profile: Any = None
        self._about: dict[str, Any] = {"name": self.name, "kind": "realsense"}

    @property
    def root_frame(self) -> str:
        """See Source."""
        return self._root

    def open(self, clock: Clock, faults: Faults) -> None:
        """See Source."""
        self._clock, self._last = clock, clock.now()
        self._device = self._given if self._given is not None else self._found()
        sensors = self._device.query_sensors()
        depth = next((sensor for sensor in sensors if sensor.is_depth_sensor()), None)
        if depth is None:
            raise VoodooError(f"{self.name}: expected a camera with a depth sensor, found none")
        rs = self._rs
        self._scale = float(f"{depth.as_depth_sensor().get_depth_scale():.7g}")
        chosen: dict[int, tuple[Any, list[Any]]] = {}
        self._depth_profile = self._profile(depth, rs.stream.depth, (rs.format.z16,))
        if self._depth_profile is None:
            raise VoodooError(f"{self.name}: expected a stream of 16-bit depth, found none")
        self._streams: dict[int, Callable[[Any], Arrival]] = {}
        self._add(chosen, depth, self._depth_profile, self._depth_stream(self._depth_profile))
        if self._with_color:
            for sensor in sensors:
                profile = self._profile(sensor, rs.stream.color, (rs.format.bgr8, rs.format.rgb8))
                if profile is not None:
                    self._add(chosen, sensor, profile, self._color_stream(profile))
                    break
        try:
            for sensor, profiles in chosen.values():
                sensor.open(profiles)
                sensor.start(self._take)
                self._sensors.append(sensor)
        except RuntimeError as error:
            self.close()
            raise SourceGone(f"{self.name}: {str(error).strip()}") from error

    def _found(self) -> Any:  # noqa: ANN401
        rs = self._rs
        serials = {}
        for device in rs.context().query_devices():
            serials[str(device.get_info(rs.camera_info.serial_number))] = device
        device = serials.get(self._serial) if self._serial else next(iter(serials.values()), None)
        if device is None:
            raise SourceGone(f"{self.name}: expected the camera, found {', '.join(serials) or 'none'}")
        self._about["camera"] = str(device.get_info(rs.camera_info.name))
        return device

    def _add(self, chosen: dict[int, tuple[Any, list[Any]]], sensor: Any, profile: Any, take: Any) -> None:  # noqa: ANN401
        chosen.setdefault(id(sensor), (sensor, []))[1].append(profile)
        self._streams[profile.unique_id()] = take

    def _profile(self, sensor: Any, stream: Any, formats: Sequence[Any]) -> Any:  # noqa: ANN401
        """The stream of a sensor that is nearest to the requested one; None: it has none."""
        profiles = [
            profile.as_video_stream_profile()
            for profile in sensor.get_stream_profiles()
            if profile.stream_type() == stream and profile.format() in formats
        ]

        def differs(profile: Any) -> tuple[int, int]:  # noqa: ANN401
            width, height = self._size
            return abs(profile.width() * profile.height() - width * height), abs(profile.fps() - self._rate)

        return min(profiles, key=differs, default=None)

    def _depth_stream(self, profile: Any) -> Callable[[Any], Arrival]:  # noqa: ANN401
        camera, sensor = camera_of(profile.get_intrinsics(), self.name), f"{self.name}/depth"

        def take(frame: Any) -> Arrival:  # noqa: ANN401
            stamp, image = frame.get_timestamp() * 1e-3, np.array(frame.get_data(), dtype=np.uint16)
            item = DepthImage(sensor, stamp, image, self._scale, camera, self._root_from_depth)
            return Arrival(sensor, "depth", stamp, lambda: item, drives=True)

        return take

    def _color_stream(self, profile: Any) -> Callable[[Any], Arrival]:  # noqa: ANN401
        camera, sensor = camera_of(profile.get_intrinsics(), self.name), f"{self.name}/color"
        swapped = profile.format() == self._rs.format.rgb8
        root_from_color = self._root_from_depth @ _pose(profile.get_extrinsics_to(self._depth_profile))

        def take(frame: Any) -> Arrival:  # noqa: ANN401
            stamp = frame.get_timestamp() * 1e-3
            image: npt.NDArray[np.uint8] = np.array(frame.get_data(), dtype=np.uint8)
            if swapped:
                image = np.ascontiguousarray(image[:, :, ::-1])
            item = ColorImage(sensor, stamp, lambda: image, camera, root_from_color)
            return Arrival(sensor, "color", stamp, lambda: item)

        return take

    def _take(self, frame: Any) -> None:  # noqa: ANN401
        """Called by the library's threads."""
        stream = self._streams.get(frame.get_profile().unique_id())
        if stream is None:
            return
        arrival = stream(frame)
        with self._came:
            self._arrivals.append(arrival)
            self._came.notify()

    def read(self, timeout: float) -> Sequence[Arrival]:
        """See Source."""
        with self._came:
            if not self._arrivals:
                self._came.wait(timeout)
            arrivals = list(self._arrivals)
            self._arrivals.clear()
        now = self._clock.now()
        if arrivals:
            self._last = now
        elif not self._device.is_connected():
            raise SourceGone(f"{self.name}: it was unplugged")
        elif now - self._last > _SILENT_S:
            raise SourceGone(f"{self.name}: no image for {now - self._last:.1f} s, its streams are started again")
        return arrivals

    def close(self) -> None:
        """See Source."""
        for sensor in self._sensors:
            for end in (sensor.stop, sensor.close):
                try:
                    end()
                except RuntimeError:
                    pass  # it was unplugged
        self._sensors.clear()
        self._device = None

    def about(self) -> dict[str, Any]:
        """See Source."""
        return dict(self._about)


def camera_of(intrinsics: Any, source: str) -> Camera:  # noqa: ANN401
    """The camera of `pyrealsense2.intrinsics`.

    Raises:
        VoodooError: invalid numbers, or an unknown lens model.
    """
    lens = intrinsics.model.name
    coefficients = [float(value) for value in intrinsics.coeffs]
    if not any(coefficients):
        lens = "brown_conrady"
    if lens not in _LENSES:
        raise VoodooError(f"{source}: expected a lens of {', '.join(_LENSES)}, found {lens}")
    model = _LENSES[lens]
    with naming(source, CameraError, error=VoodooError):
        return Camera(
            intrinsics.width,
            intrinsics.height,
            intrinsics.fx,
            intrinsics.fy,
            intrinsics.ppx,
            intrinsics.ppy,
            tuple(coefficients[:4] if model == "equidistant" else coefficients),
            model,  # type: ignore[arg-type]
        )


def _pose(extrinsics: Any) -> FloatArray:  # noqa: ANN401
    """(4, 4) of `pyrealsense2.extrinsics`, whose rotation is stored by columns."""
    turn = np.array(extrinsics.rotation, dtype=np.float64).reshape(3, 3).T
    u, _, v = np.linalg.svd(turn)  # single precision is no rotation for the tracker
    return pose_of(u @ v, extrinsics.translation)


def _library() -> Any:  # noqa: ANN401
    try:
        import pyrealsense2
    except ImportError as error:
        hint = "pip install 'voodoo-tracker[realsense]'"
        if "libusb" in str(error):
            hint = "apt install libusb-1.0-0"
        raise VoodooError(f"RealSense cameras need pyrealsense2, which cannot be used ({error}): {hint}") from error
    return pyrealsense2
