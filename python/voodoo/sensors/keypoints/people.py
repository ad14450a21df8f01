"""Whose keypoints are whose: networks give those of several people in no order."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

import voodoo._core as _core
from voodoo.measurements import KeypointImage
from voodoo.sensors.keypoints.sites import site_pixels
from voodoo.sensors.pixels import FloatArray, ray_distance, world_rays

WRONG_M = 0.3
"""Keypoints whose rays pass a person by more than this in the median are not theirs."""
_FEWEST = 4


@dataclass(frozen=True, eq=False)
class AssignedKeypoints:
    """The keypoints of one picture by person.

    Args:
        of: number of a person -> the picture with their keypoints alone.
        rest: the picture with the keypoints that are nobody's.
    """

    of: Mapping[int, KeypointImage]
    rest: KeypointImage


def assign_keypoints(
    item: KeypointImage, predicted: Mapping[int, Mapping[str, npt.NDArray[np.float64]]]
) -> AssignedKeypoints:
    """Give the keypoints of a picture to persons, all of them at once, by the distances of their rays.

    Args:
        item: the picture.
        predicted: number of a person -> site -> where it is expected (3,) [m], root frame.
    """
    numbers = list(predicted)
    costs = np.array([[_away(item, rows, predicted[number]) for rows in item.people] for number in numbers])
    of: dict[int, KeypointImage] = {}
    taken: set[int] = set()
    if costs.size:
        # What is not theirs costs more than any that may be.
        for row, column in _core.linear_sum_assignment(np.where(costs < WRONG_M, costs, 1e3)):
            if costs[row, column] < WRONG_M:
                of[numbers[row]] = replace(item, people=(item.people[column],))
                taken.add(column)
    rest = tuple(rows for index, rows in enumerate(item.people) if index not in taken)
    return AssignedKeypoints(of, replace(item, people=rest))


def _away(item: KeypointImage, rows: FloatArray, predicted: Mapping[str, npt.NDArray[np.float64]]) -> float:
    """Median distance [m] of the rays of keypoints from where sites are expected; infinite with too few."""
    observed = [site for site in site_pixels(rows, layout=item.layout)[0] if site.site in predicted]
    if len(observed) < _FEWEST:
        return float("inf")
    origin, directions = world_rays(item.camera, item.root_from_sensor, [site.pixel for site in observed])
    places = np.array([predicted[site.site] for site in observed])
    away = ray_distance(origin, directions, places)
    away = away[np.isfinite(away)]
    return float(np.median(away)) if len(away) >= _FEWEST else float("inf")
