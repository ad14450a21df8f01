"""Cost of one ICP iteration per point: voodoo against small_gicp's point-to-plane, same points, same run, one thread.

pip install small_gicp; python lab/peers/compare_small_gicp.py [POINTS]

The scene is a torso-sized tapered cylinder, seen as noisy points, displaced by 2 cm and 0.05 rad.

What each does in an iteration, for every point:
  voodoo      closest point and normal on the analytic surface (SIMD), box test, gate, moments for the orientation
  small_gicp  nearest neighbor in a k-d tree over a sampled surface with estimated normals, gate, 6x6 point-to-plane
              accumulation, and at least one evaluation of the error (Levenberg-Marquardt)
Building the tree and estimating normals is left out: small_gicp does it once for a target that stays rigid.
The cost of an iteration is the difference between runs of many and of few iterations, the median of several.
"""

import platform
import statistics
import sys
import time
from collections.abc import Callable

import numpy as np
import small_gicp

import voodoo

LENGTH, A0, B0, A1, B1 = 0.55, 0.16, 0.11, 0.19, 0.13
TORSO = f"""
name = "torso"
[[limbs]]
name = "torso"
shape = {{ length = {LENGTH}, a0 = {A0}, b0 = {B0}, a1 = {A1}, b1 = {B1} }}
"""


def surface(count: int, rng: np.random.Generator) -> np.ndarray:
    """Points (N, 3) on the side of the torso."""
    t, angle = rng.uniform(0.0, 1.0, count), rng.uniform(0.0, 2.0 * np.pi, count)
    a, b = A0 + (A1 - A0) * t, B0 + (B1 - B0) * t
    return np.stack([a * np.cos(angle), b * np.sin(angle), LENGTH * t], axis=1)


def displaced(points: np.ndarray) -> np.ndarray:
    """Turned by 0.05 rad about z and x, shifted by 2 cm."""
    c, s = np.cos(0.05), np.sin(0.05)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ np.array(
        [[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]]
    )
    return points @ turn.T + [0.02, -0.01, 0.01]


def median_seconds(work: Callable[[], int], repeats: int = 15) -> tuple[float, float]:
    """Median time of `work`, and the median of what it returns."""
    work()
    times, values = [], []
    for _ in range(repeats):
        start = time.perf_counter()
        values.append(work())
        times.append(time.perf_counter() - start)
    return statistics.median(times), statistics.median(values)


def per_iteration(run: Callable[[int], int], few: int = 2, many: int = 8) -> float:
    """Seconds of one iteration."""
    (short, used_few), (long, used_many) = median_seconds(lambda: run(few)), median_seconds(lambda: run(many))
    return (long - short) / (used_many - used_few)


def main() -> None:
    """Measure and print."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 20_000
    rng = np.random.default_rng(0)
    target = surface(count, rng)
    source = displaced(surface(count, rng)) + rng.normal(0.0, 0.005, (count, 3))

    def voodoo_steps(steps: int) -> int:
        config = voodoo.Config(
            solver="limbwise",
            max_steps=steps,
            min_change=0.0,
            max_points=10 * count,
            max_limb_points=min(count, 1_000_000),
        )
        tracker = voodoo.Tracker(voodoo.Body.from_toml(TORSO), config=config)
        tracker.reset_pose({"torso": np.eye(4)})
        frame = voodoo.Frame(stamp=0.0)
        frame.add_points(source, limb="torso")
        return tracker.step(frame).steps

    cloud, tree = small_gicp.preprocess_points(target, downsampling_resolution=1e-6, num_threads=1)
    moving, _ = small_gicp.preprocess_points(source, downsampling_resolution=1e-6, num_threads=1)

    def gicp_steps(steps: int) -> int:
        result = small_gicp.align(
            cloud,
            moving,
            tree,
            registration_type="PLANE_ICP",
            max_correspondence_distance=0.15,
            num_threads=1,
            max_iterations=steps,
            rotation_epsilon=0.0,
            translation_epsilon=0.0,
        )
        return result.iterations + 1

    shape = voodoo.TaperedEllipticCylinder(LENGTH, A0, B0, A1, B1)
    single = source.astype(np.float32)

    def closest() -> int:
        return len(shape.closest_points(single).region)

    kernel, _ = median_seconds(closest)
    ours, theirs = per_iteration(voodoo_steps), per_iteration(gicp_steps)
    print(f"{count} points, one thread, {platform.machine()}, Python {platform.python_version()}")
    print(f"voodoo, closest points alone, NumPy in and out: {kernel / count * 1e9:6.1f} ns a point")
    print(f"voodoo, a whole ICP iteration:                  {ours / count * 1e9:6.1f} ns a point")
    print(f"small_gicp, a whole point-to-plane iteration:   {theirs / count * 1e9:6.1f} ns a point")
    print(f"small_gicp / voodoo: {theirs / ours:.1f}")


if __name__ == "__main__":
    main()
