"""Undistorts images: only in a pinhole camera are the contours of limbs projections of straight lines."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from voodoo.model.camera import Camera, pixels_seen

MOST_PIXELS = 640 * 480
"""Larger images are reduced. An edge is located to a pixel or two, which at this size is a centimeter at four meters."""


class Pinhole:
    """Removes the lens distortion from the images of a camera, and reduces large ones.

    Args:
        camera: the calibrated camera.
        most: greatest number of pixels of an image that is not reduced.

    Attributes:
        original: the calibrated camera.
        camera: the pinhole camera of the images that `apply` returns, with the focal length and center scaled to their size.
    """

    def __init__(self, camera: Camera, *, most: int = MOST_PIXELS) -> None:
        """Compute the maps for undistortion."""
        self.original = camera
        fraction = min(1.0, float(np.sqrt(most / (camera.width * camera.height))))
        width, height = max(round(camera.width * fraction), 1), max(round(camera.height * fraction), 1)
        x, y = width / camera.width, height / camera.height
        cx, cy = (camera.cx + 0.5) * x - 0.5, (camera.cy + 0.5) * y - 0.5
        self.camera = Camera(width, height, camera.fx * x, camera.fy * y, cx, cy)
        self._maps: tuple[npt.NDArray[Any], npt.NDArray[Any]] | None = None
        if camera.distorted:
            # Pixels of the reduced image.
            maps = ((pixels_seen(camera, self.camera) + 0.5) * (x, y) - 0.5).astype(np.float32)
            self._maps = cv2.convertMaps(maps[..., 0], maps[..., 1], cv2.CV_16SC2)

    def apply(self, image: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
        """Returns an image (H, W, 3) of the original camera undistorted and reduced; black outside its field of view."""
        size = (self.camera.width, self.camera.height)
        if image.shape[1::-1] != size:
            image = np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)
        if self._maps is not None:
            image = np.asarray(cv2.remap(image, *self._maps, cv2.INTER_LINEAR), dtype=np.uint8)
        return image
