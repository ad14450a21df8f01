"""Rooms' contents as meshes: boxes, tubes and balls, and the furniture made of them. Meters, z up, on the floor."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
from numpy.typing import NDArray

from lab.training.rotations import about, shortest, unit

Array = NDArray[np.float64]
Rng = np.random.Generator
Mesh = tuple[Array, NDArray[np.int32], bool]  # points, faces, closed (seen from outside only)

_QUADS = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
BOX_FACES = np.array([f for a, b, c, d in _QUADS for f in ((a, b, c), (a, c, d))], np.int32)


def box(size: tuple[float, float, float], at: tuple[float, float, float], yaw: float = 0.0) -> Mesh:
    """A box of a size with the middle of its underside `at` a place."""
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (0, 1)]) * size
    return corners @ about("z", yaw).T + at, BOX_FACES, False


@cache
def _tube_faces(n: int, rings: int) -> NDArray[np.int32]:
    f = []
    for r in range(rings - 1):
        for i in range(n):
            a, b = r * n + i, r * n + (i + 1) % n
            f += [(a, b, b + n), (a, b + n, a + n)]
    for r in (0, rings - 1):
        f += [(r * n, r * n + i, r * n + i + 1) for i in range(1, n - 1)]
    return np.array(f, np.int32)


def tube(a: Array, b: Array, radii: tuple[float, ...], n: int = 12, flat: float = 1.0) -> Mesh:
    """A tube from `a` to `b`; its radius goes through `radii`; `flat` scales it across."""
    a, b = np.asarray(a, float), np.asarray(b, float)
    turn = shortest(np.array([0, 0, 1.0]), unit(b - a))
    angle = np.arange(n) * (2 * np.pi / n)
    ring = np.stack([np.cos(angle), flat * np.sin(angle), 0 * angle], 1)
    t = np.linspace(0, 1, len(radii))
    points = np.concatenate([r * ring @ turn.T + a + s * (b - a) for r, s in zip(radii, t, strict=True)])
    return points, _tube_faces(n, len(radii)), False


def ball(at: Array, radii: tuple[float, float, float], yaw: float = 0.0) -> Mesh:
    """An ellipsoid."""
    n, rings = 12, 8
    t = np.linspace(-np.pi / 2 * 0.97, np.pi / 2 * 0.97, rings)
    angle = np.arange(n) * (2 * np.pi / n)
    points = np.stack(
        [np.stack([np.cos(a) * np.cos(angle), np.cos(a) * np.sin(angle), 0 * angle + np.sin(a)], 1) for a in t]
    )
    return (points.reshape(-1, 3) * radii) @ about("z", yaw).T + np.asarray(at, float), _tube_faces(n, rings), False


def sheet(points: Array) -> Mesh:
    """A surface through a grid of points (rows, columns, 3)."""
    rows, columns = points.shape[:2]
    i = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = i[:-1, :-1].ravel(), i[:-1, 1:].ravel(), i[1:, 1:].ravel(), i[1:, :-1].ravel()
    return (
        points.reshape(-1, 3),
        np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]).astype(np.int32),
        False,
    )


def moved(parts: list[Mesh], at: tuple[float, float], yaw: float) -> list[Mesh]:
    """Parts turned about the upright axis, then moved on the floor."""
    r = about("z", yaw)
    return [(p @ r.T + [at[0], at[1], 0.0], f, c) for p, f, c in parts]


def _legs(rng: Rng, x: float, y: float, height: float) -> list[Mesh]:
    t = rng.uniform(0.015, 0.04)
    if rng.random() < 0.25:  # one post in the middle
        return [tube((0, 0, 0), (0, 0, height), (0.03, 0.03)), box((x * 0.8, y * 0.8, 0.03), (0, 0, 0))]
    return [box((t, t, height), (i * (x / 2 - t), j * (y / 2 - t), 0)) for i in (-1, 1) for j in (-1, 1)]


def stool(rng: Rng, height: float) -> list[Mesh]:
    """A stool with its seat at a height."""
    w = rng.uniform(0.3, 0.5)
    if rng.random() < 0.4:
        return [box((w, w, height), (0, 0, 0))]
    return [box((w, w, 0.05), (0, 0, height - 0.05)), *_legs(rng, w, w, height - 0.05)]


def chair(rng: Rng, height: float | None = None) -> list[Mesh]:
    """A chair that faces x, some with arms; the seat at a height."""
    h = height or rng.uniform(0.4, 0.52)
    w, back = rng.uniform(0.4, 0.55), rng.uniform(0.3, 0.7)
    parts = [box((w, w, 0.05), (0, 0, h - 0.05)), *_legs(rng, w, w, h - 0.05)]
    parts.append(box((rng.uniform(0.03, 0.09), w * rng.uniform(0.7, 1), back), (-w / 2, 0, h + rng.uniform(0, 0.15))))
    if rng.random() < 0.35:
        parts += [box((w * 0.8, 0.05, 0.04), (0, s * w / 2, h + 0.2)) for s in (-1, 1)]
    return parts


def sofa(rng: Rng, height: float | None = None) -> list[Mesh]:
    """A sofa or an armchair that faces x."""
    h, y, x = (
        height or rng.uniform(0.35, 0.5),
        rng.choice([0.8, 1.5, 2.0]) + rng.uniform(-0.1, 0.2),
        rng.uniform(0.6, 0.85),
    )
    parts = [box((x, y, h), (0, 0, 0)), box((0.2, y, h + rng.uniform(0.3, 0.5)), (-x / 2, 0, 0))]
    return parts + [box((x, 0.15, h + rng.uniform(0.12, 0.25)), (0, s * y / 2, 0)) for s in (-1, 1)]


def table(rng: Rng) -> list[Mesh]:
    """A table, some with things on it."""
    x, y, h = rng.uniform(0.5, 0.9), rng.uniform(0.6, 1.8), rng.uniform(0.45, 1.1)
    parts = [box((x, y, rng.uniform(0.02, 0.08)), (0, 0, h)), *_legs(rng, x, y, h)]
    if rng.random() < 0.3:
        parts.append(box((x * 0.9, y, h), (0, 0, 0)))
    for _ in range(rng.integers(0, 4)):
        size = rng.uniform(0.05, 0.35, 3)
        parts.append(box(tuple(size), (rng.uniform(-x, x) / 2.5, rng.uniform(-y, y) / 2.5, h), rng.uniform(0, 3)))
    return parts


def boxes(rng: Rng) -> list[Mesh]:
    """A box, or a pile of them."""
    parts, z = [], 0.0
    for _ in range(rng.integers(1, 4)):
        size = rng.uniform(0.2, 0.7, 3)
        parts.append(box(tuple(size), (rng.normal(0, 0.05), rng.normal(0, 0.05), z), rng.uniform(0, 3)))
        z += size[2]
    return parts


def cupboard(rng: Rng) -> list[Mesh]:
    """A cupboard or a refrigerator."""
    return [box((rng.uniform(0.3, 0.7), rng.uniform(0.4, 1.3), rng.uniform(0.8, 2.1)), (0, 0, 0))]


def shelf(rng: Rng) -> list[Mesh]:
    """An open shelf with things in it."""
    x, y, h, n = rng.uniform(0.25, 0.4), rng.uniform(0.5, 1.2), rng.uniform(1.0, 2.1), int(rng.integers(3, 6))
    parts = [box((x, 0.03, h), (0, s * y / 2, 0)) for s in (-1, 1)]
    for i in range(n + 1):
        z = h * i / n
        parts.append(box((x, y, 0.025), (0, 0, z)))
        for _ in range(rng.integers(0, 3)):
            size = rng.uniform(0.08, 0.25, 3)
            parts.append(box(tuple(size), (0, rng.uniform(-y, y) / 2.6, z), rng.uniform(0, 3)))
    return parts


def coat_stand(rng: Rng) -> list[Mesh]:
    """A coat stand, with a coat and a hat."""
    h = rng.uniform(1.5, 1.95)
    parts = [tube((0, 0, 0), (0, 0, h), (0.02, 0.02)), tube((0, 0, 0), (0, 0, 0.05), (0.22, 0.2))]
    for _ in range(rng.integers(1, 4)):
        a, top, length = rng.uniform(0, 6.3), h - rng.uniform(0.05, 0.3), rng.uniform(0.5, 1.2)
        x, y = 0.12 * np.cos(a), 0.12 * np.sin(a)
        wide = rng.uniform(0.1, 0.22)
        radii = (wide * rng.uniform(0.7, 1.3), wide * rng.uniform(0.8, 1.2), wide, wide * 0.8, 0.05)
        parts.append(tube((x, y, top - length), (x * 0.6, y * 0.6, top), radii, flat=rng.uniform(0.4, 1)))
        if rng.random() < 0.5:
            parts.append(tube((x * 2, y * 2, top - 0.65), (x, y, top - 0.08), (0.05, 0.06, 0.07)))
    if rng.random() < 0.6:
        parts.append(ball((0, 0, h + 0.02), (0.13, 0.13, 0.09)))
    return parts


def lamp(rng: Rng) -> list[Mesh]:
    """A standing lamp."""
    h, r = rng.uniform(1.2, 1.9), rng.uniform(0.1, 0.3)
    shade = tube((0, 0, h - 0.3), (0, 0, h), (r, r * rng.uniform(0.4, 1)))
    return [tube((0, 0, 0), (0, 0, h), (0.02, 0.02)), shade, tube((0, 0, 0), (0, 0, 0.04), (0.16, 0.16))]


def plant(rng: Rng) -> list[Mesh]:
    """A plant in a pot: leaves on all sides."""
    h, wide = rng.uniform(0.6, 1.9), rng.uniform(0.2, 0.5)
    parts = [tube((0, 0, 0), (0, 0, 0.3), (0.13, 0.18)), tube((0, 0, 0.3), (0, 0, h * 0.8), (0.02, 0.015))]
    n = int(rng.integers(15, 50))
    middle = np.stack([rng.normal(0, wide / 2, n), rng.normal(0, wide / 2, n), rng.uniform(0.35, h, n)], 1)
    a, b = rng.normal(0, 0.09, (n, 3)), rng.normal(0, 0.05, (n, 3))
    points = np.concatenate([middle + a, middle - a, middle + b], 0)
    faces = np.stack([np.arange(n), np.arange(n) + n, np.arange(n) + 2 * n], 1).astype(np.int32)
    return [*parts, (points, faces, False)]


def robot_arm(rng: Rng) -> list[Mesh]:
    """A robot's arm on a base."""
    z, r = rng.choice([0.0, 0.4, 0.75]), rng.uniform(0.04, 0.09)
    parts = [box((0.4, 0.4, max(z, 0.05)), (0, 0, 0))]
    p = np.array([0, 0, max(z, 0.05)])
    q = p + [0, 0, rng.uniform(0.15, 0.4)]
    parts.append(tube(p, q, (r * 1.3, r * 1.2)))
    for _ in range(rng.integers(2, 5)):
        d = rng.normal(0, 1, 3) + [0.3, 0, 0.5]
        p, q = q, q + unit(d) * rng.uniform(0.15, 0.45)
        q[2] = max(q[2], 0.1)
        parts += [tube(p, q, (r, r * 0.85)), ball(p, (r * 1.25,) * 3)]
        r *= 0.88
    return [*parts, ball(q, (r * 1.3,) * 3)]


