"""The camera model: pixels from points and rays from pixels."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Literal, get_args

import cv2
import numpy as np
import numpy.typing as npt

from voodoo.errors import CameraError
from voodoo.model.joint import as_numbers, short

CameraModel = Literal["plumb_bob", "rational_polynomial", "equidistant", "inverse_plumb_bob"]
"""Lens models of sensor_msgs/CameraInfo: Brown-Conrady (k1 k2 p1 p2 k3), the same with k4 k5 k6 in the denominator
(and optionally thin prism and tilt, in OpenCV's order), and Kannala-Brandt (k1 k2 k3 k4 on the angle); and Brown-Conrady
from distorted to undistorted coordinates, as RealSense's colour cameras are calibrated."""

_COEFFICIENTS: dict[str, tuple[int, ...]] = {
    "plumb_bob": (0, 4, 5),
    "rational_polynomial": (0, 8, 12, 14),
    "equidistant": (0, 4),
    "inverse_plumb_bob": (0, 4, 5),
}
_ALIASES = {
    "": "plumb_bob", "none": "plumb_bob", "fisheye": "equidistant", "kannala_brandt4": "equidistant",
    # librealsense's; its modified model differs by products of the radial and the tangential part only
    "None": "plumb_bob", "Brown Conrady": "plumb_bob", "Modified Brown Conrady": "plumb_bob",
    "Inverse Brown Conrady": "inverse_plumb_bob", "Kannala Brandt4": "equidistant",
}  # fmt: skip
_UNTIL = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 200, 1e-10)
"""The default of five fixed-point iterations leaves whole pixels of error on wide lenses."""
_ROUND_TRIP_PX = 0.1
MOST_PIXELS = 2**25
"""Of an image: those of an 8K picture. What is larger was mistyped, and would take gigabytes; the core has the same limit."""
_STRIP = 2**20
"""Pixels whose rays are found at a time: the memory of the whole picture's would be eight times as much."""


