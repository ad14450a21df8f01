"""Converts the keypoints of an image to pixels of body sites."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

import voodoo._core as _core
from voodoo.errors import MeasurementError
from voodoo.model.camera import Camera
from voodoo.model.transforms import rigid
from voodoo.recordings.keypoint_layouts import layout_of
from voodoo.sensors.keypoints.surface import behind_surface

MIN_CONFIDENCE = 0.1
"""Keypoints with a lower confidence are not used."""


@dataclass(frozen=True, eq=False)
class SitePixel:
    """A site detected in an image: pixel (u, v), confidence in (0, 1], and spread of the feature around the site [m]."""

    site: str
    pixel: tuple[float, float]
    confidence: float
    spread: float


def site_pixels(
    keypoints: npt.ArrayLike, *, layout: str, min_confidence: float = MIN_CONFIDENCE
) -> tuple[list[SitePixel], list[str]]:
    """Returns the sites that a network detected.

    Args:
        keypoints: (K, 3) rows (u, v, confidence), pixels; (0, 0, 0) or NaN = not detected.
        layout: name in LAYOUTS.
        min_confidence: a site with any keypoint below this confidence is not detected.

    Returns:
        The detected sites, and the names of the others. The confidence of a site defined by several keypoints is the least
        of theirs.

    Raises:
        MeasurementError: unknown layout, wrong shape or no finite least confidence.
    """
    check_confidence(min_confidence)
    parts = layout_of(layout).parts
    found = compiled(layout).pixels(checked_rows(keypoints, layout), min_confidence)
    observed = [SitePixel(part.site, *of, part.spread) for part, of in zip(parts, found, strict=True) if of is not None]
    return observed, [part.site for part, of in zip(parts, found, strict=True) if of is None]


def checked_rows(keypoints: npt.ArrayLike, layout: str) -> npt.NDArray[np.float64]:
    """Keypoints (K, 3) of a layout, contiguous.

    Raises:
        MeasurementError: unknown layout, or another shape.
    """
    count = layout_of(layout).count
    try:
        rows = np.ascontiguousarray(keypoints, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise MeasurementError(f"keypoints: expected numbers (u, v, confidence), found {keypoints!r}") from error
    if rows.shape != (count, 3):
        raise MeasurementError(f"keypoints: expected shape ({count}, 3) for {layout}, found {rows.shape}")
    return rows


@lru_cache(maxsize=32)
def compiled(layout: str) -> _core.KeypointLayout:
    """The core's object for a layout."""
    return _core.KeypointLayout(
        [
            (part.site, list(part.weights.items()), part.spread, behind_surface(part.site))
            for part in layout_of(layout).parts
        ]
    )


def check_confidence(least: object) -> None:
    """Check that a least confidence is a finite number.

    Raises:
        MeasurementError: it is not.
    """
    # No comparison with NaN is true: every keypoint would pass.
    if not isinstance(least, (int, float, np.floating)) or not math.isfinite(least):
        raise MeasurementError(f"min_confidence: expected a finite number, found {least!r}")


def nearest_person(
    people: Sequence[npt.NDArray[np.float64]],
    *,
    layout: str,
    camera: Camera,
    world_from_sensor: npt.ArrayLike,
    predicted: Mapping[str, npt.NDArray[np.float64]],
) -> npt.NDArray[np.float64] | None:
    """The person (K, 3) whose keypoints lie nearest to the predicted sites in the image, by the median distance; None
    if none.

    Raises:
        MeasurementError: wrong shapes, or an unknown layout.
    """
    pose = rigid(world_from_sensor)
    nearest = compiled(layout).nearest(
        [checked_rows(person, layout) for person in people],
        predicted,
        world_from_sensor=pose,
        camera=camera,
        least=MIN_CONFIDENCE,
    )
    return None if nearest is None else people[nearest]
