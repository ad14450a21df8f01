"""Gait of synthetic persons: legs and arms swing with the distance walked between stops."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from voodoo.ik.chain import Chain
from voodoo.model.body import Body
from voodoo.model.transforms import pose_of

FloatArray: TypeAlias = npt.NDArray[np.float64]

_STRIDE_M = 1.4
"""Length of two steps."""
_TURN_S = 0.4
"""Duration of a turn when the walking direction changes."""
_STANDS_M = 0.05
"""A person who moves less than this from one stop to the next is standing."""


@dataclass(frozen=True)
class Stop:
    """Position of a person at a time: seconds, meters on the floor, facing direction [rad], 0 is away from the camera."""

    time: float
    x: float
    y: float
    facing: float


def path(points: Sequence[tuple[float, float, float]]) -> tuple[Stop, ...]:
    """Stops of a person who walks through points, facing ahead, and while standing faces a camera that looks along x.

    Args:
        points: time [s], x and y [m], in the order of time, at least two of them.
    """
    facings = []
    for (_, x, y), (_, next_x, next_y) in pairwise(points):
        away = math.hypot(next_x - x, next_y - y)
        facings.append(math.pi if away < _STANDS_M else math.atan2(next_y - y, next_x - x))
    facings = [float(value) for value in np.unwrap(facings)]
    stops = [Stop(*points[0], facings[0])]
    for index, point in enumerate(points[1:-1], start=1):
        span = points[index + 1][0] - point[0]
        fraction = min(_TURN_S / span, 0.5)
        x, y = (point[axis] + fraction * (points[index + 1][axis] - point[axis]) for axis in (1, 2))
        stops += [Stop(*point, facings[index - 1]), Stop(point[0] + fraction * span, x, y, facings[index])]
    return (*stops, Stop(*points[-1], facings[-1]))


def pose_at(
    body: Body, stops: Sequence[Stop], time: float
) -> tuple[Mapping[str, FloatArray], Mapping[str, FloatArray]]:
    """Poses of the limbs and positions of the sites of a walking body at a time [s]; it needs the joints of the human."""
    times = [stop.time for stop in stops]
    place = np.array([[stop.x, stop.y] for stop in stops])
    x, y = (float(np.interp(time, times, place[:, axis])) for axis in (0, 1))
    facing = float(np.interp(time, times, np.unwrap([stop.facing for stop in stops])))
    lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(place, axis=0), axis=1))])
    walked = float(np.interp(time, times, lengths))
    index = min(int(np.searchsorted(times, time, side="right")), len(times) - 1)
    speed = (lengths[index] - lengths[index - 1]) / max(times[index] - times[index - 1], 1e-9) if index else 0.0
    chain = Chain(body)
    c, s = math.cos(facing), math.sin(facing)
    root = pose_of([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]], (x, y, _hip_height(chain)))
    swing = min(speed, 1.0)
    angles = np.array([_angle(name, math.tau * walked / _STRIDE_M, swing) for name in chain.angle_names])
    return chain.forward(angles, world_from_base=root)


def _hip_height(chain: Chain) -> float:
    _, sites = chain.forward(np.zeros(len(chain.angle_names)))
    return float(0.08 - min(sites["l_ankle"][2], sites["r_ankle"][2]))


def _angle(name: str, phase: float, swing: float) -> float:
    side, _, plain = name.partition("_")
    wave = math.sin(phase) if side == "l" else -math.sin(phase)
    lift = max(math.cos(phase) if side == "l" else -math.cos(phase), 0.0)
    return {
        "hip_rx": 0.5 * wave * swing,
        "knee_flexion": 0.08 + 0.9 * lift * swing,
        "shoulder_rx": -0.45 * wave * swing,
        "shoulder_ry": -0.12 if side == "l" else 0.12,
        "elbow_flexion": 0.25 + 0.2 * swing,
    }.get(plain if side in ("l", "r") else "", 0.0)
