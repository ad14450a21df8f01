"""Synthetic recordings by seed: persons who return, cross, pass by, four persons, and a person before a moving robot."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from synthetic.boxes import Box
from synthetic.gait import path
from synthetic.grown import grown
from synthetic.people import Color, MadeUpRecording, Noise, Scene, Walker
from voodoo.model.body import Body

FloatArray: TypeAlias = npt.NDArray[np.float64]
Points: TypeAlias = Sequence[tuple[float, float, float]]

CAMERA_HEIGHT_M = 1.1
AWAY_S = 5.0
"""Time that a person is out of view in `returning`."""
MOVES_M, TURNS_RAD = 1.5, math.radians(30.0)
"""Translation and rotation of the camera in `robot`."""
_CLOTHES: tuple[tuple[Color, Color], ...] = (
    ((40, 40, 190), (60, 50, 40)),
    ((170, 90, 40), (70, 70, 75)),
    ((60, 150, 60), (100, 60, 30)),
    ((200, 200, 205), (40, 40, 120)),
    ((40, 170, 200), (30, 30, 30)),
)


def returning(seed: int) -> MadeUpRecording:
    """A person enters, stands, leaves for AWAY_S seconds and returns; meanwhile another person may enter and stay.

    The persons differ in stature, girth and clothes. Every other seed has only one person; sides, positions and furniture depend
    on the seed.
    """
    chance = np.random.default_rng((seed, 1))
    side, back = (float(chance.choice((-1.0, 1.0))) for _ in range(2))
    depth, x = float(chance.uniform(2.6, 3.2)), float(chance.uniform(-0.4, 0.4))
    out = _outside(depth)
    first = [(1.0, depth, side * out), (1.0 + 2.0, depth, x), (4.5, depth, x), (6.5, depth, back * out)]
    # AWAY_S seconds pass between the last point in view and the next one.
    again = 6.5 + AWAY_S - 0.5
    first += [(again, depth, back * out), (again + 2.0, depth, x), (again + 3.5, depth, x)]
    people = [_walker(first, 0, chance)]
    if seed % 2:
        place = -math.copysign(float(chance.uniform(0.6, 0.8)), x)
        far = depth + float(chance.uniform(0.5, 0.8))
        out = _outside(far)
        second = [(6.0, far, -back * out), (8.0, far, place), (again + 3.5, far, place)]
        people.append(_walker(second, 1, chance))
    return _recorded(f"returning {seed}", people, again + 3.5, chance, seed)


def crossing(seed: int) -> MadeUpRecording:
    """Two persons enter from both sides, cross, turn, and cross again."""
    chance = np.random.default_rng((seed, 2))
    near, far = float(chance.uniform(2.2, 2.6)), float(chance.uniform(3.0, 3.5))
    paths = []
    for depth, side in ((near, -1.0), (far, 1.0)):
        a = side * _outside(depth)
        b = side * float(chance.uniform(0.5, 0.7))
        late = float(chance.uniform(0.0, 0.3))
        places = [(1.0, a), (3.4, -b), (4.4, -b), (6.2, b), (7.0, b), (9.0, -a)]
        paths.append([(time + late, depth, y) for time, y in places])
    people = [_walker(points, number, chance) for number, points in enumerate(paths)]
    return _recorded(f"crossing {seed}", people, 10.0, chance, seed)


def passing(seed: int) -> MadeUpRecording:
    """A person stands; another one passes by, 0.8 m nearer to the camera, and returns."""
    chance = np.random.default_rng((seed, 3))
    depth, x = float(chance.uniform(2.7, 3.2)), float(chance.uniform(-0.3, 0.3))
    side = float(chance.choice((-1.0, 1.0)))
    stands = [(0.5, depth, -side * _outside(depth)), (2.5, depth, x), (9.5, depth, x)]
    near = depth - 0.8
    a = side * _outside(near)
    passes = [(4.0, near, a), (6.0, near, -a), (7.0, near, -a), (9.0, near, a)]
    return _recorded(f"passing {seed}", [_walker(stands, 0, chance), _walker(passes, 1, chance)], 9.5, chance, seed)


def four(seed: int, *, seconds: float = 12.0) -> MadeUpRecording:
    """Four persons enter one after the other and walk to and fro at four depths for 12 s; the first `seconds` are recorded."""
    chance = np.random.default_rng((seed, 4))
    people = []
    for number, depth in enumerate(chance.permutation((1.9, 2.5, 3.1, 3.7))):
        side = (-1.0, 1.0)[number % 2]
        time = 0.5 + 0.5 * number
        points = [(time, float(depth), side * _outside(depth))]
        while time < 12.0:
            side = -side
            time += float(chance.uniform(1.8, 2.6))
            y = side * float(chance.uniform(0.2, 0.3)) * depth
            points.append((time, float(depth + chance.uniform(-0.12, 0.12)), y))
        people.append(_walker(points, number, chance))
    return _recorded(f"four {seed}", people, seconds, chance, seed)


def robot(seed: int, *, moving: bool = True) -> MadeUpRecording:
    """A person walks in front of a robot that moves by MOVES_M forward and sideways and turns by TURNS_RAD; root frame `odom`.

    With `moving` False the robot stands still during the same walk.
    """
    chance = np.random.default_rng((seed, 5))
    side = float(chance.choice((-1.0, 1.0)))
    walk = [
        (0.5, 3.4, 1.4 * side),
        (2.5, 3.2, 0.3),
        (3.5, 3.2, 0.3),
        (5.5, 3.6, -0.5),
        (7.5, 3.3, 0.4),
        (9.0, 3.3, 0.4),
    ]

    def odom_from_base(time: float) -> FloatArray:
        fraction = float(np.clip((time - 2.5) / 5.5, 0.0, 1.0)) if moving else 0.0
        fraction = fraction * fraction * (3.0 - 2.0 * fraction)
        turn = side * TURNS_RAD * fraction
        pose = np.eye(4)
        pose[:2, :2] = [[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]]
        pose[:2, 3] = np.array([0.5, -side * math.sqrt(0.75)]) * MOVES_M * fraction
        return pose

    return _recorded(
        f"robot {seed}, {'moving' if moving else 'standing'}",
        [_walker(walk, 0, chance)],
        9.0,
        chance,
        seed,
        odom_from_base=odom_from_base,
    )


def base_from_camera() -> FloatArray:
    """Pose (4, 4) of the optical frame on the robot: CAMERA_HEIGHT_M above the floor, facing forward."""
    return np.array(
        [[0.0, 0.0, 1.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, CAMERA_HEIGHT_M], [0.0, 0.0, 0.0, 1.0]]
    )


def _outside(depth: float) -> float:
    """Lateral position [m] at a depth that is well outside the image."""
    return float(depth * math.tan(math.radians(30.0)) + 0.7)


def _walker(points: Points, number: int, chance: np.random.Generator) -> Walker:
    """A person whose stature and girth depend on the number."""
    stature = (1.62, 1.82, 1.72, 1.90)[number % 4] + float(chance.uniform(-0.03, 0.03))
    body = grown(Body.human(stature), thicker=(1.0, 1.12, 1.06, 0.97)[number % 4])
    shirt, trousers = _CLOTHES[(number + int(chance.integers(2)) * 4) % len(_CLOTHES)]
    return Walker(body=body, stops=path(points), shirt=shirt, trousers=trousers)


def _recorded(
    name: str,
    people: Sequence[Walker],
    seconds: float,
    chance: np.random.Generator,
    seed: int,
    *,
    odom_from_base: Callable[[float], FloatArray] | None = None,
) -> MadeUpRecording:
    def root_from_sensor(time: float) -> FloatArray:
        return (np.eye(4) if odom_from_base is None else odom_from_base(time)) @ base_from_camera()

    return MadeUpRecording(
        Scene(
            name=name,
            people=people,
            seconds=seconds,
            furniture=_furniture(chance),
            root_from_sensor=root_from_sensor,
            root_frame="base_link" if odom_from_base is None else "odom",
            noise=Noise(),
            seed=seed,
        )
    )


def _furniture(chance: np.random.Generator) -> tuple[Box, ...]:
    """A wall, a cupboard of the height of a person, a table and a chair."""
    # Persons stay within 4.2 m; the furniture is behind that.
    wall = float(chance.uniform(5.4, 5.9))
    side = float(chance.choice((-1.0, 1.0)))

    def box(x: float, y: float, size: tuple[float, float], low: float, high: float) -> Box:
        a, b = sorted((side * y - size[1] / 2, side * y + size[1] / 2))
        return (x - size[0] / 2, a, low), (x + size[0] / 2, b, high)

    cupboard = box(wall - 0.3, float(chance.uniform(0.6, 1.6)), (0.5, 0.9), 0.0, float(chance.uniform(1.6, 2.0)))
    table = box(wall - 0.6, float(chance.uniform(-1.8, -0.8)), (0.8, 1.2), 0.70, 0.75)
    chair = box(wall - 0.6, float(chance.uniform(-0.4, 0.2)), (0.45, 0.45), 0.0, float(chance.uniform(0.45, 0.95)))
    return ((wall, -6.0, 0.0), (wall + 0.2, 6.0, 3.0)), cupboard, table, chair
