"""Silhouettes from static colour cameras by background subtraction."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from voodoo.errors import MeasurementError

ByteImage = npt.NDArray[np.uint8]


class Silhouettes:
    """What moves in front of a background that does not, for one camera that stands still.

    A mixture of Gaussians for each pixel (Zivkovic 2004, OpenCV's MOG2) learns the background; shadows do not count,
    specks are removed and holes closed. A person who stands still for `seconds` starts to become background, unless
    `learn` is False.

    Args:
        rate_hz: pictures a second.
        seconds: memory of the background [s].
        smallest: regions of less area are specks [px].

    Raises:
        MeasurementError: a number that is not above zero.
    """

    def __init__(self, *, rate_hz: float = 30.0, seconds: float = 20.0, smallest: int = 100) -> None:
        """Start without a background."""
        if not (rate_hz > 0.0 and seconds > 0.0 and smallest > 0):
            raise MeasurementError(
                f"silhouettes: expected numbers > 0, found rate {rate_hz!r}, seconds {seconds!r}, smallest {smallest!r}"
            )
        self._model = cv2.createBackgroundSubtractorMOG2(
            history=max(round(rate_hz * seconds), 2), varThreshold=25.0, detectShadows=True
        )
        self._smallest = smallest
        self._shape: tuple[int, ...] | None = None

    def apply(self, image: ByteImage, *, learn: bool = True) -> npt.NDArray[np.bool_]:
        """(H, W): True where something stands in front of the background.

        Args:
            image: (H, W, 3) BGR uint8.
            learn: take the picture up into the background; False once the person is there and the background known.

        Raises:
            MeasurementError: another type, or another size than before.
        """
        if image.dtype != np.uint8 or image.ndim != 3 or image.shape[2] != 3:
            raise MeasurementError(f"image: expected (H, W, 3) uint8, found {image.dtype} of {image.shape}")
        if self._shape is not None and image.shape != self._shape:
            raise MeasurementError(f"image: expected {self._shape} as before, found {image.shape}")
        self._shape = image.shape
        moving = (np.asarray(self._model.apply(image, learningRate=-1.0 if learn else 0.0)) == 255).astype(np.uint8)
        kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (5, 5))
        moving = np.asarray(cv2.morphologyEx(cv2.medianBlur(moving, 5), cv2.MORPH_CLOSE, kernel), dtype=np.uint8)
        _, labels, stats, _ = cv2.connectedComponentsWithStats(moving, connectivity=8)
        large = stats[:, cv2.CC_STAT_AREA] >= self._smallest
        large[0] = False  # label 0 is the background
        return np.asarray(large[labels])
