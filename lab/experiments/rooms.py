"""Empty rooms for lab/experiments/false_bodies.py: furniture of a person's size, seen by depth cameras, ray by ray.

Everything is a box, an ellipsoid or an upright elliptic cylinder; what a room has, where the camera stands and what its noise is
come from a seed.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

import voodoo

METERS_PER_UNIT = 0.001
RATE_HZ = 30.0
FAR_M = 60.0
"""Farther than every wall."""


@dataclass(frozen=True)
class Sensor:
    """A depth camera.

    Args:
        name: for the table.
        camera: where its pixels look.
        reach: from, until [m].
        sigma: standard deviation [m] of depths (H, W) [m].
        flying: share of the pixels at an edge that return something between both surfaces.
    """

    name: str
    camera: voodoo.Camera
    reach: tuple[float, float]
    sigma: Callable[[np.ndarray], np.ndarray]
    flying: float

    def image(self, depth: np.ndarray, chance: np.random.Generator) -> np.ndarray:
        """What it measures of exact depths (H, W) [m]: (H, W) uint16 in METERS_PER_UNIT."""
        observed = depth + self.sigma(depth) * chance.standard_normal(depth.shape)
        beside = np.roll(depth, 1, axis=1)
        edge = np.abs(depth - beside) > np.maximum(0.06, 0.04 * depth)
        mixed = edge & (chance.random(depth.shape) < self.flying)
        fraction = chance.random(depth.shape)
        observed = np.where(mixed, fraction * depth + (1.0 - fraction) * beside, observed)
        gone = (observed < self.reach[0]) | (observed > self.reach[1]) | (chance.random(depth.shape) < 0.004)
        return np.where(gone, 0.0, np.rint(observed / METERS_PER_UNIT)).astype(np.uint16)


SENSORS = (
    Sensor(
        "structured light 320x240",
        voodoo.Camera(320, 240, 285.0, 285.0, 159.5, 119.5),
        (0.5, 6.0),
        lambda z: 0.0015 * z**2,
        0.0,
    ),
    Sensor(
        "time of flight 176x144",
        voodoo.Camera(176, 144, 208.0, 208.0, 87.5, 71.5),
        (0.5, 7.5),
        lambda z: 0.008 + 0.004 * z,
        0.6,
    ),
    Sensor(
        "lidar 424x318",
        voodoo.Camera(424, 318, 305.0, 305.0, 211.5, 158.5),
        (0.3, 9.0),
        lambda z: 0.0025 + 0.001 * z,
        0.2,
    ),
)


@dataclass(frozen=True, eq=False)
class Solid:
    """A thing in a room: "box", "ellipsoid" or "cylinder" (elliptic, upright), turned about the vertical.

    Args:
        kind: one of the three.
        middle: (3,) [m].
        half: half sizes (3,) [m].
        yaw: [rad].
    """

    kind: str
    middle: np.ndarray
    half: np.ndarray
    yaw: float = 0.0

    def hit(self, origin: np.ndarray, directions: np.ndarray) -> np.ndarray:
        """How far (...) along directions (..., 3) its surface is first met, in their lengths; inf where it is not."""
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        own = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        start = own @ (origin - self.middle) / self.half
        along = directions @ own.T / self.half
        axes = {"box": 0, "cylinder": 2, "ellipsoid": 3}[self.kind]
        near, far = _through_ball(start[:axes], along[..., :axes]) if axes else (-np.inf, np.inf)
        if axes < 3:
            low, high = _through_slabs(start[axes:], along[..., axes:])
            near, far = np.maximum(near, low), np.minimum(far, high)
        return np.where((near <= far) & (near > 0.0), near, np.inf)


def _through_ball(start: np.ndarray, along: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where rays enter and leave the unit circle or ball; (inf, -inf) where they miss it."""
    a = np.maximum((along**2).sum(axis=-1), 1e-12)
    b = along @ start
    inside = b**2 - a * (start @ start - 1.0)
    root = np.sqrt(np.maximum(inside, 0.0))
    return np.where(inside > 0.0, (-b - root) / a, np.inf), np.where(inside > 0.0, (-b + root) / a, -np.inf)


