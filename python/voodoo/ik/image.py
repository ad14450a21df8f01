"""Calibrated silhouettes and their signed Euclidean distance transform."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
import numpy.typing as npt

import voodoo._core as _core
from voodoo.errors import MeasurementError, of_kind
from voodoo.ik.values import numbers
from voodoo.model.camera import Camera, pixels_seen
from voodoo.model.transforms import inverse, rigid

_UNDISTORTED = 0.5
_MIDDLE = 0.3
"""A pixel belongs to the medial axis if no step of one pixel increases the distance by more than the step minus this value; a
smaller value gives more such pixels."""
_WIDEST = 1000.0
_SUBPIXEL_BITS = 4


class Silhouette:
    """The person's silhouette in one calibrated image, as its Euclidean distance transform (J10 section 3)."""

    def __init__(
        self,
        mask: npt.ArrayLike,
        *,
        camera: Camera,
        world_from_camera: npt.ArrayLike,
        border: float = 1.0,
        depth: npt.ArrayLike | None = None,
    ) -> None:
        """Transform a mask, after removing the lens distortion from mask and depths.

        Args:
            mask: (height, width), true (or not 0) where the person is.
            camera: its calibration.
            world_from_camera: rigid (4, 4) pose of the optical frame.
            border: error of the silhouette's contour [px], including that of the calibration. It is the tolerance for the depth
                of bones inside the silhouette and for their centering.
            depth: (height, width) floats, along the optical axis [m] from a depth camera, 0 or not finite where nothing
                returned. Bones must also lie behind this surface, and not farther than it where the silhouette is the limb
                itself.

        Raises:
            MeasurementError: the border is no number of pixels, mask or depth have not the camera's size, depths are
                whole numbers (millimeters) or negative, or the pose is not rigid.
        """
        of_kind("camera", camera, Camera, MeasurementError)
        person = np.asarray(mask)
        if person.shape != (camera.height, camera.width):
            raise MeasurementError(
                f"mask: expected shape {(camera.height, camera.width)} of its camera, found {person.shape}"
            )
        if person.dtype.kind not in "buif" or not np.isfinite(person).all():
            raise MeasurementError(f"mask: expected true and false, or finite numbers, found {person.dtype} or NaN")
        person = (person != 0).astype(np.uint8)
        if camera.distorted:
            person = _undistorted(person, camera)
        if not (isinstance(border, (int, float)) and 0.0 <= border <= _WIDEST):
            raise MeasurementError(f"border: expected 0 to {_WIDEST:g} pixels, found {border!r}")
        self.camera = camera
        self.border = float(border)
        self.distance: npt.NDArray[np.float32] = signed_distance(person)
        self.distance.setflags(write=False)
        self.thickness: npt.NDArray[np.float32] = local_thickness(self.distance)
        self.thickness.setflags(write=False)
        # An image without the person gives no evidence and is not used.
        self.empty = not person.any()
        pose = rigid(world_from_camera, name="world_from_camera")
        observed = None if depth is None else _depths(depth, camera, person)
        self.core = _core.View(self.distance, self.thickness, observed, self.border, _pinhole(camera), inverse(pose))

    def __repr__(self) -> str:
        """Size, and whether it contains a person."""
        height, width = self.distance.shape
        return f"Silhouette({width}x{height}, {'empty' if self.empty else 'a person'})"


def core_views(images: Sequence[Silhouette]) -> list[_core.View]:
    """The silhouettes that contain a person, in the form that the core takes.

    Raises:
        MeasurementError: the arguments are not silhouettes.
    """
    if not isinstance(images, Sequence) or not all(isinstance(image, Silhouette) for image in images):
        raise MeasurementError(f"images: expected a list of ik.Silhouette, found {images!r}")
    return [image.core for image in images if not image.empty]


