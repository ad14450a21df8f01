"""MediaPipe's pose landmarks (BlazePose)."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from voodoo.errors import ConfigError

_MOST = 6
"""Persons that a pose landmarker may find in an image."""
_CERTAIN = 0.67
"""Greatest confidence: a visibility of 1 does not say how exact a landmark is. With 6 px instead of 4 px of noise rendered
people are followed best."""


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
        try:
            import mediapipe
        except ImportError:
            raise ConfigError(
                "mediapipe: expected the package, found none; pip install 'voodoo-tracker[mediapipe]'"
            ) from None
        self._found = _landmarker(mediapipe, Path(model)) if model else _shipped(mediapipe)

    def __call__(self, image: npt.NDArray[np.uint8]) -> Iterator[npt.NDArray[np.float64]]:
        """See `Detect`."""
        height, width = image.shape[:2]
        for marks in self._found(np.ascontiguousarray(image[:, :, ::-1])):
            # Shares of the image, from the outer edge of the first pixel.
            rows = [(one.x * width - 0.5, one.y * height - 0.5, _CERTAIN * (one.visibility or 0.0)) for one in marks]
            yield np.array(rows)


def _landmarker(mediapipe: Any, model: Path) -> Callable[[npt.NDArray[np.uint8]], Any]:  # noqa: ANN401
    from mediapipe.tasks.python import BaseOptions, vision

    try:
        base = BaseOptions(model_asset_buffer=model.read_bytes())
        options = vision.PoseLandmarkerOptions(base_options=base, num_poses=_MOST)
        network = vision.PoseLandmarker.create_from_options(options)
    except Exception as error:  # those of MediaPipe share no other class
        raise ConfigError(f"{model}: expected a pose landmarker of MediaPipe (.task), found: {error}") from error

    def found(image: npt.NDArray[np.uint8]) -> Any:  # noqa: ANN401
        picture = mediapipe.Image(image_format=mediapipe.ImageFormat.SRGB, data=image)
        return network.detect(picture).pose_landmarks

    return found


def _shipped(mediapipe: Any) -> Callable[[npt.NDArray[np.uint8]], Any]:  # noqa: ANN401
    if not hasattr(mediapipe, "solutions"):
        version = getattr(mediapipe, "__version__", "")
        raise ConfigError(
            f"mediapipe: expected mediapipe:FILE.task, a pose landmarker of "
            f"https://ai.google.dev/edge/mediapipe/solutions/vision/pose_landmarker, found none; MediaPipe {version} ships no "
            "network"
        )
    network = mediapipe.solutions.pose.Pose(static_image_mode=True)

    def found(image: npt.NDArray[np.uint8]) -> Any:  # noqa: ANN401
        marks = network.process(image).pose_landmarks
        return [] if marks is None else [marks.landmark]

    return found