def mannequin(rng: Rng) -> list[Mesh]:
    """Of a person's outline, but made of a few tubes: a dummy, a post with a head, rolled carpets."""
    h = rng.uniform(1.3, 1.95)
    if rng.random() < 0.5:
        r = rng.uniform(0.08, 0.3)
        parts = [tube((0, 0, 0), (0, 0, h), (r, r * rng.uniform(0.6, 1.2)), flat=rng.uniform(0.5, 1))]
        return parts + ([ball((0, 0, h + 0.1), (0.1, 0.1, 0.13))] if rng.random() < 0.5 else [])
    w = rng.uniform(0.15, 0.22)
    torso = (w, w * 0.8, w * 1.1, w * 1.05, 0.06)
    parts = [tube((0, 0, h * 0.5), (0, 0, h * 0.86), torso, flat=0.6), tube((0, 0, 0), (0, 0, h * 0.5), (0.025, 0.025))]
    return [*parts, tube((0, 0, 0), (0, 0, 0.03), (0.2, 0.2))]


def curtain(rng: Rng) -> list[Mesh]:
    """A hanging curtain in folds, or a towel on a rack."""
    y, top, low = rng.uniform(0.4, 1.6), rng.uniform(1.2, 2.3), rng.uniform(0, 0.8)
    t = np.linspace(-0.5, 0.5, 40)
    deep, k, phase = rng.uniform(0.02, 0.08), rng.uniform(15, 60), rng.uniform(0, 6.3)
    grid = np.zeros((6, 40, 3))
    for i, z in enumerate(np.linspace(low, top, 6)):
        grid[i] = np.stack([deep * np.sin(k * t * y + phase + 0.3 * i), t * y * (1 - 0.04 * i), 0 * t + z], 1)
    return [sheet(grid)]


