"""Association of keypoints with persons; networks report several people in arbitrary order."""

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
"""Greatest median distance of the rays of keypoints from a person that they belong to."""
_FEWEST = 4


@dataclass(frozen=True, eq=False)
class AssignedKeypoints:
    """The keypoints of one image by person.

    Args:
        of: id of a person -> the image with only that person's keypoints.
        rest: the image with the keypoints that were assigned to no person.
    """

    of: Mapping[int, KeypointImage]
    rest: KeypointImage


def assign_keypoints(
    item: KeypointImage, predicted: Mapping[int, Mapping[str, npt.NDArray[np.float64]]]
) -> AssignedKeypoints:
    """Assign the keypoints of an image to persons jointly, by the distances of their rays from the predicted sites.

    Args:
        item: the image.
        predicted: id of a person -> site -> predicted position (3,) [m], root frame.
    """
    numbers = list(predicted)
    costs = np.array([[_away(item, rows, predicted[number]) for rows in item.people] for number in numbers])
    of: dict[int, KeypointImage] = {}
    taken: set[int] = set()
    if costs.size:
        # A forbidden pair gets a cost above all possible ones.
        for row, column in _core.linear_sum_assignment(np.where(costs < WRONG_M, costs, 1e3)):
            if costs[row, column] < WRONG_M:
                of[numbers[row]] = replace(item, people=(item.people[column],))
                taken.add(column)
    rest = tuple(rows for index, rows in enumerate(item.people) if index not in taken)
    return AssignedKeypoints(of, replace(item, people=rest))


def _away(item: KeypointImage, rows: FloatArray, predicted: Mapping[str, npt.NDArray[np.float64]]) -> float:
    """Median distance [m] of the rays of keypoints from the predicted sites; infinite with too few keypoints."""
    observed = [site for site in site_pixels(rows, layout=item.layout)[0] if site.site in predicted]
    if len(observed) < _FEWEST:
        return float("inf")
    origin, directions = world_rays(item.camera, item.root_from_sensor, [site.pixel for site in observed])
    places = np.array([predicted[site.site] for site in observed])
    away = ray_distance(origin, directions, places)
    away = away[np.isfinite(away)]
    return float(np.median(away)) if len(away) >= _FEWEST else float("inf")