@dataclass(frozen=True)
class Camera:
    """A calibrated camera in its optical frame: x right, y down, z forward.

    Integer pixel coordinates are pixel centres; (0, 0) is the centre of the top-left pixel. Without distortion
    u = fx x/z + cx and v = fy y/z + cy.

    Args:
        width, height: image size [px].
        fx, fy: focal lengths [px].
        cx, cy: principal point [px].
        distortion: coefficients in OpenCV's order; () means none.
        model: how `distortion` is meant, see CameraModel.

    Raises:
        CameraError: a number is out of range or the count of coefficients does not fit the model.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, ...] = ()
    model: CameraModel = "plumb_bob"

    def __post_init__(self) -> None:
        """Check every field and store plain ints and floats, so that equal cameras compare equal."""
        for name in ("width", "height"):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < 1:
                raise CameraError(f"camera {name}: expected a whole number of pixels >= 1, found {short(value)}")
            object.__setattr__(self, name, int(value))
        if self.width * self.height > MOST_PIXELS:
            raise CameraError(
                f"camera size: expected at most {MOST_PIXELS} pixels, as an 8K picture has, "
                f"found {short(self.width)}x{short(self.height)}"
            )
        for name in ("fx", "fy", "cx", "cy"):
            value = _number(f"camera {name}", getattr(self, name))
            if name in ("fx", "fy") and value <= 0.0:
                raise CameraError(f"camera {name}: expected a focal length > 0 px, found {value!r}")
            object.__setattr__(self, name, value)
        if not isinstance(self.model, str) or self.model not in get_args(CameraModel):
            raise CameraError(f"camera model: expected one of {', '.join(get_args(CameraModel))}, found {self.model!r}")
        coefficients = _numbers("camera distortion", self.distortion)
        if len(coefficients) not in _COEFFICIENTS[self.model]:
            counts = " or ".join(map(str, _COEFFICIENTS[self.model]))
            raise CameraError(
                f"camera distortion: expected {counts} coefficients for {self.model}, "
                f"found {len(coefficients)}: {coefficients}"
            )
        # For both polynomial models zeros mean "no lens distortion"; for the equidistant one they mean a pure
        # equidistant lens, which is not a pinhole, so they have to stay.
        if self.model != "equidistant" and not any(coefficients):
            coefficients = ()
        object.__setattr__(self, "distortion", coefficients)

    @classmethod
    def from_camera_info(
        cls,
        *,
        width: int,
        height: int,
        k: Sequence[float] | npt.NDArray[np.float64],
        d: Sequence[float] | npt.NDArray[np.float64] = (),
        model: str = "plumb_bob",
        p: Sequence[float] | npt.NDArray[np.float64] | None = None,
        rectified: bool = False,
    ) -> Camera:
        """Build a camera from the fields of a sensor_msgs/CameraInfo message.

        Args:
            width, height: image size [px].
            k: 3x3 intrinsics, row by row: 9 numbers, or (3, 3).
            d: distortion coefficients.
            model: `distortion_model`; "" and "none" mean no distortion, "fisheye" means equidistant; librealsense's
                names are known, too.
            p: 3x4 projection matrix of the rectified image, row by row: 12 numbers, or (3, 4).
            rectified: the image is a rectified one: use `p` (when it is set) and no distortion.

        Raises:
            CameraError: no numbers, wrong counts, an uncalibrated camera (fx = 0), or an unknown model.
        """
        k = _numbers("camera k", k, count=9)
        if rectified and p is not None:
            projection = _numbers("camera p", p, count=12)
            if projection[0] > 0.0:  # an all-zero P means "not filled in"
                return cls(width, height, projection[0], projection[5], projection[2], projection[6])
        name = _ALIASES.get(model, model)
        d = _numbers("camera d", d)
        coefficients = () if model in ("", "none") and not any(d) else d
        return cls(width, height, k[0], k[4], k[2], k[5], coefficients, name)  # type: ignore[arg-type]

    @property
    def distorted(self) -> bool:
        """True when pixels are not simply u = fx x/z + cx, v = fy y/z + cy."""
        return self.model == "equidistant" or bool(self.distortion)

    @property
    def matrix(self) -> npt.NDArray[np.float64]:
        """The 3x3 intrinsic matrix."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

    def project(self, points_cam: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """Pixels of points.

        Args:
            points_cam: (N, 3) [m] in the optical frame.

        Returns:
            (N, 2) pixel coordinates (u, v), not clipped to the image; NaN for points at or behind z = 0.

        Raises:
            CameraError: the shape is not (N, 3).
        """
        try:
            points = as_numbers(points_cam)
        except (TypeError, ValueError, OverflowError):
            raise CameraError(f"points: expected shape (N, 3), found {short(points_cam)}") from None
        if points.ndim != 2 or points.shape[1] != 3:
            raise CameraError(f"points: expected shape (N, 3), found {points.shape}")
        # What is not finite anywhere is not in the sum.
        if not len(points) or (points[:, 2].min() > 0.0 and math.isfinite(points.sum())):
            return self._seen(points)
        pixels = np.full((len(points), 2), np.nan)
        front = np.isfinite(points).all(axis=1) & (points[:, 2] > 0.0)
        if front.any():
            pixels[front] = self._seen(points[front])
        return pixels

    def rays(self) -> npt.NDArray[np.float32]:
        """Normalized image coordinates x/z, y/z of every pixel centre, lens distortion removed.

        Returns:
            (height, width, 2) float32, read-only and cached; depth (along z) times (x, y, 1) is the point. NaN where
            the lens model cannot be inverted (it does not come back to the pixel within 0.1 px), as happens in the
            corners of strongly distorted images.
        """
        return _rays(self)

    def _seen(self, points: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """Pixels (N, 2) of points (N, 3) before the camera."""
        # Column by column: loops over rows of two are slow.
        xy = np.empty((len(points), 2))
        for axis in (0, 1):
            np.divide(points[:, axis], points[:, 2], out=xy[:, axis])
        return self._distorted(xy)

    def _distorted(self, xy: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """Pixels (N, 2) of normalized coordinates (N, 2)."""
        if not self.distorted:
            flat = np.empty_like(xy)
            for axis, (focal, centre) in enumerate(((self.fx, self.cx), (self.fy, self.cy))):
                flat[:, axis] = xy[:, axis] * focal + centre
            return flat
        if self.model == "inverse_plumb_bob":
            source = np.ascontiguousarray(xy[:, None, :])
            distorted = cv2.undistortPoints(source, np.eye(3), self._coefficients(), criteria=_UNTIL).reshape(-1, 2)
            return np.asarray(distorted * (self.fx, self.fy) + (self.cx, self.cy), dtype=np.float64)
        points = np.column_stack([xy, np.ones(len(xy))])[:, None, :]
        zero = np.zeros(3)
        if self.model == "equidistant":
            pixels, _ = cv2.fisheye.projectPoints(points, zero, zero, self.matrix, self._coefficients())
        else:
            pixels, _ = cv2.projectPoints(points, zero, zero, self.matrix, self._coefficients())
        return np.asarray(pixels, dtype=np.float64).reshape(-1, 2)

    def undistorted(self, pixels: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """Normalized coordinates x/z, y/z (N, 2) of pixels (N, 2) at any subpixel position, lens distortion removed.

        NaN where the lens model cannot be inverted, see `rays`. The shape is not checked, see voodoo.sensors.pixels.normalized.
        """
        if not self.distorted or not len(pixels):
            return np.asarray((pixels - (self.cx, self.cy)) / (self.fx, self.fy))
        if self.model == "inverse_plumb_bob":
            flat = (pixels - (self.cx, self.cy)) / (self.fx, self.fy)
            points, zero = np.column_stack([flat, np.ones(len(flat))])[:, None, :], np.zeros(3)
            found, _ = cv2.projectPoints(points, zero, zero, np.eye(3), self._coefficients())
        else:
            undistort = cv2.fisheye.undistortPoints if self.model == "equidistant" else cv2.undistortPoints
            source = np.ascontiguousarray(pixels[:, None, :])
            found = undistort(source, self.matrix, self._coefficients(), criteria=_UNTIL)
        xy = np.array(found, dtype=np.float64).reshape(-1, 2)
        with np.errstate(all="ignore"):
            error = np.abs(self._distorted(xy) - pixels).max(axis=1)
        xy[~(error < _ROUND_TRIP_PX)] = np.nan
        return xy

    def _coefficients(self) -> npt.NDArray[np.float64]:
        return np.array(self.distortion or (0.0,) * 4)


@lru_cache(maxsize=16)
def _rays(camera: Camera) -> npt.NDArray[np.float32]:
    rays = np.empty((camera.height, camera.width, 2), dtype=np.float32)
    columns = np.arange(camera.width, dtype=np.float64)
    rows_together = max(_STRIP // camera.width, 1)
    for start in range(0, camera.height, rows_together):
        rows = np.arange(start, min(start + rows_together, camera.height), dtype=np.float64)
        pixels = np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2)
        rays[start : start + len(rows)] = camera.undistorted(pixels).reshape(len(rows), camera.width, 2)
    rays.setflags(write=False)
    return rays


def _number(name: str, value: object) -> float:
    try:
        number = float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        raise CameraError(f"{name}: expected a number, found {short(value)}") from None
    if not math.isfinite(number):
        raise CameraError(f"{name}: expected a finite number, found {number!r}")
    return number


def _numbers(name: str, values: Any, *, count: int | None = None) -> tuple[float, ...]:  # noqa: ANN401 - checked here
    """The numbers of an iterable, or of an array of any shape row by row."""
    try:
        rows = as_numbers(values if hasattr(values, "__len__") else list(values))
    except (TypeError, ValueError, OverflowError):
        raise CameraError(f"{name}: expected numbers, found {short(values)}") from None
    if count is not None and rows.size != count:
        raise CameraError(f"{name}: expected {count} numbers, found {rows.size}")
    return tuple(_number(name, value) for value in rows.reshape(-1).tolist())