def balls(rng: Rng) -> list[Mesh]:
    """Cushions, bags, a gymnastics ball, an animal's rough shape."""
    if rng.random() < 0.5:
        r = rng.uniform(0.15, 0.4)
        return [ball((0, 0, r), (r, r * rng.uniform(0.5, 1), r))]
    h, w = rng.uniform(0.3, 0.6), rng.uniform(0.1, 0.17)
    parts = [ball((0, 0, h), (w * 2.2, w, w)), ball((w * 2.3, 0, h + 0.15), (w, w * 0.6, w * 0.7))]
    legs = [(i * w * 1.5, j * w * 0.6) for i in (-1, 1) for j in (-1, 1)]
    return parts + [tube((x, y, 0), (x, y, h), (0.03, 0.04)) for x, y in legs]


def bed(rng: Rng, height: float | None = None) -> list[Mesh]:
    """A bed along x with its middle at the origin; the mattress at a height."""
    h, y = height or rng.uniform(0.35, 0.65), rng.choice([0.9, 1.4, 1.8]) + rng.uniform(-0.1, 0.1)
    x = rng.uniform(1.9, 2.1)
    parts = [box((x, y, h if rng.random() < 0.5 else 0.25), (0, 0, 0)), box((x, y, 0.2), (0, 0, h - 0.2))]
    return [*parts, box((0.06, y, h + rng.uniform(0.1, 0.6)), (x / 2, 0, 0)), ball((0.8, 0, h), (0.2, 0.35, 0.08))]


