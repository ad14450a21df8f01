"""A RealSense camera, through the vendor's library `pyrealsense2`."""

from __future__ import annotations

from functools import partial

import numpy as np

from voodoo.errors import VoodooError, installed
from voodoo.live.source import Arrival
from voodoo.live.sources.camera import CameraSource, Vendor, camera_of, rigid
from voodoo.measurements import FloatArray
from voodoo.model.camera import Camera


class RealSenseSource(CameraSource):
    """Depth, and color if available, of a RealSense camera; see CameraSource."""

    kind, size = "realsense", (640, 480)

    def _imported(self) -> Vendor:
        advice = "pip install 'voodoo-tracker[realsense]', and libusb: apt install libusb-1.0-0"
        return installed("pyrealsense2", f"RealSense cameras need pyrealsense2, which cannot be imported: {advice}")

    def _found(self) -> Vendor:
        info = self._library.camera_info
        there = self._library.context().query_devices()
        device = self._chosen({str(one.get_info(info.serial_number)): one for one in there})
        self._about["camera"] = str(device.get_info(info.name))
        return device

    def _is_there(self) -> bool:
        return bool(self._device.is_connected())

    def _start(self) -> None:
        rs = self._library
        sensors = self._device.query_sensors()
        depth: Vendor = next((sensor for sensor in sensors if sensor.is_depth_sensor()), None)
        profile = None if depth is None else self._stream(depth, rs.stream.depth, rs.format.z16)
        if profile is None:
            raise VoodooError(f"{self.name}: expected a stream of 16-bit depth, found none")
        unit = depth.as_depth_sensor().get_depth_scale()
        made = {profile.unique_id(): partial(self._depth_image, unit, self._camera(profile))}
        chosen = {id(depth): (depth, [profile])}
        for sensor in sensors:
            color = self._stream(sensor, rs.stream.color, rs.format.bgr8, rs.format.rgb8)
            if color is not None:
                chosen.setdefault(id(sensor), (sensor, []))[1].append(color)
                found = color.get_extrinsics_to(profile)
                pose = rigid(np.reshape(found.rotation, (3, 3)).T, found.translation)  # stored by columns
                rgb = color.format() == rs.format.rgb8
                made[color.unique_id()] = partial(self._color_image, self._camera(color), pose, rgb)
                break

        def sort(frame: Vendor) -> None:
            uid = frame.get_profile().unique_id()
            if uid in made:
                self._take(made[uid], frame)

        for sensor, profiles in chosen.values():
            self._ends += [sensor.stop, sensor.close]
            sensor.open(profiles)
            sensor.start(sort)

    def _stream(self, sensor: Vendor, stream: Vendor, *formats: Vendor) -> Vendor:
        profiles = (
            profile.as_video_stream_profile()
            for profile in sensor.get_stream_profiles()
            if profile.stream_type() == stream and profile.format() in formats
        )
        return self._nearest((one.width(), one.height(), one.fps(), one) for one in profiles)

    def _camera(self, profile: Vendor) -> Camera:
        found = profile.get_intrinsics()
        intrinsics = (found.fx, found.fy, found.ppx, found.ppy)
        return camera_of(self.name, found.model.name, (found.width, found.height), intrinsics, found.coeffs)

    def _depth_image(self, unit: float, camera: Camera, frame: Vendor) -> Arrival:
        return self._depth(frame.get_timestamp() * 1e-3, frame.get_data(), unit, camera)

    def _color_image(self, camera: Camera, depth_from_color: FloatArray, rgb: bool, frame: Vendor) -> Arrival:
        return self._color(frame.get_timestamp() * 1e-3, frame.get_data(), camera, depth_from_color, rgb)
