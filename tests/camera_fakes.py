"""`depthai` 3.12 and `pyorbbecsdk2` 2.1 without a camera: the names, arguments and units that voodoo's sources use.

tests/peers/check_cameras.py compares the names with the libraries.
"""

from __future__ import annotations

from datetime import timedelta
from enum import Enum
from types import SimpleNamespace

import numpy as np


class ImgTransformation:
    def __init__(self, size, k, model, coefficients, x_m=0.0):
        self.size, self.k, self.model, self.coefficients, self.x_m = size, k, model, coefficients, x_m

    def getSize(self):
        return self.size

    def getIntrinsicMatrix(self):
        fx, fy, cx, cy = self.k
        return [[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]]

    def getDistortionModel(self):
        return SimpleNamespace(name=self.model)

    def getDistortionCoefficients(self):
        return list(self.coefficients)

    def getExtrinsicsTransformationMatrixTo(self, to, useSpecTranslation=False, sourceUnit=None):
        assert sourceUnit is TYPES.LengthUnit.METER and not useSpecTranslation
        pose = np.eye(4)
        pose[0, 3] = self.x_m - to.x_m
        return pose.tolist()


class ImgFrame:
    Type = Enum("Type", "BGR888i")

    def __init__(self, image, seconds, transformation):
        self.image, self.seconds, self.transformation = image, seconds, transformation

    def getTimestamp(self):
        return timedelta(seconds=self.seconds)

    def getTransformation(self):
        return self.transformation

    def getFrame(self):
        return self.image

    def getCvFrame(self):
        return self.image


TYPES = SimpleNamespace(
    CameraBoardSocket=Enum("CameraBoardSocket", "CAM_A CAM_B CAM_C"),
    CameraSensorType=Enum("CameraSensorType", "COLOR MONO"),
    Clock=SimpleNamespace(now=lambda: timedelta(seconds=50.0)),
    ImgFrame=ImgFrame,
    ImgTransformation=ImgTransformation,
    LengthUnit=Enum("LengthUnit", "METER MILLIMETER"),
)


def fake_depthai(serials=("1844301",), *, pairs=True, color=True, types=TYPES):
    """The module, with cameras of these ids; `sent` has the callback of each stream, `made` the devices.

    Args:
        types: where the types of messages are from, which the real library has without a camera, too.
    """
    Socket = types.CameraBoardSocket
    sent, made = {}, []

    class Output:
        def __init__(self, name):
            self.name = name

        def createOutputQueue(self, maxSize, blocking):
            assert maxSize == 1 and not blocking
            return SimpleNamespace(addCallback=lambda callback: sent.update({self.name: callback}))

    class StereoDepth:
        def __init__(self):
            self.depth = Output("depth")
            self.initialConfig = SimpleNamespace(setDepthUnit=lambda unit: sent.update(unit=unit))

        def build(self, autoCreateCameras, *, size, fps):
            assert autoCreateCameras
            sent["size"] = (size, fps)
            return self

    class Camera:
        def build(self, boardSocket):
            assert boardSocket == Socket.CAM_A
            return self

        def requestOutput(self, size, type, *, fps):
            assert type == types.ImgFrame.Type.BGR888i
            return Output("color")

    class Device:
        @staticmethod
        def getAllAvailableDevices():
            return [SimpleNamespace(deviceId=serial, name=f"10.0.0.{n}") for n, serial in enumerate(serials)]

        def __init__(self, info):
            self.info, self.closed = info, False
            made.append(self)

        def getProductName(self):
            return "OAK-D"

        def getAvailableStereoPairs(self):
            return [SimpleNamespace(left=Socket.CAM_B, right=Socket.CAM_C)] if pairs else []

        def getConnectedCameras(self, type):
            assert type == types.CameraSensorType.COLOR
            return [Socket.CAM_B, Socket.CAM_A] if color else [Socket.CAM_B]

        def isClosed(self):
            return self.closed

        def close(self):
            self.closed = True

    class Pipeline:
        def __init__(self, device):
            self.running = False

        def create(self, kind):
            return kind()

        def start(self):
            self.running = True

        def stop(self):
            self.running = False

        def isRunning(self):
            return self.running

    return SimpleNamespace(
        sent=sent,
        made=made,
        **{name: getattr(types, name) for name in vars(TYPES)},
        Device=Device,
        Pipeline=Pipeline,
        node=SimpleNamespace(Camera=Camera, StereoDepth=StereoDepth),
    )