def desk(rng: Rng, height: float | None = None) -> list[Mesh]:
    """A desk or a counter before a person who faces x and sits or stands at the origin; some with a screen and things."""
    h, x, y = height or rng.choice([0.74, 1.05]) + rng.uniform(-0.05, 0.1), rng.uniform(0.4, 0.9), rng.uniform(0.9, 2.4)
    parts = [box((x, y, 0.04), (0, 0, h - 0.04)), *_legs(rng, x, y, h - 0.04)]
    if rng.random() < 0.65:  # closed at the front, or a solid counter
        parts.append(box((x if rng.random() < 0.3 else 0.03, y, h - 0.04), (x / 2 - 0.03, 0, 0)))
    if rng.random() < 0.35:
        wide, high = rng.uniform(0.35, 0.65), rng.uniform(0.25, 0.5)
        parts.append(box((0.04, wide, high), (0.0, rng.uniform(-0.5, 0.5), h + 0.02)))
    for _ in range(rng.integers(0, 4)):
        size = rng.uniform(0.05, 0.3, 3)
        parts.append(box(tuple(size), (rng.uniform(-x, x) / 2.5, rng.uniform(-y, y) / 2.2, h), rng.uniform(0, 3)))
    return parts


def _wheel(middle: tuple[float, float, float], radius: float, solid: bool) -> list[Mesh]:
    """A wheel that rolls along x."""
    at, a = np.array(middle), np.linspace(0, 2 * np.pi, 21)
    grid = np.stack([np.stack([r * np.cos(a), y + 0 * a, r * np.sin(a)], 1) for r, y in
                     ((radius - 0.05, 0.02), (radius, 0.02), (radius, -0.02), (radius - 0.05, -0.02))])  # fmt: skip
    rim, side = sheet(grid + at), np.array([0, 0.01, 0])
    if solid:
        return [rim, tube(at - side, at + side, (radius,) * 2)]
    ends = radius * np.stack([np.cos(a), 0 * a, np.sin(a)], 1)[:10:3]
    return [rim, *(tube(at - d, at + d, (0.008, 0.008), n=4) for d in ends)]


