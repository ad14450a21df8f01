"""One random camera image: a person or two, or none, in a room with furniture, seen by some sensor."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from lab.training import anybody, raster, sensors, shapes
from lab.training.bodies import JOINTS, Bodies, Body
from lab.training.poses import Pose
from lab.training.rotations import about, unit

Array = NDArray[np.float64]
Rng = np.random.Generator
NOBODY = 0.2  # share of images without a person
SECOND = 0.12  # share of images with another person
CUT = 0.35  # share of images whose border may cut the person


@dataclass(frozen=True)
class Person:
    """Truth of one person: label in the image, joints (17, 3) and forward direction (3) in the camera's frame, lengths (9)."""

    label: int
    joints: Array
    forward: Array
    lengths: Array
    observed: NDArray[np.bool_]  # joints in the image and not hidden by something else
    inside: NDArray[np.bool_]  # joints in the image
    pixels: int


@dataclass(frozen=True)
class Frame:
    """A depth image (m, 0: nothing), whose pixels show whom (0: nobody), the camera, and what is told of the place."""

    depth: NDArray[np.float32]
    labels: NDArray[np.uint8]
    intrinsics: tuple[float, float, float, float]
    up: Array | None
    floor: tuple[Array, float] | None
    people: list[Person]
    group: str = "adult"  # of anybody.GROUPS


@dataclass
class _World:
    """Meshes in the world (z up, the camera above the origin) as they are gathered."""

    meshes: list[tuple[shapes.Mesh, int]] = field(default_factory=list)

    def add(self, parts: list[shapes.Mesh], label: int = 0) -> None:
        self.meshes += [(m, label) for m in parts]


