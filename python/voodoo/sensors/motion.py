"""Where points that were measured some time before the frame are at its time: each goes on with the limb it lies on."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

import voodoo._core as _core
from voodoo.sensors.pixels import FloatArray

_SAME_S = 1e-3
"""Stamps that differ by less are one time."""


@dataclass
class LimbMotion:
    """Carries points along with the limbs.

    A laser at 15 Hz beside a camera at 30 Hz is up to a period old when it is used, in which a walking leg goes 5 cm: twice
    what the model's legs are off. Points are moved like those of `SitePredictor`.

    Args:
        near: points farther than this from every limb [m] are the scene's and stay.
        velocity_share: see `SitePredictor`.
        max_speed: a limb that is faster [m/s] has jumped; its points stay.
        longest: no point is carried on for longer than this [s].
    """

    near: float = 0.20
    velocity_share: float = 0.6
    max_speed: float = 8.0
    longest: float = 0.1
    _poses: FloatArray | None = field(default=None, repr=False)
    _before: tuple[float, FloatArray] | None = field(default=None, repr=False)
    _stamp: float = field(default=float("nan"), repr=False)

    def update(self, stamp: float, poses: FloatArray) -> None:
        """Take up the poses of all limbs (L, 4, 4) at `stamp` [s]."""
        comparable = self._poses is not None and len(self._poses) == len(poses) and stamp > self._stamp
        self._before = (stamp - self._stamp, self._poses) if comparable and self._poses is not None else None
        self._poses, self._stamp = poses, stamp

    def moves(self, elapsed: float) -> bool:
        """Whether there is anything to do for points seen `elapsed` seconds before the frame."""
        return self._before is not None and abs(elapsed) >= _SAME_S

    def motion_compensated(
        self,
        points: npt.NDArray[Any],
        elapsed: float,
        distances: Callable[[FloatArray], npt.NDArray[np.floating[Any]]],
        *,
        world_from_sensor: FloatArray | None = None,
    ) -> npt.NDArray[Any]:
        """Places (N, 3) [m] at the frame's time of points (N, 3), seen `elapsed` seconds before it.

        Args:
            points: in the frame of a sensor.
            elapsed: negative for a sensor that measured after the frame's time.
            distances: of places (N, 3) from each limb, (L, N) [m]; see `Tracker.limb_distances`.
            world_from_sensor: pose of the sensor; None: the points are in the world.
        """
        if self._before is None or self._poses is None or not self.moves(elapsed):
            return points
        interval, before = self._before
        return _core.carried(
            np.ascontiguousarray(points, dtype=np.float64),
            self._poses,
            before,
            interval=interval,
            elapsed=min(max(elapsed, -self.longest), self.longest),
            near=self.near,
            share=self.velocity_share,
            max_speed=self.max_speed,
            distances=lambda places: np.asarray(distances(places), dtype=np.float32),
            world_from_sensor=world_from_sensor,
        )