def wheelchair(rng: Rng, height: float | None = None, size: float = 1.0) -> list[Mesh]:
    """A wheelchair that faces x; the seat at a height above the middle; some of them electric."""
    h, w, r, solid = height or rng.uniform(0.45, 0.55), rng.uniform(0.4, 0.56) * size, 0.3 * size, rng.random() < 0.3
    deep, back, grip = 0.42 * size, rng.uniform(0.3, 0.6) * size, rng.uniform(0.16, 0.26) * size
    parts = [box((deep, w, 0.05), (0.05, 0, h - 0.05)), box((0.04, w, back), (0.05 - deep / 2, 0, h))]
    electric = rng.random() < 0.25
    if electric:
        parts.append(box((deep * 1.3, w * 0.8, h - 0.2), (0, 0, 0.12)))
    for s in (-1, 1):
        y, foot = s * (w / 2 + 0.03), deep / 2 + rng.uniform(0.1, 0.3) * size
        parts += _wheel((-0.08 * size, y, 0.18 if electric else r), 0.18 if electric else r, solid)
        parts.append(tube((deep / 2, y - 0.03 * s, 0.09), (deep / 2, y + 0.01 * s, 0.09), (0.09, 0.09)))  # a caster
        parts.append(tube((deep / 2, y - 0.04 * s, h), (foot, y - 0.08 * s, 0.14), (0.015, 0.015)))
        parts.append(box((0.18 * size, 0.15 * size, 0.02), (foot + 0.04, s * w / 4, rng.uniform(0.08, 0.14))))
        if rng.random() < 0.7:
            parts.append(box((deep * 0.8, 0.05, 0.04), (0, y, h + grip)))
            parts.append(box((deep * 0.8, 0.02, grip if rng.random() < 0.5 else 0.02), (0, y, h)))
        if rng.random() < 0.6:
            parts.append(tube((-deep / 2, y, h + back), (-deep / 2 - 0.13, y, h + back), (0.02, 0.02)))
    return parts


def walking_frame(rng: Rng, height: float | None = None, size: float = 1.0) -> list[Mesh]:
    """A walking frame, open towards -x, or one with wheels and a seat; its handles at a height."""
    h, w, deep = height or rng.uniform(0.75, 0.95), 0.28 * size, rng.uniform(0.25, 0.45) * size
    thick = (rng.uniform(0.012, 0.022),) * 2
    parts = [tube((deep, -w, z * h), (deep, w, z * h), thick) for z in (0.8, 0.4)]
    for y in (-w, w):
        parts += [tube((-0.1, y, h), (deep, y, 0.95 * h), thick), tube((0, y, h), (-0.06, y * 1.1, 0), thick)]
        parts.append(tube((deep, y, 0.95 * h), (deep + 0.06, y * 1.1, 0), thick))
    if rng.random() < 0.4:
        parts.append(box((0.3 * size, 2 * w, 0.04), (deep / 2, 0, 0.62 * h)))
        parts += [p for x in (0.0, deep) for s in (-1, 1) for p in _wheel((x, s * w * 1.1, 0.1), 0.1, True)]
    return parts


