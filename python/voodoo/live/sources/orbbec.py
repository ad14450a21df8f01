"""An Orbbec camera (Femto, Gemini) or a .bag of it, through the vendor's library `pyorbbecsdk`."""

from __future__ import annotations

import os
from collections.abc import Sequence
from functools import partial

import numpy as np

from voodoo.errors import VoodooError, installed
from voodoo.live.source import Arrival, SourceEnded
from voodoo.live.sources.camera import CameraSource, Vendor, camera_of, rigid
from voodoo.measurements import FloatArray
from voodoo.model.camera import Camera


class OrbbecSource(CameraSource):
    """Depth, and color if available, of an Orbbec camera; see CameraSource.

    Instead of a serial number, the path of a .bag of its recorder plays that once.
    """

    kind, size = "orbbec", (640, 576)

    def _imported(self) -> Vendor:
        stdout = os.dup(1)
        os.dup2(2, 1)  # it writes a line to stdout, where results may go
        try:
            ob = installed("pyorbbecsdk", "Orbbec cameras need pyorbbecsdk2: pip install 'voodoo-tracker[orbbec]'")
        finally:
            os.dup2(stdout, 1)
            os.close(stdout)
        ob.Context.set_logger_level(ob.OBLogLevel.NONE)  # it would write a folder Log
        self._errors = (RuntimeError, ob.OBError)
        return ob

    def _found(self) -> Vendor:
        self._context, self.stays = self._library.Context(), not str(self._serial).endswith(".bag")
        if self.stays:
            there = self._context.query_devices()
            device = there.get_device_by_index(self._chosen({serial: at for at, serial in enumerate(_serials(there))}))
        else:
            device = self._library.PlaybackDevice(self._serial)
        self._about["camera"] = device.get_device_info().get_name()
        return device

    def _is_there(self) -> bool:
        serial = self._device.get_device_info().get_serial_number()
        return not self.stays or serial in _serials(self._context.query_devices())

    def _start(self) -> None:
        ob = self._library
        self._global = self._device.is_global_timestamp_supported()
        if self._global:
            self._device.enable_global_timestamp(True)
        pipeline, config = ob.Pipeline(self._device), ob.Config()
        depth = self._stream(pipeline, ob.OBSensorType.DEPTH_SENSOR, ob.OBFormat.Y16, ob.OBFormat.Z16)
        if depth is None:
            raise VoodooError(f"{self.name}: expected a stream of 16-bit depth, found none")
        color = self._stream(pipeline, ob.OBSensorType.COLOR_SENSOR, ob.OBFormat.RGB, ob.OBFormat.BGR, ob.OBFormat.MJPG)
        config.enable_stream(depth)
        depth_image, color_image = partial(self._depth_image, self._camera(depth)), None
        if color is not None:
            config.enable_stream(color)
            found = color.get_extrinsic_to(depth)
            pose = rigid(found.rot, np.multiply(found.transform, 1e-3))
            color_image = partial(self._color_image, self._camera(color), pose, color.get_format().name)

        def sort(frames: Vendor) -> None:
            for made, frame in ((color_image, frames.get_color_frame()), (depth_image, frames.get_depth_frame())):
                if made is not None and frame is not None:
                    self._take(made, frame)

        config.set_frame_aggregate_output_mode(ob.OBFrameAggregateOutputMode.ANY_SITUATION)
        pipeline.start(config, sort)
        self._ends.append(pipeline.stop)

    def _stream(self, pipeline: Vendor, kind: Vendor, *formats: Vendor) -> Vendor:
        sensors = self._device.get_sensor_list()
        if kind not in [sensors.get_type_by_index(i) for i in range(sensors.get_count())]:
            return None
        listed = pipeline.get_stream_profile_list(kind)
        profiles = [listed.get_stream_profile_by_index(i).as_video_stream_profile() for i in range(listed.get_count())]
        return self._nearest(
            (one.get_width(), one.get_height(), one.get_fps(), one) for one in profiles if one.get_format() in formats
        )

    def _camera(self, profile: Vendor) -> Camera:
        k, d = profile.get_intrinsic(), profile.get_distortion()
        fisheye = d.model.name == "KANNALA_BRANDT4"
        coefficients = (d.k1, d.k2, d.k3, d.k4) if fisheye else (d.k1, d.k2, d.p1, d.p2, d.k3, d.k4, d.k5, d.k6)
        return camera_of(self.name, d.model.name, (k.width, k.height), (k.fx, k.fy, k.cx, k.cy), coefficients)

    def _stamp(self, frame: Vendor) -> float:
        """By the host's clock if the library relates the camera's to it, 0 until it does; else by the camera's clock."""
        return float(frame.get_global_timestamp_us() if self._global else frame.get_timestamp_us()) / 1e6

    def _depth_image(self, camera: Camera, frame: Vendor) -> Arrival | None:
        stamp, unit = self._stamp(frame), frame.get_depth_scale() * 1e-3
        return self._depth(stamp, frame.get_data(), unit, camera) if stamp else None

    def _color_image(self, camera: Camera, depth_from_color: FloatArray, coded: str, frame: Vendor) -> Arrival | None:
        stamp, data = self._stamp(frame), frame.get_data()
        image = bytes(data) if coded == "MJPG" else data
        return self._color(stamp, image, camera, depth_from_color, coded == "RGB") if stamp else None

    def read(self, timeout: float) -> Sequence[Arrival]:
        """See Source."""
        arrivals = super().read(timeout)
        stopped = self._library.OBPlaybackStatus.STOPPED
        if not (arrivals or self.stays) and self._device.get_playback_status() == stopped:
            raise SourceEnded(f"{self.name}: it is at its end")
        return arrivals


def _serials(devices: Vendor) -> list[str]:
    return [devices.get_device_serial_number_by_index(index) for index in range(devices.get_count())]