def signed_distance(mask: npt.NDArray[np.uint8]) -> npt.NDArray[np.float32]:
    """Distance (height, width) [px] to the border of a mask, negative inside; zero is half-way between two
    pixels."""
    if mask.all():
        return np.full(mask.shape, -float(max(mask.shape)), dtype=np.float32)
    if not mask.any():
        return np.zeros(mask.shape, dtype=np.float32)
    outside, inside = _distance_to_zero(mask == 0), _distance_to_zero(mask != 0)
    distance = np.where(mask != 0, 0.5 - inside, outside - 0.5)
    return np.ascontiguousarray(distance, dtype=np.float32)


def _distance_to_zero(mask: npt.NDArray[np.bool_]) -> npt.NDArray[np.float32]:
    """Distance (height, width) [px] of every pixel to the nearest one that is not set.

    Without Intel's IPP, whose answer may differ in the last bit from run to run; it is no faster here.
    """
    used = cv2.ipp.useIPP()
    cv2.ipp.setUseIPP(False)
    try:
        return cv2.distanceTransform(mask.astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)  # type: ignore[return-value]
    finally:
        cv2.ipp.setUseIPP(used)


def local_thickness(distance: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """Half the local width (height, width) [px] of the inside of a signed distance: of every pixel the radius of the largest
    disc within the silhouette that covers it; 0 outside. Exact to half a pixel."""
    inside = np.maximum(-distance, np.float32(0.0))
    thickness = np.zeros(distance.shape, dtype=np.float32)
    # Discs around the pixels of the medial axis cover the silhouette. A pixel is on it if no neighbor's disc contains its own.
    padded = np.pad(inside, 1)
    middle = inside > 0.0
    height, width = distance.shape
    for dv in (-1, 0, 1):
        for du in (-1, 0, 1):
            if du or dv:
                beside = padded[1 + dv : 1 + dv + height, 1 + du : 1 + du + width]
                middle &= beside < inside + (np.hypot(du, dv) - _MIDDLE)
    rows, columns = np.nonzero(middle)
    radii = inside[rows, columns]
    order = np.argsort(radii, kind="stable")
    one = 1 << _SUBPIXEL_BITS
    for u, v, radius in zip(columns[order].tolist(), rows[order].tolist(), radii[order].tolist(), strict=True):
        cv2.circle(thickness, (u * one, v * one), round(radius * one), radius, cv2.FILLED, shift=_SUBPIXEL_BITS)
    return np.where(inside > 0.0, np.maximum(thickness, inside), np.float32(0.0)).astype(np.float32)


def _depths(depth: npt.ArrayLike, camera: Camera, person: npt.NDArray[np.uint8]) -> npt.NDArray[np.float32]:
    """Depths of the person in the form that the core takes: zero where there is none."""
    if isinstance(depth, np.ndarray) and depth.dtype.kind in "iu":
        raise MeasurementError(
            f"depth: expected meters, as floats, found {depth.dtype}: multiply by the meters of a unit"
        )
    found = np.nan_to_num(numbers("depth", depth), nan=0.0, posinf=0.0, neginf=0.0)
    if found.shape != (camera.height, camera.width) or (found < 0.0).any():
        raise MeasurementError(
            f"depth: expected meters of shape {(camera.height, camera.width)} of its camera, found {found.shape}, "
            f"{int((found < 0.0).sum())} of them negative"
        )
    if camera.distorted:
        # Interpolation would give depths between two surfaces.
        at = pixels_seen(camera, _pinhole(camera))
        found = np.asarray(cv2.remap(found, at[..., 0], at[..., 1], cv2.INTER_NEAREST), dtype=np.float64)
    # Outside the person the silhouette gives the evidence.
    return np.ascontiguousarray(np.where(person != 0, found, 0.0), dtype=np.float32)


def _pinhole(camera: Camera) -> Camera:
    """The camera without lens distortion."""
    return replace(camera, distortion=(), model="plumb_bob")


def _undistorted(mask: npt.NDArray[np.uint8], camera: Camera) -> npt.NDArray[np.uint8]:
    """The mask as a pinhole camera of the same focal lengths and center would see it."""
    at = pixels_seen(camera, _pinhole(camera))
    soft = cv2.remap(mask.astype(np.float32), at[..., 0], at[..., 1], cv2.INTER_LINEAR)
    return np.asarray(soft >= _UNDISTORTED, dtype=np.uint8)
