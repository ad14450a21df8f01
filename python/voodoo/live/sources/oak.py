"""An OAK camera, through the vendor's library `depthai`, version 3."""

from __future__ import annotations

import os
from collections.abc import Callable

import numpy as np

from voodoo.errors import VoodooError, installed
from voodoo.live.source import Arrival
from voodoo.live.sources.camera import CameraSource, Vendor, camera_of, rigid
from voodoo.model.camera import Camera


class OakSource(CameraSource):
    """Depth of the stereo pair, and color if a camera beside the pair has it, of an OAK camera; see CameraSource.

    Its serial number is the id or the address of the device.
    """

    kind, size = "oak", (640, 400)

    def _imported(self) -> Vendor:
        os.environ.setdefault("DEPTHAI_LEVEL", "off")  # it writes messages to stdout, where results may go
        return installed("depthai", "OAK cameras need depthai: pip install 'voodoo-tracker[oak]'")

    def _found(self) -> Vendor:
        there = self._library.Device.getAllAvailableDevices()
        device = self._library.Device(self._chosen({word: one for one in there for word in (one.deviceId, one.name)}))
        self._ends.append(device.close)
        self._about["camera"] = str(device.getProductName())
        return device

    def _is_there(self) -> bool:
        return bool(self._pipeline.isRunning()) and not self._device.isClosed()

    def _start(self) -> None:
        dai = self._library
        pairs = self._device.getAvailableStereoPairs()
        if not pairs:
            raise VoodooError(f"{self.name}: expected a camera with a stereo pair, found none")
        self._pipeline = pipeline = dai.Pipeline(self._device)
        self._ends.insert(0, pipeline.stop)
        stereo = pipeline.create(dai.node.StereoDepth).build(True, size=self.size, fps=self._rate)
        stereo.initialConfig.setDepthUnit(dai.LengthUnit.MILLIMETER)
        self._depth_from: Vendor = None
        self._listen(stereo.depth, self._depth_image)
        for socket in self._device.getConnectedCameras(dai.CameraSensorType.COLOR):
            if socket not in (pairs[0].left, pairs[0].right):
                camera = pipeline.create(dai.node.Camera).build(socket)
                color = camera.requestOutput(self.size, dai.ImgFrame.Type.BGR888i, fps=self._rate)
                self._listen(color, self._color_image)
                break
        self._zero = self._clock.now() - dai.Clock.now().total_seconds()
        pipeline.start()

    def _listen(self, output: Vendor, made: Callable[[Vendor], Arrival | None]) -> None:
        output.createOutputQueue(maxSize=1, blocking=False).addCallback(lambda frame: self._take(made, frame))

    def _stamp(self, frame: Vendor) -> float:
        """The library converts stamps of the camera to the host's monotonic clock."""
        return self._zero + float(frame.getTimestamp().total_seconds())

    def _camera(self, image: Vendor) -> Camera:
        """The camera of an image: that of the sensor, after it was rectified, scaled or cropped."""
        (fx, _, cx), (_, fy, cy), _ = image.getIntrinsicMatrix()
        lens, coefficients = image.getDistortionModel().name, image.getDistortionCoefficients()
        return camera_of(self.name, lens, image.getSize(), (fx, fy, cx, cy), coefficients)

    def _depth_image(self, frame: Vendor) -> Arrival:
        self._depth_from = frame.getTransformation()
        return self._depth(self._stamp(frame), frame.getFrame(), 0.001, self._camera(self._depth_from))

    def _color_image(self, frame: Vendor) -> Arrival | None:
        if self._depth_from is None:
            return None  # its pose is relative to the depth image
        image, meters = frame.getTransformation(), self._library.LengthUnit.METER
        pose = np.array(image.getExtrinsicsTransformationMatrixTo(self._depth_from, False, meters))
        depth_from_color = rigid(pose[:3, :3], pose[:3, 3])
        return self._color(self._stamp(frame), frame.getCvFrame(), self._camera(image), depth_from_color)
