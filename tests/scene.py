"""Synthetic measurements of a posed body: the same on every run."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

import voodoo

Pose = npt.NDArray[np.float64]


def turn(axis: tuple[float, float, float], angle: float) -> npt.NDArray[np.float64]:
    """Rotation matrix (3, 3) about a unit axis (Rodrigues)."""
    x, y, z = axis
    k = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * k + (1.0 - np.cos(angle)) * k @ k


def surface(
    body: voodoo.Body, world_from_limb: dict[str, Pose], count: int, *, seed: int = 0
) -> npt.NDArray[np.float64]:
    """About `count` points (N, 3) on the sides of the limbs with 5 mm noise, those inside other limbs left out."""
    rng = np.random.default_rng(seed)
    area = np.array([limb.shape.length * (limb.shape.a0 + limb.shape.b1) for limb in body.limbs])
    parts = []
    for limb, fraction in zip(body.limbs, area / area.sum(), strict=True):
        shape, number = limb.shape, int(np.ceil(fraction * count))
        t, angle = rng.uniform(0.0, 1.0, number), rng.uniform(0.0, 2.0 * np.pi, number)
        a, b = shape.a0 + (shape.a1 - shape.a0) * t, shape.b0 + (shape.b1 - shape.b0) * t
        local = np.stack([a * np.cos(angle), b * np.sin(angle), shape.length * t], axis=1)
        pose = world_from_limb[limb.name]
        points = local @ pose[:3, :3].T + pose[:3, 3]
        hidden = np.zeros(number, dtype=bool)
        for other in body.limbs:
            if other.name != limb.name:
                inverse = np.linalg.inv(world_from_limb[other.name])
                hidden |= other.shape.closest_points(points @ inverse[:3, :3].T + inverse[:3, 3]).signed_distance < 0.0
        parts.append(points[~hidden])
    points = np.concatenate(parts)
    return points + rng.normal(0.0, 0.005, points.shape)


def standing_joints(body: voodoo.Body) -> dict[str, npt.NDArray[np.float64]]:
    """Positions of all sites with the body at rest, its root in the world's origin."""
    tracker = voodoo.Tracker(body)
    return dict(tracker.reset_pose(rest_pose(body)).joints)


def rest_pose(body: voodoo.Body) -> dict[str, Pose]:
    """world_from_limb of every limb with all joints closed and unbent, the root in the world's origin."""
    _, limbs, _ = body.core.parts()
    poses: dict[str, Pose] = {}
    for name, parent, _, joint, _ in limbs:
        if parent is None:
            poses[name] = np.eye(4)
        else:
            poses[name] = poses[parent] @ _matrix(joint[1]) @ np.linalg.inv(_matrix(joint[2]))
    return poses


def _matrix(place: tuple[tuple[float, float, float], tuple[float, float, float]]) -> Pose:
    position, rotation = np.asarray(place[0]), np.asarray(place[1])
    angle = float(np.linalg.norm(rotation))
    matrix = np.eye(4)
    if angle > 0.0:
        x, y, z = rotation / angle
        matrix[:3, :3] = turn((float(x), float(y), float(z)), angle)
    matrix[:3, 3] = position
    return matrix