class Scenes:
    """Makes frames from bodies and poses."""

    def __init__(self, bodies: Bodies, poses: list[Pose]) -> None:
        """Keep what people are drawn from."""
        self.bodies, self.poses = bodies, poses

    def frame(self, rng: Rng, group: str = "adult") -> Frame:
        """One random frame of a group."""
        which = anybody.traits(rng, group)
        sensor = sensors.draw_sensor(rng)
        if "coarse" in which and rng.random() < 0.6:
            sensor = replace(sensor, step=rng.uniform(0.017, 0.025))  # depth of eight bits
        world = _World()
        cut = rng.random() < CUT or bool(which & {"near", "cut"})
        near, far = (0.9, 1.7) if cut and rng.random() < 0.4 else (1.8, 3.6) if sensor.user_mask else (1.6, 4.8)
        if "near" in which:
            near, far = 0.6, 1.5
        if not cut:
            near = float(np.clip(0.9 / np.tan(sensor.vfov / 2), near, far))
        away = float(np.exp(rng.uniform(np.log(near), np.log(far))))
        people = 0 if rng.random() < NOBODY else 1 + int(rng.random() < SECOND)
        at = self._place(rng, sensor, away, cut)
        if "beside" in which:
            people, at = _beside(rng, at[0])
        elif "cut" in which and rng.random() < 0.5:
            bearing = rng.choice([-1, 1]) * rng.uniform(0.75, 1.1) * sensor.hfov / 2
            at[0] = away * np.array([np.cos(bearing), np.sin(bearing)])
        bare = sensor.user_mask and people > 0
        placed = [self._person(rng, world, i + 1, at[i], which) for i in range(people)]
        height = rng.uniform(0.4, 2.6) if rng.random() < 0.35 else rng.normal(1.1, 0.3)
        if placed and rng.random() < 0.05:
            height = max(height, 1.8)
        target = None
        if which and placed:
            tall = world.meshes[0][0][0][:, 2]  # the first person's surface
            part = rng.uniform(0.4, 0.95) if "near" in which else rng.uniform(0.4, 0.6)
            target = float(tall.min() + part * (tall.max() - tall.min()))
        if "near" in which:
            height = target + rng.normal(0.1, 0.25) if target else height
        view = _camera(rng, sensor, float(np.clip(height, 0.35, 2.6)), away, cut, target)
        _furnish(rng, world, at, away, people, bare, more=bool(which))
        depth, labels = _render(world, sensor, view)
        speckled = "coarse" in which and rng.random() < 0.7
        return replace(self._seen(rng, sensor, view, depth, labels, placed, speckled=speckled), group=group)

    def _place(self, rng: Rng, sensor: sensors.Sensor, away: float, cut: bool) -> list[Array]:
        half = 0.5 * sensor.hfov
        bearing = half * (
            rng.uniform(-0.6, 0.6) if rng.random() < 0.8 else rng.choice([-1, 1]) * rng.uniform(0.6, 1.05)
        )
        first = np.array([away * np.cos(bearing), away * np.sin(bearing)])
        return [first, first + rng.choice([-1, 1]) * np.array([rng.uniform(-1, 1), rng.uniform(0.4, 1.2)])]

    def _person(
        self, rng: Rng, world: _World, label: int, at: Array, which: frozenset[str]
    ) -> tuple[int, dict[str, Array], Array, Body]:
        body = anybody.shaped(rng, self.bodies[int(rng.integers(len(self.bodies)))], which)
        pose, size = anybody.pose(rng, self.poses, which), body.stature / 1.7
        what = str(rng.choice(anybody.HOLDS)) if "carrying" in which and not pose.lying else ""
        if what:
            pose = anybody.holding(rng, pose, what)
        facing = np.arctan2(-at[1], -at[0])
        turn = facing + (rng.normal(0, 0.45) if rng.random() < 0.5 else rng.uniform(-np.pi, np.pi))
        pose = pose.turned(about("z", turn))
        points, joints = body.posed(pose, rng)
        lift = -points[:, 2].min() + (rng.uniform(0, 0.3) if rng.random() < 0.06 else 0.0)
        if pose.lying:
            lift += rng.choice([0.0, 0.05, 0.45])
        if which and pose.seat:  # feet on the plates of a wheelchair, or above the floor
            high = 0.5 - 0.25 * size
            lift += rng.uniform(0.08, 0.16) if "wheelchair" in which else rng.choice([0.0, rng.uniform(0, high)])
        shift = np.array([at[0], at[1], lift]) - [*points[:, :2].mean(0), 0]
        joints = {n: v + shift for n, v in joints.items()}
        world.meshes.append(((points + shift, self.bodies.faces, True), label))
        if which:
            self._things(rng, world, label, which, (points + shift, joints, pose, body), what)
        else:
            world.add(_carried(rng, joints, pose))
        if rng.random() < 0.08 and (pose.limbs[:, 3, 2] < -0.8).all():
            world.add([_skirt(rng, joints)], label)
        if pose.seat and "wheelchair" not in which:
            seat = joints["humanoid_root"][2] - 0.09 * body.stature / 1.7
            if 0.2 < seat < 1.0 and rng.random() < 0.85:
                kind = (shapes.stool, shapes.chair, shapes.chair, shapes.sofa)[rng.integers(4)]
                yaw = np.arctan2(pose.pelvis[1, 0], pose.pelvis[0, 0])
                back = joints["humanoid_root"][:2] - 0.05 * np.array([np.cos(yaw), np.sin(yaw)])
                world.add(shapes.moved(kind(rng, seat), (back[0], back[1]), yaw))
        forward = pose.chest[:, 0] + pose.pelvis[:, 0]
        return label, joints, forward / np.linalg.norm(forward), body

    def _things(
        self, rng: Rng, world: _World, label: int, which: frozenset[str],
        person: tuple[Array, dict[str, Array], Pose, Body], what: str,
    ) -> None:  # fmt: skip
        """What a person wears, holds, sits in, lies on and stands behind."""
        points, joints, pose, body = person
        root, own, size = joints["humanoid_root"], label + anybody.THINGS, body.stature / 1.7
        if what:
            world.add(anybody.held(rng, joints, pose, what, body), own)
        if "clothes" in which:
            worn, things = anybody.garments(rng, points, joints, pose, body)
            world.add(worn, label)
            world.add(things, own)
        yaw = float(np.arctan2(pose.pelvis[1, 0], pose.pelvis[0, 0]))
        ahead = np.array([np.cos(yaw), np.sin(yaw)])
        if "wheelchair" in which and pose.seat:
            world.add(anybody.wheelchair(rng, root, pose, size), own)
        elif "seated" in which and rng.random() < 0.15:
            edge = root[:2] - rng.uniform(0.2, 0.5) * ahead  # across the side of a bed
            world.add(shapes.moved(shapes.bed(rng, root[2] - 0.09 * size), (edge[0], edge[1]), yaw + np.pi / 2))
        if "desk" in which:
            belly = points[np.abs(points[:, 2] - root[2] - 0.15) < 0.1, :2]
            near = min(float(((belly - root[:2]) @ ahead).max(initial=0.1)), 0.35)
            world.add(anybody.desk(rng, root, pose, size, sits=pose.seat, near=near))
        if pose.lying and (low := float(points[:, 2].min())) > 0.3:
            axis = unit(joints["head_center"] - root)
            make, turn = (shapes.bed, 0.0) if rng.random() < 0.65 else (shapes.sofa, np.pi / 2)
            middle = points[:, :2].mean(0)
            world.add(shapes.moved(make(rng, low), (middle[0], middle[1]), float(np.arctan2(axis[1], axis[0])) + turn))

    def _seen(
        self, rng: Rng, sensor: sensors.Sensor, view: tuple[Array, Array], depth: Array, labels: NDArray[np.uint8],
        placed: list[tuple[int, dict[str, Array], Array, Body]], *, speckled: bool = False,
    ) -> Frame:  # fmt: skip
        r, t = view
        up = r @ np.array([0, 0, 1.0])
        floor = float(up @ t)  # of points on the floor: up . p = floor
        people = []
        for label, joints, forward, body in placed:
            at = np.stack([r @ joints[n] + t for n in JOINTS])
            inside, observed = _visible(at, sensor, depth, labels, label)
            people.append(Person(label, at, r @ forward, body.lengths, observed, inside, int((labels == label).sum())))
        image, who = sensors.sense(rng, sensor, depth, labels)
        fx, fy, cx, cy = sensor.intrinsics
        v, u = np.mgrid[: sensor.height, : sensor.width]
        height = depth * (up[0] * (u - cx) / fx + up[1] * (v - cy) / fy + up[2]) - floor
        if speckled:
            image = sensors.speckled(rng, image, (np.abs(height) < 0.02) & (who == 0))
        if sensor.user_mask and people:
            image = sensors.user_mask(rng, image, who, height)
            who[image == 0] = 0
        tilt = about("x", rng.normal(0, 0.015)) @ about("z", rng.normal(0, 0.015))
        x, given_floor = rng.random(), None
        if x < 0.35:
            given_floor = (tilt @ up, floor + rng.normal(0, 0.015))
        known = tilt @ up if given_floor is not None or x < 0.75 or abs(up[1]) < 0.6 else None
        return Frame(image.astype(np.float32), who, sensor.intrinsics, known, given_floor, people)


