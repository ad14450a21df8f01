"""Silhouettes from static color cameras: differences from the background, even if the person never leaves the place."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
import numpy.typing as npt

from voodoo.errors import MeasurementError
from voodoo.measurements import ByteImage
from voodoo.sensors.silhouettes.masks import Mask, without_specks

_SMOOTH_PX = 1.5
_INPAINT_PX = 5


class StillBackground:
    """The background of one static camera: the median color of each pixel over the images in which the person cannot be there.

    Pixels without such an image (`unknown`) are inpainted from their surroundings (Telea 2004).

    Args:
        pictures: some tens of images spread over a recording, (H, W, 3) BGR uint8.
        occupied: for each image, (H, W) where the person may be; None: anywhere, so that the person must be absent from every
            pixel in more than half of the images.
        threshold: least difference of the foreground in any color channel, 0 to 255.
        chroma: least difference in chroma (CIE 1976 a*, b*), an alternative to `threshold` that is independent of lightness:
            skin in the shade is as dark as a dark floor, but redder.
        smallest: regions of less area are specks [px].

    Raises:
        MeasurementError: no image, images or masks of different sizes, a number that cannot be used, or a person who may be
            everywhere in all images.
    """

    def __init__(
        self,
        pictures: Sequence[ByteImage],
        *,
        occupied: Sequence[Mask] | None = None,
        threshold: float = 30.0,
        chroma: float = 8.0,
        smallest: int = 100,
    ) -> None:
        """Learn the background; see the class."""
        if not pictures:
            raise MeasurementError("pictures: expected some, found none")
        if not (0.0 < threshold < 255.0 and chroma > 0.0 and smallest > 0):
            raise MeasurementError(
                f"background: expected threshold 0 to 255, chroma and smallest > 0, found {threshold!r}, {chroma!r}, "
                f"{smallest!r}"
            )
        for picture in pictures:
            _check(picture, pictures[0].shape)
        if occupied is not None and [mask.shape for mask in occupied] != [picture.shape[:2] for picture in pictures]:
            raise MeasurementError(f"occupied: expected {len(pictures)} masks of the pictures' size, found others")
        stack = np.stack([_smooth(picture) for picture in pictures]).astype(np.float32)
        if occupied is not None:
            stack[np.stack(occupied)] = np.nan
        # Sorting puts NaN last, so the median of what is left is in the middle of the valid ones.
        free = np.isfinite(stack[..., 0]).sum(axis=0)
        middle = np.maximum(free - 1, 0) // 2
        median = np.take_along_axis(np.sort(stack, axis=0), middle[None, ..., None], axis=0)[0]
        self.unknown: Mask = np.asarray(free == 0, dtype=bool)
        if self.unknown.all():
            raise MeasurementError("occupied: expected pixels where the person is not in some picture, found none")
        hidden = self.unknown.astype(np.uint8)
        self._background = cv2.inpaint(np.nan_to_num(median).astype(np.uint8), hidden, _INPAINT_PX, cv2.INPAINT_TELEA)
        self._colors = _colors(np.asarray(self._background, dtype=np.uint8))
        self._shape, self._threshold, self._chroma, self._smallest = pictures[0].shape, threshold, chroma, smallest

    def mask(self, picture: ByteImage) -> Mask:
        """(H, W): True where the picture differs from the background.

        Raises:
            MeasurementError: another type or size than the background's.
        """
        _check(picture, self._shape)
        smooth = _smooth(picture)
        differs = cv2.absdiff(smooth, self._background).max(axis=2) > self._threshold
        # The chroma threshold is low and smoothing spreads vivid colors by a pixel, so the mask is eroded.
        colorful = np.linalg.norm(_colors(smooth) - self._colors, axis=2) > self._chroma
        differs |= cv2.erode(colorful.astype(np.uint8), np.ones((3, 3), dtype=np.uint8)) != 0
        ellipse = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (5, 5))
        closed = cv2.morphologyEx(differs.astype(np.uint8), cv2.MORPH_CLOSE, ellipse)
        return without_specks(np.asarray(closed != 0, dtype=bool), smallest=self._smallest)


def _check(image: ByteImage, shape: tuple[int, ...]) -> None:
    if image.dtype != np.uint8 or image.ndim != 3 or image.shape[2] != 3:
        raise MeasurementError(f"image: expected (H, W, 3) uint8, found {image.dtype} of {image.shape}")
    if image.shape != shape:
        raise MeasurementError(f"image: expected {shape} as before, found {image.shape}")


def _smooth(picture: ByteImage) -> ByteImage:
    return np.asarray(cv2.GaussianBlur(picture, (0, 0), _SMOOTH_PX), dtype=np.uint8)


def _colors(picture: ByteImage) -> npt.NDArray[np.float32]:
    """(H, W, 2): a* and b* of CIE 1976, without the lightness."""
    return cv2.cvtColor(picture.astype(np.float32) / np.float32(255.0), cv2.COLOR_BGR2LAB)[..., 1:]
