"""Depth sequences of a person who walks about a furnished room, leaves the view and returns, with exact ground truth."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

import voodoo
from synthetic.boxes import Box, room_depth
from synthetic.gait import Stop, pose_at
from synthetic.sequence import METERS_PER_UNIT, VirtualFrame
from voodoo.synthetic.render import render_depth

CAMERA = voodoo.Camera(320, 240, 275.0, 275.0, 159.5, 119.5)
"""60 degrees wide: 2.8 m at 2.4 m."""

_RATE_HZ = 30.0
_NOISE_AT_M = 2.4
# The camera stands 0.9 m above the floor and looks along the world's x axis.
_WORLD_FROM_SENSOR = np.array(
    [[0.0, 0.0, 1.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 0.9], [0.0, 0.0, 0.0, 1.0]]
)
FURNITURE: tuple[Box, ...] = (
    ((4.2, -1e3, -1e3), (5.0, 1e3, 1e3)),  # the wall
    ((3.5, 0.5, 0.0), (4.1, 1.5, 1.9)),  # a cupboard as high as a person
    ((3.0, -2.0, 0.65), (3.8, -1.0, 0.72)),  # a table
    ((2.9, 1.5, 0.0), (3.3, 1.8, 0.9)),  # a chair
)


@dataclass(frozen=True, kw_only=True)
class Walk:
    """A person who walks from stop to stop in front of a wall and furniture. Iterating renders depth images at 30 Hz.

    Args:
        body: the true body; its joints' names are those of the default human.
        stops: in the order of time, the first at 0.
        covered: intervals [s], start to end, in which the camera is covered: no pixel has a return.
        away: intervals in which the person is not in the room.
        noise_m: standard deviation of the depth at 2.4 m [m]; it grows with the square of the depth.
        seed: of the noise.
        camera: with its lens; pixels without a ray have no return.
    """

    body: voodoo.Body
    stops: Sequence[Stop]
    covered: Sequence[tuple[float, float]] = ()
    away: Sequence[tuple[float, float]] = ()
    noise_m: float = 0.004
    seed: int = 1
    camera: voodoo.Camera = CAMERA

    def __len__(self):
        return round(self.stops[-1].time * _RATE_HZ) + 1

    @property
    def world_from_sensor(self):
        """Pose (4, 4) of the camera's optical frame."""
        return _WORLD_FROM_SENSOR.copy()

    def truth(self, time):
        """True poses of the limbs and positions of the sites at a time [s]."""
        return pose_at(self.body, self.stops, time)

    def __iter__(self):
        rng = np.random.default_rng(self.seed)
        room = room_depth(self.camera, _WORLD_FROM_SENSOR, FURNITURE)
        room[~np.isfinite(room)] = np.nan
        for index in range(len(self)):
            time = index / _RATE_HZ
            poses, sites = self.truth(time)
            depth = room
            if not any(start <= time < end for start, end in self.away):
                observed = render_depth(
                    self.body, poses, camera=self.camera, world_from_sensor=_WORLD_FROM_SENSOR
                ).depth
                depth = np.where((observed > 0.0) & (observed < depth), observed, depth)
            depth = depth + self.noise_m * (depth / _NOISE_AT_M) ** 2 * rng.standard_normal(depth.shape)
            if any(start <= time < end for start, end in self.covered):
                depth = np.zeros_like(depth)
            image = np.rint(np.nan_to_num(depth) / METERS_PER_UNIT).astype(np.uint16)
            yield VirtualFrame(time, image, sites, np.zeros(0), poses)

    def measurement(self, frame):
        """A tracker's frame with the depth image and the ground plane."""
        found = voodoo.Frame(frame.stamp)
        found.add_depth(
            frame.image, camera=self.camera, meters_per_unit=METERS_PER_UNIT, world_from_sensor=_WORLD_FROM_SENSOR
        )
        found.set_ground(normal=(0.0, 0.0, 1.0), offset=0.0)
        return found
