"""Track something that is not a human: a desk lamp whose arms and shade turn, seen as noisy 3-D points.

Run it from anywhere: python examples/track_lamp.py
"""

from pathlib import Path

import numpy as np

import voodoo

HERE = Path(__file__).resolve().parent


def turned(axis: int, angle: float) -> np.ndarray:
    """4x4 rotation about a main axis."""
    matrix, (i, j) = np.eye(4), [(1, 2), (2, 0), (0, 1)][axis]
    matrix[[i, j], [i, j]] = np.cos(angle)
    matrix[i, j], matrix[j, i] = -np.sin(angle), np.sin(angle)
    return matrix


def shifted(z: float) -> np.ndarray:
    """4x4 shift along z."""
    matrix = np.eye(4)
    matrix[2, 3] = z
    return matrix


def true_poses(t: float) -> dict[str, np.ndarray]:
    """Where the limbs of the lamp really are after t seconds; the foot stands still."""
    lower = shifted(0.04) @ turned(0, -0.3 + 0.4 * np.sin(t))
    upper = lower @ shifted(0.40) @ turned(0, 1.2 + 0.3 * np.sin(1.3 * t))
    shade = upper @ shifted(0.36) @ turned(0, 1.0 - 0.3 * np.sin(t)) @ turned(1, 0.2 * np.sin(2.0 * t))
    return {"foot": np.eye(4), "lower_arm": lower, "upper_arm": upper, "shade": shade}


def observed(lamp: voodoo.Body, poses: dict[str, np.ndarray], rng: np.random.Generator) -> np.ndarray:
    """300 noisy points (3 mm) on every limb."""
    clouds = []
    for limb in lamp.limbs:
        shape, pose = limb.shape, poses[limb.name]
        t, angle = rng.uniform(0.0, 1.0, 300), rng.uniform(0.0, 2.0 * np.pi, 300)
        a, b = shape.a0 + (shape.a1 - shape.a0) * t, shape.b0 + (shape.b1 - shape.b0) * t
        local = np.stack([a * np.cos(angle), b * np.sin(angle), shape.length * t], axis=1)
        clouds.append(local @ pose[:3, :3].T + pose[:3, 3])
    points = np.concatenate(clouds)
    return points + rng.normal(0.0, 0.003, points.shape)


def main() -> float:
    """Track four seconds at 30 Hz; returns the mean error of the bulb in meters."""
    lamp = voodoo.Body.load(HERE / "bodies" / "lamp.toml")
    tracker = voodoo.Tracker(lamp)
    tracker.reset_pose(true_poses(0.0))
    rng, errors = np.random.default_rng(0), []
    for index in range(120):
        poses = true_poses(index / 30.0)
        frame = voodoo.Frame(stamp=index / 30.0)
        frame.add_points(observed(lamp, poses, rng))
        estimate = tracker.step(frame)
        bulb = (poses["shade"] @ [0.0, 0.0, 0.10, 1.0])[:3]
        errors.append(float(np.linalg.norm(estimate.joints["bulb"] - bulb)))
        if index % 30 == 29:
            print(f"{estimate.stamp:.2f} s: bulb off by {1000 * errors[-1]:.1f} mm, {estimate.status}")
    print(f"mean error of the bulb: {1000 * np.mean(errors):.1f} mm")
    return float(np.mean(errors))


if __name__ == "__main__":
    main()
