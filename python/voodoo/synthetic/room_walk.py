"""Depth sequences of a person who walks about a furnished room, leaves the view and returns: exact truth, as in `virtual`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

import voodoo._core as _core
from voodoo.model.body import Body
from voodoo.model.camera import Camera
from voodoo.synthetic.gait import Stop, pose_at
from voodoo.synthetic.render import render_depth
from voodoo.synthetic.sequence import METERS_PER_UNIT, FloatArray, VirtualFrame

CAMERA = Camera(320, 240, 275.0, 275.0, 159.5, 119.5)
"""60 degrees wide: 2.8 m at 2.4 m."""

_RATE_HZ = 30.0
_NOISE_AT_M = 2.4
# The camera stands 0.9 m above the floor and looks along the world's x axis.
_WORLD_FROM_SENSOR = np.array(
    [[0.0, 0.0, 1.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 0.9], [0.0, 0.0, 0.0, 1.0]]
)
_WALL_X = 4.2
Box = tuple[tuple[float, float, float], tuple[float, float, float]]
FURNITURE: tuple[Box, ...] = (
    ((3.5, 0.5, 0.0), (4.1, 1.5, 1.9)),  # a cupboard as high as a person
    ((3.0, -2.0, 0.65), (3.8, -1.0, 0.72)),  # a table
    ((2.9, 1.5, 0.0), (3.3, 1.8, 0.9)),  # a chair
)


@dataclass(frozen=True, kw_only=True)
class Walk:
    """A person who goes from stop to stop before a wall and furniture. Iterating renders it at 30 Hz.

    Args:
        body: the true body; its joints' names are those of the default human.
        stops: in the order of time, the first at 0.
        covered: times [s] from, until between which the camera is covered: every pixel without return.
        away: times between which the person is not in the room at all.
        appears: furniture that stands there from a time on.
        noise_m: standard deviation of the depth at 2.4 m [m]; it grows with the square of the depth.
        seed: of the noise.
        camera: through which the room is seen, with its lens; nothing returns where that shows nothing.
    """

    body: Body
    stops: Sequence[Stop]
    covered: Sequence[tuple[float, float]] = ()
    away: Sequence[tuple[float, float]] = ()
    appears: Sequence[tuple[float, Box]] = ()
    noise_m: float = 0.004
    seed: int = 1
    camera: Camera = CAMERA

    def __len__(self) -> int:
        """Number of frames."""
        return round(self.stops[-1].time * _RATE_HZ) + 1

    @property
    def world_from_sensor(self) -> FloatArray:
        """Pose (4, 4) of the camera's optical frame."""
        return _WORLD_FROM_SENSOR.copy()

    def present(self, time: float) -> bool:
        """Whether the person is in the room and the camera not covered."""
        return not any(start <= time < end for start, end in (*self.covered, *self.away))

    def truth(self, time: float) -> tuple[Mapping[str, FloatArray], Mapping[str, FloatArray]]:
        """True poses of the limbs and positions of the sites at a time [s]."""
        return pose_at(self.body, self.stops, time)

    def __iter__(self) -> Iterator[VirtualFrame]:
        """The frames in order, rendered one by one."""
        rng = np.random.default_rng(self.seed)
        for index in range(len(self)):
            time = index / _RATE_HZ
            poses, sites = self.truth(time)
            boxes = [*FURNITURE, *(box for start, box in self.appears if time >= start)]
            depth = _room(self.camera, boxes)
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

    def measurement(self, frame: VirtualFrame) -> _core.Frame:
        """The frame as a tracker takes it, with the floor known."""
        found = _core.Frame(frame.stamp)
        found.add_depth(
            frame.image, camera=self.camera, meters_per_unit=METERS_PER_UNIT, world_from_sensor=_WORLD_FROM_SENSOR
        )
        found.set_ground(normal=(0.0, 0.0, 1.0), offset=0.0)
        return found


def _room(camera: Camera, boxes: Sequence[Box]) -> FloatArray:
    """Depth (height, width) [m] of floor, wall and boxes; NaN where the lens shows nothing."""
    rays = camera.rays().astype(np.float64)
    directions = np.stack([np.ones(rays.shape[:2]), -rays[..., 0], -rays[..., 1]], axis=-1)
    origin = _WORLD_FROM_SENSOR[:3, 3]
    with np.errstate(divide="ignore", invalid="ignore"):
        floor = np.where(directions[..., 2] < 0.0, -origin[2] / directions[..., 2], np.inf)
        depth = np.minimum(floor, _WALL_X)
        for low, high in boxes:
            first, second = (np.array(low) - origin) / directions, (np.array(high) - origin) / directions
            near = np.minimum(first, second).max(axis=-1)
            far = np.maximum(first, second).min(axis=-1)
            depth = np.where((near <= far) & (near > 0.0) & (near < depth), near, depth)
    return np.where(np.isnan(rays[..., 0]), np.nan, depth)
