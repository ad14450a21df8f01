"""Which sites the person's own body hides from a camera: a network guesses those, with no less confidence."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from voodoo.sensors.pixels import FloatArray

Distance: TypeAlias = Callable[[FloatArray], npt.NDArray[np.floating[Any]]]
"""Signed distances (N,) of places (N, 3) from the body's surface, negative inside [m]; see `Tracker.distance`."""
REACH_M, SAMPLES = 0.75, 30
"""Looked at is so much of each line of sight, at so many places: more than a trunk's width, and half a forearm's."""


def body_before(sites: npt.ArrayLike, camera: npt.ArrayLike, distance: Distance) -> FloatArray:
    """Length of body (N,) [m] that lies between each site and a camera.

    Args:
        sites: (N, 3), inside the body as it is posed.
        camera: focal point (3,).
        distance: from the posed body.
    """
    places = np.asarray(sites, dtype=np.float64)
    towards = np.asarray(camera, dtype=np.float64) - places
    away = np.linalg.norm(towards, axis=1, keepdims=True)
    steps = (np.arange(SAMPLES) + 0.5) / SAMPLES * np.minimum(away, REACH_M)
    samples = places[:, None] + (towards / np.maximum(away, 1e-9))[:, None] * steps[:, :, None]
    inside = (distance(samples.reshape(-1, 3)) < 0.0).reshape(len(places), SAMPLES)
    return np.asarray(inside.mean(axis=1) * np.minimum(away[:, 0], REACH_M))