def orbbec_profile(size, fps, form, k=(500.0, 501.0, 320.0, 240.0), lens="NONE", d=(0.0,) * 8, x_mm=0.0):
    """A stream of a camera; `form` is a name of OBFormat, and `d` is k1 ... k6, p1, p2."""
    intrinsic = SimpleNamespace(width=size[0], height=size[1], **dict(zip(("fx", "fy", "cx", "cy"), k, strict=True)))
    names = ("k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2")
    distortion = SimpleNamespace(model=SimpleNamespace(name=lens), **dict(zip(names, d, strict=True)))

    def get_extrinsic_to(target):
        place = np.array([x_mm - target.x_mm, 0.0, 0.0], np.float32)
        return SimpleNamespace(rot=np.eye(3, dtype=np.float32), transform=place)

    profile = SimpleNamespace(
        form=form,
        x_mm=x_mm,
        get_width=lambda: size[0],
        get_height=lambda: size[1],
        get_fps=lambda: fps,
        get_intrinsic=lambda: intrinsic,
        get_distortion=lambda: distortion,
        get_extrinsic_to=get_extrinsic_to,
    )
    profile.as_video_stream_profile = lambda: profile
    return profile


def orbbec_frame(image, us, scale=1.0, global_us=0):
    """An image as bytes, as the library has it."""
    return SimpleNamespace(
        get_data=lambda: np.frombuffer(image, np.uint8) if isinstance(image, bytes) else image.view(np.uint8).ravel(),
        get_depth_scale=lambda: scale,
        get_timestamp_us=lambda: us,
        get_global_timestamp_us=lambda: global_us,
    )


def fake_orbbec(profiles, serials=("CL8F25300AB",), *, related=False):
    """The module, with cameras of these numbers, whose streams are `profiles` by sensor."""
    module = SimpleNamespace(
        sent={"there": list(serials)},
        OBError=type("OBError", (Exception,), {}),
        OBFormat=Enum("OBFormat", "Y16 Z16 RGB BGR MJPG YUYV"),
        OBSensorType=Enum("OBSensorType", "COLOR_SENSOR DEPTH_SENSOR"),
        OBLogLevel=Enum("OBLogLevel", "NONE"),
        OBPlaybackStatus=Enum("OBPlaybackStatus", "PLAYING STOPPED"),
        OBFrameAggregateOutputMode=Enum("OBFrameAggregateOutputMode", "ANY_SITUATION"),
    )

    for profile in [profile for found in profiles.values() for profile in found]:
        profile.get_format = lambda form=profile.form: module.OBFormat[form]

    def listed(items, name):
        return SimpleNamespace(**{"get_count": lambda: len(items), name: lambda index: items[index]})

    class DeviceList:
        def __init__(self, serials):
            self.serials = serials

        def get_count(self):
            return len(self.serials)

        def get_device_serial_number_by_index(self, index):
            return self.serials[index]

        def get_device_by_index(self, index):
            return Device(self.serials[index])

    class Device:
        def __init__(self, serial):
            module.sent["serial"] = self.serial = serial
            self._status = module.OBPlaybackStatus.PLAYING

        def get_device_info(self):
            return SimpleNamespace(get_name=lambda: "Orbbec Femto Bolt", get_serial_number=lambda: self.serial)

        def is_global_timestamp_supported(self):
            return related

        def enable_global_timestamp(self, enable):
            module.sent["related"] = enable

        def get_sensor_list(self):
            return listed([getattr(module.OBSensorType, name) for name in profiles], "get_type_by_index")

    class PlaybackDevice(Device):
        def get_playback_status(self):
            return self._status

    class Context:
        @staticmethod
        def set_logger_level(level):
            assert level is module.OBLogLevel.NONE

        def query_devices(self):
            return DeviceList(module.sent["there"])

    class Config:
        def __init__(self):
            self.streams = []

        def enable_stream(self, profile):
            self.streams.append(profile)

        def set_frame_aggregate_output_mode(self, mode):
            assert mode is module.OBFrameAggregateOutputMode.ANY_SITUATION

    class Pipeline:
        def __init__(self, device):
            pass

        def get_stream_profile_list(self, sensor):
            return listed(profiles[sensor.name], "get_stream_profile_by_index")

        def start(self, config, callback):
            def send(depth=None, color=None):
                callback(SimpleNamespace(get_depth_frame=lambda: depth, get_color_frame=lambda: color))

            module.sent.update(streams=config.streams, frames=send)

        def stop(self):
            raise module.OBError("it was unplugged")

    module.__dict__.update(Context=Context, Config=Config, Device=Device, DeviceList=DeviceList)
    module.__dict__.update(Pipeline=Pipeline, PlaybackDevice=PlaybackDevice)
    return module
