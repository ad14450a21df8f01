"""A function that finds keypoints in a color image, as a source of keypoint images."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from voodoo.errors import MeasurementError, RecordingError
from voodoo.measurements import ColorImage, KeypointImage, Measurement, RecordedFrame
from voodoo.recordings.keypoint_layouts import layout_of
from voodoo.sensors.keypoints.sites import checked_rows

Detect: TypeAlias = Callable[[npt.NDArray[np.uint8]], Iterable[npt.ArrayLike]]
"""Takes an image (H, W, 3) BGR uint8; returns one array (K, 3) of (u, v, confidence) for each person: pixels, the center of the
first one is (0, 0), and a number from 0 to 1; rows of zeros were not detected. It keeps no reference to the image."""


@dataclass(frozen=True, eq=False)
class KeypointNetwork:
    """Finds the keypoints of all persons in a color image.

    Args:
        name: name in messages.
        detect: see `Detect`.
        layout: of its keypoints, see voodoo.sensors.keypoints.LAYOUTS.

    Raises:
        MeasurementError: an unknown layout.
    """

    name: str
    detect: Detect
    layout: str

    def __post_init__(self) -> None:
        """Check the layout."""
        layout_of(self.layout)

    def keypoints(self, item: ColorImage) -> KeypointImage:
        """The keypoints in an image.

        Raises:
            RecordingError: a damaged image.
            MeasurementError: the function failed, or its result has another shape than the layout.
        """
        image = item.image
        try:
            people = tuple(checked_rows(rows, self.layout) for rows in self.detect(image))
        except MeasurementError as error:
            raise MeasurementError(f"{self.name}: {error}") from error
        except Exception as error:
            raise MeasurementError(
                f"{self.name}: expected the keypoints of an image, found {type(error).__name__}: {error}"
            ) from error
        sensor = f"{item.sensor}/keypoints"
        return KeypointImage(sensor, item.stamp, people, self.layout, item.camera, item.root_from_sensor)

    def added_to(
        self, frame: RecordedFrame, *, refused: Callable[[RecordingError], None] | None = None
    ) -> tuple[Measurement, ...]:
        """The measurements of a frame, with the keypoints of each color image before it, if it has none yet.

        Args:
            frame: is not changed.
            refused: called with the error of a damaged image, which is left out then; None: it is raised.
        """
        known = {item.sensor for item in frame.measurements if isinstance(item, KeypointImage)}
        items: list[Measurement] = []
        for item in frame.measurements:
            if isinstance(item, ColorImage) and f"{item.sensor}/keypoints" not in known:
                try:
                    items.append(self.keypoints(item))
                except RecordingError as error:
                    if refused is None:
                        raise
                    refused(error)
                    continue
            items.append(item)
        return tuple(items)
