"""What cameras on a maker's library have in common: images come in its threads, with lens, pose and stamp."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from voodoo.errors import CameraError, VoodooError, naming
from voodoo.live.clock import Clock
from voodoo.live.mailbox import Mailbox
from voodoo.live.source import Arrival, Faults, Source, SourceGone
from voodoo.measurements import ColorImage, DepthImage, FloatArray
from voodoo.model.camera import Camera
from voodoo.model.rotations import nearest_rotations
from voodoo.model.transforms import pose_of
from voodoo.recordings.camera_files import read_calibration
from voodoo.recordings.pictures import decode_color

Vendor: TypeAlias = Any
"""An object of a library that brings no types, or may not be installed."""
_WAITING = 4
_SILENT_S = 5.0
"""A stream that stops for this long is opened again; some stop after minutes."""
_LENSES = {
    "brown_conrady": ("plumb_bob", 5),
    "modified_brown_conrady": ("plumb_bob", 5),
    "inverse_brown_conrady": ("inverse_plumb_bob", 5),
    "brown_conrady_k6": ("rational_polynomial", 8),
    "perspective": ("rational_polynomial", 14),
    "kannala_brandt4": ("equidistant", 4),
    "fisheye": ("equidistant", 4),
}
"""Name in the libraries -> lens model of Camera, and how many coefficients it takes."""


class CameraSource(Source):
    """Depth, and color if available, of a camera.

    Args:
        serial: of the camera; None: the first one.
        calibration: a calibration.toml whose `root_frame` and `root_from_sensor` give the pose of the depth camera.
        rate: images per second to request.
        device: a device of the library, instead of a search for one.

    Raises:
        VoodooError: the library is missing, or the calibration is invalid.
    """

    root_frame = "camera_depth_optical_frame"
    kind: str
    size: tuple[int, int]
    """(width, height) [px] that is requested."""

    def __init__(
        self,
        *,
        serial: str | None = None,
        calibration: Path | None = None,
        rate: int = 30,
        device: Vendor = None,
    ) -> None:
        """Nothing is opened yet."""
        self.name = self.kind if serial is None else f"{self.kind}:{serial}"
        self._errors: tuple[type[Exception], ...] = (RuntimeError,)
        self._library = self._imported()
        self._serial, self._rate, self._given = serial, rate, device
        self._device: Vendor = None
        self._root_from_depth, self.placed = np.eye(4), calibration is not None
        if calibration is not None:
            place = read_calibration(calibration)
            self.root_frame, self._root_from_depth = place.root_frame, place.depth.world_from_sensor
        self._ends: list[Callable[[], object]] = []
        self._arrivals: Mailbox[Arrival] = Mailbox(_WAITING)
        self._error: VoodooError | None = None
        self._about: dict[str, Any] = {"name": self.name, "kind": self.kind}

    @abstractmethod
    def _imported(self) -> Vendor:
        """The library; what it raises where a camera is missing or busy is in `_errors`."""

    @abstractmethod
    def _found(self) -> Vendor:
        """The device, by `_chosen`."""

    @abstractmethod
    def _start(self) -> None:
        """Start the streams of `_device`, and put into `_ends` what ends them."""

    @abstractmethod
    def _is_there(self) -> bool:
        """Whether the camera is connected."""

    def open(self, clock: Clock, faults: Faults) -> None:
        """See Source."""
        self._clock, self._last = clock, clock.now()
        try:
            self._device = self._found() if self._given is None else self._given
            self._start()
        except self._errors as error:
            raise SourceGone(f"{self.name}: {str(error).strip()}") from error

    def read(self, timeout: float) -> Sequence[Arrival]:
        """See Source."""
        arrivals = self._arrivals.take_all(timeout)
        now = self._clock.now()
        if self._error is not None:
            raise self._error
        if arrivals:
            self._last = now
        elif not self._is_there():
            raise SourceGone(f"{self.name}: it was unplugged")
        elif now - self._last > _SILENT_S:
            raise SourceGone(f"{self.name}: no image for {now - self._last:.1f} s, its streams are started again")
        return arrivals

    def close(self) -> None:
        """See Source."""
        for end in self._ends:
            with suppress(*self._errors):  # it was unplugged
                end()
        self._ends.clear()
        self._device = None

    def about(self) -> dict[str, Any]:
        """See Source."""
        return dict(self._about)

    def _chosen(self, cameras: Mapping[str, Vendor]) -> Vendor:
        """The camera with the serial number that is asked for, of those that are there."""
        camera = cameras.get(self._serial) if self._serial else next(iter(cameras.values()), None)
        if camera is None:
            raise SourceGone(f"{self.name}: expected the camera, found {', '.join(cameras) or 'none'}")
        return camera

    def _nearest(self, streams: Iterable[tuple[int, int, int, Vendor]]) -> Vendor:
        """Of streams with their width, height and rate, the one nearest to what is requested; None if there are none."""

        def differs(stream: tuple[int, int, int, Vendor]) -> tuple[int, int]:
            return abs(stream[0] * stream[1] - self.size[0] * self.size[1]), abs(stream[2] - self._rate)

        return min(streams, key=differs, default=(0, 0, 0, None))[3]

    def _take(self, made: Callable[[Vendor], Arrival | None], frame: Vendor) -> None:
        """Called in threads of the library, which end the process where an error leaves them: `read` raises it."""
        try:
            arrival = made(frame)
        except Exception as error:
            self._error = VoodooError(f"{self.name}: an image that cannot be used: {error}")
            return
        if arrival is not None:
            self._arrivals.put(arrival)

    def _depth(self, stamp: float, image: npt.ArrayLike, unit: float, camera: Camera) -> Arrival:
        sensor = f"{self.name}/depth"
        values = np.array(image).view(np.uint16).reshape(camera.height, camera.width)
        item = DepthImage(sensor, stamp, values, float(f"{unit:.7g}"), camera, self._root_from_depth)
        return Arrival(sensor, "depth", stamp, lambda: item, drives=True)

    def _color(
        self,
        stamp: float,
        image: npt.ArrayLike | bytes,
        camera: Camera,
        depth_from_color: FloatArray,
        rgb: bool = False,
    ) -> Arrival:
        """Of an image in BGR or RGB, or one that is compressed."""
        sensor, size = f"{self.name}/color", (camera.width, camera.height)
        if isinstance(image, bytes):
            load = partial(decode_color, image, f"{sensor}, stamp {stamp:.6f}", size)
        else:
            bgr = np.array(image).reshape(camera.height, camera.width, 3)[:, :, :: -1 if rgb else 1]
            load = partial(np.ascontiguousarray, bgr)
        item = ColorImage(sensor, stamp, load, camera, self._root_from_depth @ depth_from_color)
        return Arrival(sensor, "color", stamp, lambda: item)


def camera_of(
    source: str, lens: str, size: tuple[int, int], intrinsics: Iterable[float], coefficients: Iterable[float]
) -> Camera:
    """The camera with a lens model and coefficients in OpenCV's order, as a library has them.

    Raises:
        VoodooError: invalid numbers, or an unknown lens model.
    """
    values = [float(value) for value in coefficients]
    lens = lens.lower() if any(values) else "brown_conrady"  # zeros are no distortion, for whichever model
    if lens not in _LENSES:
        raise VoodooError(f"{source}: expected a lens of {', '.join(_LENSES)}, found {lens}")
    model, count = _LENSES[lens]
    fx, fy, cx, cy = intrinsics
    with naming(source, CameraError, error=VoodooError):
        return Camera(*size, fx, fy, cx, cy, (*values, *[0.0] * count)[:count], model)  # type: ignore[arg-type]


def rigid(turn: npt.ArrayLike, place: npt.ArrayLike) -> FloatArray:
    """(4, 4) of a rotation (3, 3) in single precision, which is no rotation for the tracker, and a translation [m]."""
    return pose_of(nearest_rotations(np.asarray(turn, dtype=np.float64).reshape(3, 3)), place)
