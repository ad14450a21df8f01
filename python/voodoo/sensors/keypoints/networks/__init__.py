"""Networks that find 2-D keypoints in color images, as sources of keypoint images: one file for each library."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any, TypeAlias

import numpy.typing as npt

from voodoo.errors import ConfigError, MeasurementError, RecordingError
from voodoo.measurements import ByteImage, ColorImage, KeypointImage, Measurement, RecordedFrame
from voodoo.recordings.keypoint_layouts import layout_of
from voodoo.sensors.keypoints.sites import checked_rows

Detect: TypeAlias = Callable[[ByteImage], Iterable[npt.ArrayLike]]
"""Takes an image (H, W, 3) BGR uint8; returns one array (K, 3) of (u, v, confidence) for each person: pixels, the center of the
first one is (0, 0), and a number from 0 to 1; rows of zeros were not detected."""
NETWORKS = {"mediapipe": "MediaPipe", "rtmpose": "RtmPose"}
"""Name, which is that of the module here, -> class, which is made of the words after the colon."""


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
            # Copies: a network may return the same array for every image.
            people = tuple(checked_rows(rows, self.layout).copy() for rows in self.detect(image))
        except Exception as error:
            found = error if isinstance(error, MeasurementError) else f"{type(error).__name__}: {error}"
            raise MeasurementError(f"{self.name}: {found}") from error
        return KeypointImage.of(item, people, self.layout)

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
            try:
                if isinstance(item, ColorImage) and f"{item.sensor}/keypoints" not in known:
                    items.append(self.keypoints(item))
                items.append(item)
            except RecordingError as error:
                if refused is None:
                    raise
                refused(error)
        return tuple(items)


def network_of(word: str, *, layout: str | None = None) -> KeypointNetwork:
    """The network of a word: "NAME", "NAME:WORDS", or "MODULE:FUNCTION", which may be in the current folder.

    Args:
        word: as it was given.
        layout: of the keypoints; None: the attribute `layout` of the function.

    Raises:
        ConfigError: an unknown network, one that cannot be loaded, or no layout.
        MeasurementError: an unknown layout.
    """
    name, _, words = word.partition(":")
    if name in NETWORKS:
        detect: Any = getattr(import_module(f"{__package__}.{name}"), NETWORKS[name])(words)
    elif words:
        detect = _own(name, words)
    else:
        known = ", ".join(NETWORKS)
        raise ConfigError(f"keypoints: expected SENSOR=FOLDER, {known} or MODULE:FUNCTION, found {word!r}")
    chosen = layout or getattr(detect, "layout", None)
    if not callable(detect) or not isinstance(chosen, str):
        found = "none" if callable(detect) else type(detect).__name__
        raise ConfigError(f"{word}: expected a function with a layout, its attribute or --layout, found {found}")
    return KeypointNetwork(word, detect, chosen)


def _own(module: str, function: str) -> Any:  # noqa: ANN401 - it is checked by the caller
    here = str(Path.cwd())
    sys.path.append(here)
    try:
        found: Any = import_module(module)
        for name in function.split("."):
            found = getattr(found, name)
    except Exception as error:
        what = f"{type(error).__name__}: {error}"
        raise ConfigError(f"{module}:{function}: expected something that can be imported, found {what}") from error
    finally:
        sys.path.remove(here)
    return found