def _beside(rng: Rng, first: Array) -> tuple[int, list[Array]]:
    """Two or three people who touch or overlap, and their places."""
    people, across = int(rng.integers(2, 4)), np.array([-first[1], first[0]]) / np.linalg.norm(first)
    at, side = [first], rng.choice([-1, 1])
    for k in range(1, people):
        step = (side if k == 1 else -side) * across * rng.uniform(0.25, 0.6)
        at.append(first + step + first / np.linalg.norm(first) * rng.normal(0, 0.15))
    return people, at


def _carried(rng: Rng, joints: dict[str, Array], pose: Pose) -> list[shapes.Mesh]:
    """What a person holds, rarely: a stick, a ball, a box, a bag."""
    if rng.random() > 0.08:
        return []
    k = int(rng.integers(2))
    hand, along = joints[("l_hand", "r_hand")[k]], pose.limbs[k, 2]
    x = rng.random()
    if x < 0.4:
        d = along + rng.normal(0, 0.7, 3)
        d *= rng.uniform(0.2, 1.0) / np.linalg.norm(d)
        return [shapes.tube(hand - 0.2 * d, hand + d, (0.015, rng.uniform(0.01, 0.04)))]
    if x < 0.7:
        r = rng.uniform(0.04, 0.15)
        return [shapes.ball(hand + along * r, (r, r, r))]
    size = rng.uniform(0.05, 0.4, 3)
    return [shapes.box((size[0], size[1], size[2]), (hand[0], hand[1], hand[2] - size[2] * rng.uniform(0.3, 1)))]


def _skirt(rng: Rng, joints: dict[str, Array]) -> shapes.Mesh:
    """A skirt or the skirts of a coat, from the waist to about the knees."""
    top, knees = joints["humanoid_root"], 0.5 * (joints["l_knee"] + joints["r_knee"])
    wide = 0.11 + 0.5 * float(np.linalg.norm(joints["l_knee"] - joints["r_knee"]))
    waist = rng.uniform(0.14, 0.18)
    end = top + (knees - top) * rng.uniform(0.7, 1.5)
    return shapes.tube(top, end, (waist, 0.5 * (waist + wide) + 0.05, wide + rng.uniform(0, 0.08)))