def _through_slabs(start: np.ndarray, along: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where rays enter and leave the slabs -1..1."""
    safe = np.where(np.abs(along) < 1e-9, 1e-9, along)
    one, other = (-1.0 - start) / safe, (1.0 - start) / safe
    return np.minimum(one, other).max(axis=-1), np.maximum(one, other).min(axis=-1)


@dataclass(frozen=True, eq=False)
class Room:
    """A room and the camera in it; z is up, the floor is z = 0.

    Args:
        things: what stands in it, and where on the floor, x and y [m].
        sensor: the camera.
        world_from_sensor: (4, 4).
        depth: exact (H, W) [m], along the optical axis.
        seed: of the noise.
    """

    things: tuple[tuple[str, float, float], ...]
    sensor: Sensor
    world_from_sensor: np.ndarray
    depth: np.ndarray
    seed: int

    def nearest(self, x: float, y: float) -> str:
        """The thing that stands nearest to a place [m]."""
        return min(self.things, key=lambda thing: np.hypot(thing[1] - x, thing[2] - y))[0]

    def frames(self, seconds: float, *, rate: float = RATE_HZ, floor_known: bool = True) -> Iterator[voodoo.Frame]:
        """The room for some time, as a tracker takes it."""
        chance = np.random.default_rng(self.seed)
        for index in range(round(seconds * rate)):
            frame = voodoo.Frame(stamp=index / rate)
            frame.add_depth(
                self.sensor.image(self.depth, chance),
                camera=self.sensor.camera,
                meters_per_unit=METERS_PER_UNIT,
                world_from_sensor=self.world_from_sensor,
            )
            if floor_known:
                frame.set_ground(normal=(0.0, 0.0, 1.0), offset=0.0)
            yield frame


def seen_from(solids: list[Solid], camera: voodoo.Camera, world_from_sensor: np.ndarray) -> np.ndarray:
    """Exact depth (H, W) [m] of the floor and of what stands on it."""
    rays = camera.rays().astype(np.float64)
    in_camera = np.concatenate([rays[..., :2], np.ones((*rays.shape[:2], 1))], axis=-1)
    directions = in_camera @ world_from_sensor[:3, :3].T
    origin = world_from_sensor[:3, 3]
    down = np.minimum(directions[..., 2], -1e-9)
    depth = np.where(directions[..., 2] < 0.0, -origin[2] / down, FAR_M)
    for solid in solids:
        depth = np.minimum(depth, solid.hit(origin, directions))
    return np.minimum(depth, FAR_M)


def furniture(name: str, x: float, y: float, chance: np.random.Generator) -> list[Solid]:
    """A thing of a person's size that stands at a place on the floor [m]."""
    yaw = float(chance.uniform(0.0, np.pi))

    def solid(kind: str, half: tuple[float, float, float], z: float, dx: float = 0.0, dy: float = 0.0) -> Solid:
        c, s = np.cos(yaw), np.sin(yaw)
        middle = np.array([x + c * dx - s * dy, y + s * dx + c * dy, z])
        return Solid(kind, middle, np.array(half), yaw)

    tall = float(chance.uniform(1.5, 1.95))
    if name == "cupboard":
        return [solid("box", (chance.uniform(0.2, 0.45), chance.uniform(0.15, 0.3), tall / 2), tall / 2)]
    if name == "pillar":
        return [solid("cylinder", (chance.uniform(0.12, 0.25), chance.uniform(0.12, 0.2), tall / 2), tall / 2)]
    if name == "floor lamp":
        shade = float(chance.uniform(0.15, 0.25))
        parts = [solid("cylinder", (0.02, 0.02, tall / 2), tall / 2), solid("cylinder", (0.15, 0.15, 0.015), 0.015)]
        return [*parts, solid("cylinder", (shade, shade, 0.14), tall - 0.14)]
    if name == "coat stand":
        coat = (chance.uniform(0.15, 0.25), chance.uniform(0.1, 0.16), chance.uniform(0.35, 0.5))
        parts = [solid("cylinder", (0.025, 0.025, tall / 2), tall / 2), solid("cylinder", (0.22, 0.22, 0.02), 0.02)]
        parts.append(solid("ellipsoid", coat, tall - 0.2 - coat[2]))
        for side in (-1.0, 1.0):
            parts.append(solid("ellipsoid", (0.06, 0.06, 0.32), tall - 0.55, side * (coat[0] + 0.02)))
        return [*parts, solid("ellipsoid", (0.11, 0.13, 0.09), tall)]
    if name == "dressmaker's dummy":
        parts = [solid("cylinder", (0.03, 0.03, 0.4), 0.4), solid("cylinder", (0.2, 0.2, 0.02), 0.02)]
        parts.append(solid("ellipsoid", (0.19, 0.12, 0.2), 0.95))
        return [*parts, solid("ellipsoid", (0.2, 0.13, 0.24), 1.25), solid("cylinder", (0.06, 0.06, 0.06), 1.52)]
    if name == "palm":
        parts = [solid("cylinder", (0.18, 0.18, 0.2), 0.2), solid("cylinder", (0.03, 0.03, tall / 3), 0.4 + tall / 3)]
        for height in np.linspace(0.55, 1.0, 16) * tall:
            angle, half = float(chance.uniform(0.0, 2.0 * np.pi)), np.array([chance.uniform(0.15, 0.3), 0.05, 0.02])
            out = np.array([np.cos(angle), np.sin(angle)]) * half[0]
            parts.append(Solid("ellipsoid", np.array([x + out[0], y + out[1], height]), half, angle))
        return parts
    if name == "chair with a coat":
        parts = [solid("box", (0.22, 0.22, 0.02), 0.45), solid("box", (0.22, 0.02, 0.25), 0.72, 0.0, 0.22)]
        for dx, dy in ((-0.2, -0.2), (0.2, -0.2), (-0.2, 0.2), (0.2, 0.2)):
            parts.append(solid("box", (0.02, 0.02, 0.22), 0.22, dx, dy))
        return [*parts, solid("ellipsoid", (0.26, 0.1, 0.35), 0.75, 0.0, 0.22)]
    return [solid("box", (0.2, 0.2, tall / 2), tall / 2), solid("ellipsoid", (0.13, 0.13, 0.15), tall + 0.13)]


THINGS = (
    "cupboard",
    "pillar",
    "floor lamp",
    "coat stand",
    "dressmaker's dummy",
    "palm",
    "chair with a coat",
    "box and ball",
)


def room(seed: int, *, sensor: Sensor | None = None) -> Room:
    """A room with three things, a wall and at times a table, seen by one of SENSORS."""
    chance = np.random.default_rng(seed)
    sensor = SENSORS[seed % len(SENSORS)] if sensor is None else sensor
    wall = float(chance.uniform(4.0, 6.0))
    solids = [Solid("box", np.array([wall + 0.1, 0.0, 1.4]), np.array([0.1, 6.0, 1.4]))]
    names = (THINGS[seed % len(THINGS)], *map(str, chance.choice(THINGS, 2)))
    things = []
    for name, beside in zip(names, chance.permutation((-1.0, 0.0, 1.0)), strict=True):
        x, y = float(chance.uniform(2.0, wall - 0.6)), float(beside + chance.uniform(-0.25, 0.25))
        things.append((name, x, y))
        solids += furniture(name, x, y, chance)
    if chance.random() < 0.5:
        solids.append(Solid("box", np.array([wall - 0.5, chance.uniform(-1.5, 1.5), 0.72]), np.array([0.4, 0.7, 0.02])))
    tilt = float(np.radians(chance.uniform(0.0, 20.0)))
    height = float(chance.uniform(0.7, 1.1) + 1.2 * np.sin(tilt))
    pose = np.eye(4)
    pose[:3, :3] = [[0.0, -np.sin(tilt), np.cos(tilt)], [-1.0, 0.0, 0.0], [0.0, -np.cos(tilt), -np.sin(tilt)]]
    pose[:3, 3] = (0.0, 0.0, height)
    return Room(tuple(things), sensor, pose, seen_from(solids, sensor.camera, pose), seed)
