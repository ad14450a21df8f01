"""Drawing interfaces of adapters; `voodoo.visualization` implements them for images and Rerun streams."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Protocol, TypeAlias, TypeVar

import numpy as np
import numpy.typing as npt

from voodoo.measurements import ColorImage, DepthImage, KeypointImage
from voodoo.sensors.pixels import FloatArray

Pixel = TypeVar("Pixel", bound=np.generic)
Color: TypeAlias = tuple[int, int, int]
Pictured: TypeAlias = DepthImage | ColorImage | KeypointImage
"""Measurements of a camera."""


class Canvas(Protocol):
    """An overlay: the picture of one camera, or a view from above."""

    def dots(self, points_root: FloatArray, *, color: Color, radius: int) -> None:
        """Points (N, 3) [m] of the root frame as dots; colors are BGR, radii pixels."""

    def rings(self, item: Pictured, pixels: FloatArray, strengths: FloatArray, *, color: Color) -> None:
        """Rings about pixels (N, 2) of a camera, fainter with less strength (N,), if this is its picture."""

    def regions(
        self,
        item: Pictured,
        mask: npt.NDArray[np.bool_],
        *,
        marks: Sequence[tuple[float, float]],
        names: Mapping[str, tuple[float, float]],
        color: Color,
    ) -> None:
        """Outlines of a mask (H, W), dots at pixels, and names beside others, if this is the sensor's own picture."""


class Log(Protocol):
    """One step in Rerun."""

    @property
    def rr(self) -> Any:  # noqa: ANN401 - Rerun is optional
        """The module `rerun`."""

    @property
    def limbs(self) -> int:
        """How many limbs the body has."""

    @property
    def most_points(self) -> int:
        """Greatest number of points shown of a cloud or an image; larger ones are subsampled."""

    def send(self, path: str, *archetypes: Any) -> None:  # noqa: ANN401 - Rerun's own
        """Log archetypes of Rerun at a path."""

    def entity(self, sensor: str) -> str:
        """A sensor's name as part of a path."""

    def camera(self, item: Pictured) -> str:
        """Log pose and calibration of a camera; returns the path of its image."""

    def silhouettes(self, path: str, item: Pictured) -> None:
        """Log the silhouettes of the limbs in the camera's image at a path."""

    def depth(self, path: str, image: npt.NDArray[Any], meters_per_unit: float) -> None:
        """Log a depth image (H, W), compressed: to a quarter of a percent, and in a file not more pixels than `most_points`."""

    def body_points(
        self, path: str, points: npt.NDArray[Any], pose: FloatArray, *, background: bool = True
    ) -> npt.NDArray[np.intp]:
        """Log points (N, 3) of a sensor at `pose` (4, 4), colored by limb, those on none only with `background`; the limb of
        each (N,), `limbs`: none."""


def every(pixels: int, most: int) -> int:
    """Returns the subsampling step of rows and columns that reduces an image to approximately `most` pixels."""
    return math.ceil(math.sqrt(pixels / most))


def grown(image: npt.NDArray[Pixel], step: int, shape: tuple[int, ...]) -> npt.NDArray[Pixel]:
    """Enlarges a subsampled image (every `step`-th row and column) to `shape` (H, W) by repeating its pixels."""
    return image.repeat(step, axis=0).repeat(step, axis=1)[: shape[0], : shape[1]]
