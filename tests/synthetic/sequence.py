"""Depth sequences of a moving body model with exact ground truth and known noise.

Model, start and calibration are exact, so errors of a tracker on them are its own.
All degrees of freedom move, at a chosen speed.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

import voodoo._core as _core
from voodoo.ik.chain import Chain
from voodoo.model.body import Body
from voodoo.model.camera import Camera
from voodoo.synthetic.render import render_depth

FloatArray: TypeAlias = npt.NDArray[np.float64]

CAMERA = Camera(640, 480, 550.0, 550.0, 319.5, 239.5)
"""A depth camera with a field of view of 60 degrees."""
METERS_PER_UNIT = 0.001

_WALL_M = 3.6
_NOISE_AT_M = 2.4
_RATE_HZ = 30.0
# The camera is 1 m above the floor and looks along the world's x axis at a person who faces it.
_WORLD_FROM_SENSOR = np.array(
    [[0.0, 0.0, 1.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 1.0], [0.0, 0.0, 0.0, 1.0]]
)
_WORLD_FROM_STANDING = np.array(
    [[-1.0, 0.0, 0.0, 2.4], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.86], [0.0, 0.0, 0.0, 1.0]]
)

# Angle (without side): center and amplitude, radians or meters, of the left side; the shoulder's and hip's second and third
# angles are mirrored on the right. Arms stay away from the trunk, so that the pose is not ambiguous.
_MOTION: Mapping[str, tuple[float, float]] = {
    "root_x": (0.0, 0.10), "root_y": (0.0, 0.15), "root_z": (0.0, 0.04),
    "root_rx": (0.0, 0.10), "root_ry": (0.0, 0.12), "root_rz": (0.0, 0.45),
    "vc7_rx": (0.1, 0.25), "vc7_ry": (0.0, 0.20), "vc7_rz": (0.0, 0.50),
    "shoulder_rx": (0.5, 0.60), "shoulder_ry": (-0.8, 0.50), "shoulder_rz": (0.0, 0.40),
    "elbow_flexion": (1.0, 0.70),
    "hip_rx": (0.4, 0.40), "hip_ry": (-0.25, 0.20), "hip_rz": (0.0, 0.20),
    "knee_flexion": (0.8, 0.50),
}  # fmt: skip
_MIRRORED = ("shoulder_ry", "shoulder_rz", "hip_ry", "hip_rz")
_BASE_HZ = 0.08
"""Mean frequency of the angles at speed 1; each has its own, within a quarter of it."""


@dataclass(frozen=True, eq=False)
class VirtualFrame:
    """One instant of a virtual sequence.

    Attributes:
        stamp: time [s].
        image: (height, width) uint16 [mm], 0 without a return.
        joints: true site positions, name -> (3,) [m], world frame.
        angles: (n,) true root pose and joint angles, in the order of `VirtualSequence.angle_names`.
        world_from_limb: true poses, name -> (4, 4).
    """

    stamp: float
    image: npt.NDArray[np.uint16]
    joints: Mapping[str, FloatArray]
    angles: FloatArray
    world_from_limb: Mapping[str, FloatArray]


@dataclass(frozen=True, kw_only=True)
class VirtualSequence:
    """A person in front of a wall, whose degrees of freedom swing with different frequencies and phases. Iterating renders it.

    Args:
        body: the true body; its joints' names are those of the default human.
        speed: how many times faster than the slow base motion (0.08 Hz).
        frames: how many, at 30 Hz.
        noise_m: standard deviation of the depth at 2.4 m [m]; it grows with the square of the depth.
        seed: of phases and noise.
        camera: with its lens; pixels without a ray have no return.
    """

    body: Body
    speed: float = 1.0
    frames: int = 300
    noise_m: float = 0.004
    seed: int = 1
    camera: Camera = CAMERA

    def __post_init__(self) -> None:
        """Check the numbers.

        Raises:
            ValueError: one is out of range.
        """
        if not (math.isfinite(self.speed) and self.speed >= 0.0):
            raise ValueError(f"speed: expected a number of at least zero, found {self.speed!r}")
        if not (math.isfinite(self.noise_m) and self.noise_m >= 0.0):
            raise ValueError(f"noise_m: expected meters of at least zero, found {self.noise_m!r}")
        if self.frames < 1:
            raise ValueError(f"frames: expected at least one, found {self.frames!r}")

    @property
    def world_from_sensor(self) -> FloatArray:
        """Pose (4, 4) of the camera's optical frame."""
        return _WORLD_FROM_SENSOR.copy()

    @property
    def angle_names(self) -> tuple[str, ...]:
        """Names of the degrees of freedom: six of the root, and the joint angles."""
        return Chain(self.body).angle_names

    def __len__(self) -> int:
        """Number of frames."""
        return self.frames

    def angles(self, time: float) -> FloatArray:
        """True angles (n,) at a time [s]."""
        chain = Chain(self.body)
        rng = np.random.default_rng(self.seed)
        values = np.zeros(len(chain.angle_names))
        for index, name in enumerate(chain.angle_names):
            frequency, phase = _BASE_HZ * rng.uniform(0.75, 1.25), rng.uniform(0.0, math.tau)
            side, _, plain = name.partition("_")
            center, amplitude = _MOTION.get(plain if side in "lr" else name, (0.0, 0.05))
            sign = -1.0 if side == "r" and plain in _MIRRORED else 1.0
            values[index] = sign * center + amplitude * math.sin(math.tau * frequency * self.speed * time + phase)
        return values

    def truth(self, time: float) -> tuple[Mapping[str, FloatArray], Mapping[str, FloatArray]]:
        """True poses of the limbs and positions of the sites at a time [s]."""
        return Chain(self.body).forward(self.angles(time), world_from_base=_WORLD_FROM_STANDING)

    def __iter__(self) -> Iterator[VirtualFrame]:
        """The frames in order, rendered one by one."""
        rng = np.random.default_rng([self.seed, 1])
        blind = ~np.isfinite(self.camera.rays()).all(axis=2)
        for index in range(self.frames):
            time = index / _RATE_HZ
            poses, sites = self.truth(time)
            observed = render_depth(self.body, poses, camera=self.camera, world_from_sensor=_WORLD_FROM_SENSOR).depth
            depth = np.where(observed > 0.0, observed, _WALL_M)
            depth += self.noise_m * (depth / _NOISE_AT_M) ** 2 * rng.standard_normal(depth.shape)
            image = np.rint(depth / METERS_PER_UNIT).astype(np.uint16)
            image[blind] = 0
            yield VirtualFrame(time, image, sites, self.angles(time), poses)

    def measurement(self, frame: VirtualFrame) -> _core.Frame:
        """A tracker's frame with the depth image."""
        found = _core.Frame(frame.stamp)
        found.add_depth(
            frame.image, camera=self.camera, meters_per_unit=METERS_PER_UNIT, world_from_sensor=_WORLD_FROM_SENSOR
        )
        return found
