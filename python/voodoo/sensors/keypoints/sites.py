"""From the keypoints of an image to the sites that were seen in it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import median

import numpy as np
import numpy.typing as npt

from voodoo.errors import MeasurementError
from voodoo.model.camera import Camera
from voodoo.model.transforms import rigid
from voodoo.recordings.keypoint_layouts import layout_of
from voodoo.sensors.pixels import in_sensor

MIN_CONFIDENCE = 0.1
"""Keypoints that a network itself believes less than this are not measurements."""


@dataclass(frozen=True, eq=False)
class SitePixel:
    """A site seen in an image: pixel (u, v), confidence in (0, 1], and distance of the feature from the site [m]."""

    site: str
    pixel: tuple[float, float]
    confidence: float
    spread: float


def site_pixels(
    keypoints: npt.ArrayLike, *, layout: str, min_confidence: float = MIN_CONFIDENCE
) -> tuple[list[SitePixel], list[str]]:
    """Sites seen by a network.

    Args:
        keypoints: (K, 3) rows (u, v, confidence), pixels; (0, 0, 0) or NaN = not seen.
        layout: name in LAYOUTS.
        min_confidence: a site of which any keypoint has less is unseen.

    Returns:
        The sites seen, and the names of those not seen. A site made of several keypoints has the least of their
        confidences.

    Raises:
        MeasurementError: unknown layout, wrong shape or no finite least confidence.
    """
    table = layout_of(layout)
    check_confidence(min_confidence)
    try:
        rows = np.asarray(keypoints, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise MeasurementError(f"keypoints: expected numbers (u, v, confidence), found {keypoints!r}") from error
    if rows.shape != (table.count, 3):
        raise MeasurementError(f"keypoints: expected shape ({table.count}, 3) for {layout}, found {rows.shape}")
    values: list[list[float]] = rows.tolist()
    seen, unseen = [], []
    for part in table.parts:
        u = v = total = 0.0
        confidence = 1.0
        for index, share in part.shares.items():
            column, row, believed = values[index]
            u, v, total = u + share * column, v + share * row, total + believed
            confidence = min(confidence, believed)
        # What is not finite anywhere is not in the sums.
        if not math.isfinite(u + v + total) or confidence < min_confidence or confidence <= 0.0:
            unseen.append(part.site)
        else:
            seen.append(SitePixel(part.site, (u, v), confidence, part.spread))
    return seen, unseen


def check_confidence(least: object) -> None:
    """Refuse a least confidence that is no finite number.

    Raises:
        MeasurementError: it is none.
    """
    # Nothing is less than NaN: with it every keypoint would be believed.
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
    best, least = None, math.inf
    for person in people:
        seen, _ = site_pixels(person, layout=layout)
        seen = [item for item in seen if item.site in predicted]
        if not seen:
            continue
        pixels = camera.project(in_sensor(pose, [predicted[item.site] for item in seen]))
        distance = np.hypot(*(pixels - [item.pixel for item in seen]).T)
        distances = distance[np.isfinite(distance)].tolist()
        if distances and (middle := median(distances)) < least:
            best, least = person, middle
    return best
