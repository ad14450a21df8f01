"""MediaPipe's pose landmarks (BlazePose)."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from voodoo.errors import ConfigError, installed

_MOST = 6
"""Persons that a pose landmarker may find in an image."""
_CERTAIN = 0.67
"""Greatest confidence: a visibility of 1 does not say how exact a landmark is. With 6 px instead of 4 px of noise rendered
people are followed best."""
_PAGE = "https://ai.google.dev/edge/mediapipe/solutions/vision/pose_landmarker"


class MediaPipe:
    """Pose landmarker of MediaPipe; images are unrelated to each other, so that one object serves several cameras.

    Args:
        model: a pose landmarker (.task). Empty: the network that MediaPipe ships, up to its version 0.10.2x; it finds one
            person.

    Raises:
        ConfigError: MediaPipe or a network is missing, or the file is none.
    """

    layout = "blazepose33"

    def __init__(self, model: str) -> None:
        """Load the network."""
        missing = "mediapipe: expected the package, found none; pip install 'voodoo-tracker[mediapipe]'"
        self._mediapipe = mediapipe = installed("mediapipe", missing, error=ConfigError)
        self._landmarker: Any = None
        if model:
            from mediapipe.tasks.python import BaseOptions, vision

            try:
                base = BaseOptions(model_asset_buffer=Path(model).read_bytes())
                options = vision.PoseLandmarkerOptions(base_options=base, num_poses=_MOST)
                self._landmarker = vision.PoseLandmarker.create_from_options(options)
            except Exception as error:  # those of MediaPipe share no other class
                raise ConfigError(f"{model}: expected a pose landmarker of MediaPipe, found: {error}") from error
        elif hasattr(mediapipe, "solutions"):
            self._shipped: Any = mediapipe.solutions.pose.Pose(static_image_mode=True)
        else:
            raise ConfigError(
                f"mediapipe: expected mediapipe:FILE.task, a pose landmarker of {_PAGE}, found none; MediaPipe "
                f"{mediapipe.__version__} ships no network"
            )

    def __call__(self, image: npt.NDArray[np.uint8]) -> Iterator[npt.NDArray[np.float64]]:
        """See `Detect`."""
        height, width = image.shape[:2]
        image = np.ascontiguousarray(image[:, :, ::-1])
        if self._landmarker is not None:
            form = self._mediapipe.ImageFormat.SRGB
            people = self._landmarker.detect(self._mediapipe.Image(image_format=form, data=image)).pose_landmarks
        else:
            found = self._shipped.process(image).pose_landmarks
            people = [] if found is None else [found.landmark]
        for marks in people:
            # Shares of the image, from the outer edge of the first pixel.
            rows = [(one.x * width - 0.5, one.y * height - 0.5, _CERTAIN * (one.visibility or 0.0)) for one in marks]
            yield np.array(rows)
