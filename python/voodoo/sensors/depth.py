"""Filters depth images before they become points: removes flying pixels at depth edges, and pixels out of range."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from voodoo.errors import MeasurementError
from voodoo.measurements import DepthArray, DepthImage, FloatArray
from voodoo.model.joint import number_of
from voodoo.model.projection import transform
from voodoo.sensors.pixels import in_sensor

_BOX_STEPS, _BOX_MARGIN_PX, _BOX_NEAREST_M = 5, 8, 0.1
"""Points on each edge of a box, whose straight edges a lens bends, pixels around them, and how near they may be to be used."""


@dataclass(frozen=True)
class DepthFilter:
    """Removes pixels that do not lie on a surface.

    A flying pixel of a time-of-flight camera mixes the light of two surfaces and lies between them. So along one of the
    four lines through it, one neighbor is clearly nearer and the other clearly farther. A pixel of a slanted surface has
    such neighbors too, but less than `slant` apart, and is kept. A pixel without any neighbor at its own depth is a flying
    pixel as well.

    Args:
        edge: depths that differ by more than this belong to different surfaces [m], at 1 m; it grows with the depth.
        slant: two opposite neighbors farther apart than this are two surfaces [m], at 1 m; it grows with the depth.
        nearest, farthest: range limits along the optical axis [m] (K06 III-A: 0.5 to 7.5 m).

    Raises:
        MeasurementError: limits that leave nothing, or an edge that is not above zero.
    """

    edge: float = 0.03
    slant: float = 0.08
    nearest: float = 0.3
    farthest: float = 7.5

    def __post_init__(self) -> None:
        """Check the limits."""
        for name in ("edge", "slant", "nearest", "farthest"):
            number_of(f"depth filter {name}", getattr(self, name), "a number of meters", error=MeasurementError)
        if not (0.0 <= self.nearest < self.farthest and self.edge > 0.0 and self.slant >= 2.0 * self.edge):
            raise MeasurementError(
                "depth filter: expected 0 <= nearest < farthest and 0 < 2 edge <= slant, found nearest "
                f"{self.nearest!r}, farthest {self.farthest!r}, edge {self.edge!r}, slant {self.slant!r}"
            )

    def apply(self, image: DepthArray, *, meters_per_unit: float = 0.001) -> DepthArray:
        """Returns a copy of the image (H, W) with 0 where a pixel is removed.

        Args:
            image: uint16 or float32; 0 and NaN mean "no return".
            meters_per_unit: of the image.
        """
        dropped = self.dropped(image, meters_per_unit=meters_per_unit)
        kept: DepthArray = image.copy()
        kept[dropped] = 0
        return kept

    def dropped(self, image: DepthArray, *, meters_per_unit: float = 0.001) -> npt.NDArray[np.bool_]:
        """Returns a mask (H, W): True for pixels with a return that is removed.

        Raises:
            MeasurementError: not a 2-D uint16 or float32 array, or no unit.
        """
        if not isinstance(image, np.ndarray):
            raise MeasurementError(f"depth: expected an array (H, W), found {type(image).__name__}")
        if image.ndim != 2 or image.dtype not in (np.uint16, np.float32):
            raise MeasurementError(f"depth: expected (H, W) uint16 or float32, found {image.dtype} of {image.shape}")
        if not (np.isfinite(meters_per_unit) and meters_per_unit > 0.0):
            raise MeasurementError(f"meters_per_unit: expected a finite length > 0, found {meters_per_unit!r}")
        z = image.astype(np.float32) * np.float32(meters_per_unit)
        returned = np.isfinite(z) & (z > 0.0)
        z[~returned] = 0.0
        outside = returned & ((z < self.nearest) | (z > self.farthest))
        return np.asarray(outside | (returned & self._flying(z)))

    def _flying(self, z: npt.NDArray[np.float32]) -> npt.NDArray[np.bool_]:
        height, width = z.shape
        # One ring of "no return" around, so that the borders need no special case.
        framed = cv2.copyMakeBorder(z, 1, 1, 1, 1, cv2.BORDER_CONSTANT, value=0.0)
        edge, slant = self.edge * np.maximum(z, 1.0), self.slant * np.maximum(z, 1.0)
        flying = np.zeros(z.shape, dtype=np.bool_)
        lonely = np.ones(z.shape, dtype=np.bool_)
        for dv, du in ((0, 1), (1, 0), (1, 1), (1, -1)):
            before = framed[1 - dv : 1 - dv + height, 1 - du : 1 - du + width]
            after = framed[1 + dv : 1 + dv + height, 1 + du : 1 + du + width]
            low, high = np.minimum(before, after), np.maximum(before, after)
            flying |= (low > 0.0) & (z - low > edge) & (high - z > edge) & (high - low > slant)
            lonely &= (np.abs(before - z) > edge) & (np.abs(after - z) > edge)
        return flying | lonely


def depth_points(
    depth: DepthImage, *, box: tuple[FloatArray, FloatArray] | None = None
) -> tuple[FloatArray, npt.NDArray[np.bool_]]:
    """Points (N, 3) [m] of a depth image in the root frame, row by row, and which pixels (H*W,) have them.

    Args:
        depth: the image.
        box: low and high corner [m] in the root frame; points outside may be left out, which saves their time.
    """
    rows, columns, near, far = (slice(None), slice(None), 0.0, np.inf) if box is None else _window(depth, box)
    z = depth.image[rows, columns].astype(np.float64) * depth.meters_per_unit
    valid = np.zeros(depth.image.shape, dtype=bool)
    valid[rows, columns] = np.isfinite(z) & (z > 0.0) & (z >= near) & (z <= far)
    rays = depth.camera.rays().reshape(*valid.shape, 2)[valid]
    finite = np.isfinite(rays).all(axis=1)
    z, rays = z[valid[rows, columns]][finite], rays[finite]
    valid[valid] = finite
    return transform(depth.root_from_sensor, np.column_stack([rays, np.ones(len(rays))]) * z[:, None]), valid.ravel()


def _window(depth: DepthImage, box: tuple[FloatArray, FloatArray]) -> tuple[slice, slice, float, float]:
    """Rows, columns, nearest and farthest depth [m] at which a camera sees a box; all pixels if it reaches behind the camera."""
    sides = (np.linspace(low, high, _BOX_STEPS) for low, high in zip(*box, strict=True))
    inside = in_sensor(depth.root_from_sensor, np.array(np.meshgrid(*sides)).reshape(3, -1).T)
    near, far = float(inside[:, 2].min()), float(inside[:, 2].max())
    pixels = depth.camera.project(inside)
    if near < _BOX_NEAREST_M or not np.isfinite(pixels).all():
        return slice(None), slice(None), near, far
    low, high = pixels.min(axis=0) - _BOX_MARGIN_PX, pixels.max(axis=0) + _BOX_MARGIN_PX
    (left, top), (right, bottom) = np.clip([low, high], 0, depth.image.shape[::-1]).astype(int)
    return slice(top, bottom), slice(left, right), near, far