def robot(rng: Rng) -> list[Mesh]:
    """A robot with a head, arms and a skirt or a column instead of legs, or a child-sized one."""
    h, w = rng.uniform(0.7, 1.7), rng.uniform(0.15, 0.26)
    waist, base, head = rng.uniform(0.35, 0.5) * h, rng.uniform(0.8, 1.5) * w, rng.uniform(0.1, 0.17)
    foot = (base, base * 0.95, base * 0.8) if rng.random() < 0.6 else (base, 0.08, 0.08)
    parts = [tube((0, 0, 0), (0, 0, waist), foot)]
    parts.append(ball((0.0, 0, h - head), (head * rng.uniform(0.9, 1.2), head, head * 0.9)))
    trunk = (w * 0.8, w, w * 0.95, w * 0.5)
    parts.append(tube((0, 0, waist), (0, 0, h - 1.9 * head), trunk, flat=rng.uniform(0.6, 1.1)))
    for s in (-1, 1):
        if rng.random() < 0.85:
            elbow = np.array([rng.uniform(-0.05, 0.1), s * (w + 0.08), 0.5 * (waist + h) - 0.1])
            parts += [tube((0, s * w, h - 2.3 * head), elbow, (0.06, 0.05))]
            parts += [tube(elbow, elbow + [rng.uniform(0, 0.25), 0, rng.uniform(-0.3, 0.05)], (0.05, 0.06))]
    return parts


Maker = Callable[[Rng], list[Mesh]]
ANY: tuple[Maker, ...] = (
    chair, sofa, table, boxes, cupboard, shelf, coat_stand, lamp, plant, robot_arm, mannequin, curtain, balls,
)  # fmt: skip
LIKE_PEOPLE: tuple[Maker, ...] = (coat_stand, mannequin, cupboard, shelf, lamp, plant, robot_arm, curtain, chair, boxes)
MORE: tuple[Maker, ...] = (*ANY, bed, desk, wheelchair, walking_frame, robot)
MORE_LIKE: tuple[Maker, ...] = (*LIKE_PEOPLE, robot, robot, robot, wheelchair)
IN_FRONT: tuple[Maker, ...] = (table, table, boxes, chair, cupboard, plant, robot_arm, balls, sofa)


def room(rng: Rng, back: float, left: float, right: float, front: float) -> list[Mesh]:
    """Floor, walls and ceiling about the camera: x from -front to back, y from -right to left."""
    h, parts = rng.uniform(2.3, 3.2), []
    if rng.random() < 0.93:
        parts.append(_quad([(-front, -right, 0), (back, -right, 0), (back, left, 0), (-front, left, 0)]))
    walls = ([(back, -right), (back, left)], [(-front, left), (back, left)], [(-front, -right), (back, -right)])
    for (a, b), fraction in zip(walls, (0.85, 0.6, 0.6), strict=True):
        if rng.random() < fraction:
            parts.append(_quad([(*a, 0), (*b, 0), (*b, h), (*a, h)]))
    if rng.random() < 0.5:
        parts.append(_quad([(-front, -right, h), (back, -right, h), (back, left, h), (-front, left, h)]))
    if rng.random() < 0.2:  # a column or a corner that stands out
        w = rng.uniform(0.3, 1.0)
        parts.append(box((w, w, h), (back - w / 2, rng.uniform(-right, left), 0)))
    return parts


def _quad(corners: list[tuple[float, float, float]]) -> Mesh:
    return np.array(corners, float), np.array([[0, 1, 2], [0, 2, 3]], np.int32), False