def _camera(
    rng: Rng, sensor: sensors.Sensor, height: float, away: float, cut: bool, target: float | None
) -> tuple[Array, Array]:
    """Rotation and shift from the world to the camera: it looks about along x, at the person (a height) up and down."""
    aim = np.arctan2(height - (rng.uniform(0.75, 1.05) if target is None else target), away)
    if cut and rng.random() < 0.5:
        aim += rng.choice([-1, 1]) * rng.uniform(0.2, 0.9) * sensor.vfov / 2  # the image's border cuts the person
    elif cut and target is None:
        aim = 0.5 * aim
    tilt = float(np.clip(aim + rng.normal(0, 0.05), -0.55, 0.6))
    roll = rng.normal(0, 0.03)
    if rng.random() < 0.03:
        roll += rng.choice([-1, 1]) * np.pi / 2
    forward = about("y", tilt) @ np.array([1.0, 0, 0])
    right = np.array([0, -1.0, 0])
    r = about("z", roll) @ np.stack([right, np.cross(forward, right), forward])
    return r, -r @ np.array([0, 0, height])


def _furnish(rng: Rng, world: _World, at: list[Array], away: float, people: int, bare: bool, *, more: bool) -> None:
    walls = rng.random() < 0.85
    back, left, right = away + rng.exponential(1.0) + 0.25, rng.uniform(1, 3.5), rng.uniform(1, 3.5)
    if walls:
        world.add(shapes.room(rng, back, left + abs(at[0][1]), right + abs(at[0][1]), 1.0))
    else:
        world.add(shapes.room(rng, 25, 15, 15, 1.0)[:1])
    if bare:
        if rng.random() < 0.15:
            _occlude(rng, world, at[0], away)
        return
    if people and rng.random() < 0.2:
        _occlude(rng, world, at[0], away)
    count = rng.integers(0, 5) if people else rng.integers(0, 7)
    for _ in range(count):
        like, usual = (shapes.MORE_LIKE, shapes.MORE) if more else (shapes.LIKE_PEOPLE, shapes.ANY)
        kinds = like if not people and rng.random() < 0.7 else usual
        make = kinds[rng.integers(len(kinds))]
        for _ in range(4):
            x, y = rng.uniform(1.0, back + 0.3), rng.uniform(-right, left) * 0.8
            gap = min(np.hypot(x - p[0], y - p[1]) for p in at[: max(people, 1)])
            apart = 0.0 if not people else 0.3 if rng.random() < 0.25 else 0.7
            hides = people and np.hypot(x, y) < away and abs(np.arctan2(y, x) - np.arctan2(at[0][1], at[0][0])) < 0.35
            if gap > apart and not hides:
                world.add(shapes.moved(make(rng), (x, y), rng.uniform(-np.pi, np.pi)))
                break


def _occlude(rng: Rng, world: _World, at: Array, away: float) -> None:
    """Something between the camera and the person."""
    make = shapes.IN_FRONT[rng.integers(len(shapes.IN_FRONT))]
    fraction = rng.uniform(0.35, 0.8) if rng.random() < 0.6 else 1 - 0.5 / away
    side = rng.normal(0, 0.3)
    x, y = at[0] * fraction - at[1] / away * side, at[1] * fraction + at[0] / away * side
    if np.hypot(x, y) > 0.6:
        world.add(shapes.moved(make(rng), (float(x), float(y)), rng.uniform(-np.pi, np.pi)))


def _render(world: _World, sensor: sensors.Sensor, view: tuple[Array, Array]) -> tuple[Array, NDArray[np.uint8]]:
    r, t = view
    depth = np.full((sensor.height, sensor.width), sensors.FAR)
    labels = np.zeros((sensor.height, sensor.width), np.uint8)
    for (points, faces, closed), label in world.meshes:
        raster.draw(np.ascontiguousarray(points @ r.T + t), faces, label, sensor.intrinsics, closed, depth, labels)
    return depth, labels


def _visible(
    at: Array, sensor: sensors.Sensor, depth: Array, labels: NDArray[np.uint8], label: int
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Joints in the image; and of these the ones that nothing but the person's own body hides."""
    fx, fy, cx, cy = sensor.intrinsics
    z = np.maximum(at[:, 2], 0.05)
    u, v = np.rint(fx * at[:, 0] / z + cx).astype(int), np.rint(fy * at[:, 1] / z + cy).astype(int)
    inside = (u >= 0) & (v >= 0) & (u < sensor.width) & (v < sensor.height) & (at[:, 2] > 0.2)
    observed = inside.copy()
    for i in np.nonzero(inside)[0]:
        own = labels[max(v[i] - 1, 0) : v[i] + 2, max(u[i] - 1, 0) : u[i] + 2] == label
        near = depth[v[i], u[i]] < at[i, 2] - 0.03
        observed[i] = own.any() or not near
    return inside, observed
