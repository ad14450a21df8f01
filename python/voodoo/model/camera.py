"""The camera model: pixels from points and rays from pixels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

import voodoo._core as _core
from voodoo.errors import CameraError, of_kind
from voodoo.model.joint import as_numbers, number_of, numbers_of, short

CameraModel = Literal["plumb_bob", "rational_polynomial", "equidistant", "inverse_plumb_bob"]
"""Lens models of sensor_msgs/CameraInfo: Brown-Conrady (k1 k2 p1 p2 k3), the same with k4 k5 k6 in the denominator
(and optionally thin prism and tilt, in OpenCV's order), and Kannala-Brandt (k1 k2 k3 k4 on the angle); and Brown-Conrady
from distorted to undistorted coordinates, the calibration of RealSense's color cameras."""

LENS_NAMES = {
    "": "plumb_bob", "none": "plumb_bob", "radtan": "plumb_bob", "fisheye": "equidistant", "kannala_brandt4": "equidistant",
    # librealsense's; its modified model differs by products of the radial and the tangential part only
    "None": "plumb_bob", "Brown Conrady": "plumb_bob", "Modified Brown Conrady": "plumb_bob",
    "Inverse Brown Conrady": "inverse_plumb_bob", "Kannala Brandt4": "equidistant",
}  # fmt: skip
"""Other names of lens models."""
MOST_PIXELS = 2**25
"""Maximum number of pixels: those of an 8K image. Larger sizes are errors; the core has the same limit."""


@dataclass(frozen=True)
class Camera:
    """A calibrated camera in its optical frame: x right, y down, z forward.

    Integer pixel coordinates are pixel centers; (0, 0) is the center of the top-left pixel. Without distortion
    u = fx x/z + cx and v = fy y/z + cy. Projections and rays are those of the compiled core, which all parts of the
    tracker use.

    Args:
        width, height: image size [px].
        fx, fy: focal lengths [px].
        cx, cy: principal point [px].
        distortion: coefficients in OpenCV's order; () means none.
        model: lens model of `distortion`, see CameraModel.

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
        """Store plain ints and floats, so that equal cameras compare equal; the core checks their ranges."""
        for name in ("width", "height"):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or not 1 <= value <= MOST_PIXELS:
                raise CameraError(
                    f"camera {name}: expected a whole number of pixels, 1 to {MOST_PIXELS}, found {short(value)}"
                )
            object.__setattr__(self, name, int(value))
        for name in ("fx", "fy", "cx", "cy"):
            object.__setattr__(self, name, number_of(f"camera {name}", getattr(self, name), error=CameraError))
        of_kind("camera model", self.model, str, CameraError)
        object.__setattr__(self, "distortion", _numbers("camera distortion", self.distortion))
        _core_of(self)
        # For the polynomial models zeros mean "no lens distortion"; for the equidistant one they mean a pure
        # equidistant lens, which is not a pinhole, so they have to stay.
        if self.model != "equidistant" and not any(self.distortion):
            object.__setattr__(self, "distortion", ())

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
                names are accepted, too.
            p: 3x4 projection matrix of the rectified image, row by row: 12 numbers, or (3, 4).
            rectified: the image is rectified: use `p` (if it is set) and no distortion.

        Raises:
            CameraError: not numbers, wrong counts, an uncalibrated camera (fx = 0), or an unknown model.
        """
        k = _numbers("camera k", k, count=9)
        if rectified and p is not None:
            projection = _numbers("camera p", p, count=12)
            if projection[0] > 0.0:  # an all-zero P means "not filled in"
                return cls(width, height, projection[0], projection[5], projection[2], projection[6])
        name = LENS_NAMES.get(model, model)
        d = _numbers("camera d", d)
        coefficients = () if model in ("", "none") and not any(d) else d
        return cls(width, height, k[0], k[4], k[2], k[5], coefficients, name)  # type: ignore[arg-type]

    @property
    def distorted(self) -> bool:
        """Whether the projection differs from u = fx x/z + cx, v = fy y/z + cy."""
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
            (N, 2) pixel coordinates (u, v), not clipped to the image; NaN for points at or behind z = 0, and beyond the
            radius at which the distortion function stops increasing, where two directions would have the same pixel.

        Raises:
            CameraError: the shape is not (N, 3).
        """
        points = numbers_of("points", points_cam, CameraError, "shape (N, 3)")
        if points.ndim != 2 or points.shape[1] != 3:
            raise CameraError(f"points: expected shape (N, 3), found {points.shape}")
        return self.core.project(np.ascontiguousarray(points, dtype=np.float64))

    def rays(self) -> npt.NDArray[np.float32]:
        """Normalized image coordinates x/z, y/z of every pixel center, lens distortion removed.

        Returns:
            (height, width, 2) float32, read-only and cached; depth (along z) times (x, y, 1) is the point. NaN where
            the lens model has no direction, as in the corners of strongly distorted images.
        """
        return _rays(self)

    def undistorted(self, pixels: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """Normalized coordinates x/z, y/z (N, 2) of pixels (N, 2) at any subpixel position, lens distortion removed.

        NaN where the lens model has no direction, see `rays`.

        Raises:
            CameraError: the shape is not (N, 2).
        """
        if pixels.ndim != 2 or pixels.shape[1] != 2:
            raise CameraError(f"pixels: expected shape (N, 2), found {pixels.shape}")
        return self.core.undistorted(np.ascontiguousarray(pixels, dtype=np.float64))

    @cached_property
    def core(self) -> _core.Camera:
        """The camera of the compiled core."""
        return _core_of(self)


@lru_cache(maxsize=16)
def _core_of(camera: Camera) -> _core.Camera:
    """Cached, so that equal cameras share it and its rays."""
    intrinsics = (camera.fx, camera.fy, camera.cx, camera.cy)
    return _core.Camera(camera.width, camera.height, intrinsics, camera.model, camera.distortion)


@lru_cache(maxsize=16)
def _rays(camera: Camera) -> npt.NDArray[np.float32]:
    rays = camera.core.rays()
    rays.setflags(write=False)
    return rays


@lru_cache(maxsize=8)
def pixels_seen(camera: Camera, other: Camera) -> npt.NDArray[np.float32]:
    """Pixels (H, W, 2) in the images of a camera for each pixel of another one at its place, for `cv2.remap`; outside where the
    lens has none. Cached, because it takes long."""
    rays = other.rays().reshape(-1, 2)
    pixels = np.nan_to_num(camera.project(np.column_stack([rays, np.ones(len(rays))])), nan=-1e3)
    at = pixels.astype(np.float32).reshape(other.height, other.width, 2)
    at.setflags(write=False)
    return at


def _numbers(name: str, values: Any, *, count: int | None = None) -> tuple[float, ...]:  # noqa: ANN401 - checked here
    """The numbers of an iterable, or of an array of any shape row by row."""
    try:
        rows = as_numbers(values if hasattr(values, "__len__") else list(values))
    except (TypeError, ValueError, OverflowError):
        raise CameraError(f"{name}: expected numbers, found {short(values)}") from None
    if count is not None and rows.size != count:
        raise CameraError(f"{name}: expected {count} numbers, found {rows.size}")
    if not np.isfinite(rows).all():
        raise CameraError(f"{name}: expected finite numbers, found {short(values)}")
    return tuple(rows.reshape(-1).tolist())
