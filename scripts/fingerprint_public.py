"""Cases of `scripts/fingerprint` in which nothing but the public names of voodoo occurs: a body of ours, seen as we like."""

from __future__ import annotations

import numpy as np

import voodoo

CAMERA = voodoo.Camera(160, 120, 138.0, 138.0, 79.5, 59.5)
WORLD_FROM_SENSOR = np.array([[0.0, 0.0, 1.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 1.0], [0.0, 0.0, 0.0, 1.0]])
STANDING = np.array([[-1.0, 0.0, 0.0, 2.4], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.86], [0.0, 0.0, 0.0, 1.0]])
BENT = {"l_elbow_flexion": 1.0, "r_elbow_flexion": 1.0, "l_knee_flexion": 0.8, "r_knee_flexion": 0.8}
RATE_HZ, WALL_M, NOISE_M = 30.0, 3.6, 0.004


def swinging(chain: voodoo.ik.Chain, time: float, speed: float, seed: int) -> np.ndarray:
    """Angles of which each swings with its own frequency and phase."""
    rng = np.random.default_rng(seed)
    count = len(chain.angle_names)
    frequency, phase = 0.08 * rng.uniform(0.75, 1.25, count), rng.uniform(0.0, 2.0 * np.pi, count)
    centre = np.array([BENT.get(name, 0.0) for name in chain.angle_names])
    amplitude = np.array([0.1 if "root" in name else 0.35 for name in chain.angle_names])
    wanted = centre + amplitude * np.sin(2.0 * np.pi * frequency * speed * time + phase)
    return np.clip(wanted, chain.limits[:, 0], chain.limits[:, 1])


def virtual(solver: str, model: str, speed: str, inputs: str, threads: str) -> None:
    """A moving person as a depth image, points, positions and rays, of which `inputs` names the ones used."""
    body = voodoo.Body.human(1.78, model=model)
    chain = voodoo.ik.Chain(body)
    tracker = voodoo.Tracker(body, config=voodoo.Config(solver=solver, threads=int(threads)))
    rng = np.random.default_rng(5)
    for index in range(80):
        time = index / RATE_HZ
        poses, sites = chain.forward(swinging(chain, time, float(speed), 3), world_from_base=STANDING)
        if index == 0:
            tracker.reset_pose(poses)
        frame = voodoo.Frame(stamp=time)
        seen = voodoo.render_depth(body, poses, camera=CAMERA, world_from_sensor=WORLD_FROM_SENSOR).depth
        depth = np.where(seen > 0.0, seen, WALL_M)
        depth = depth + NOISE_M * (depth / 2.4) ** 2 * rng.standard_normal(depth.shape)
        if 40 <= index < 46:
            depth[:] = WALL_M  # nobody is seen, and then again
        if "depth" in inputs:
            image = np.rint(1000.0 * depth).astype(np.uint16)
            frame.add_depth(image, camera=CAMERA, meters_per_unit=0.001, world_from_sensor=WORLD_FROM_SENSOR)
        if "points" in inputs:
            row, column = np.nonzero((seen > 0.0) & (rng.random(seen.shape) < 0.3))
            z = depth[row, column]
            points = np.stack([(column - CAMERA.cx) / CAMERA.fx * z, (row - CAMERA.cy) / CAMERA.fy * z, z], axis=1)
            frame.add_points(points, world_from_sensor=WORLD_FROM_SENSOR, on_body=bool(index % 2))
        if "positions" in inputs:
            for site in ("l_wrist", "r_ankle"):
                frame.add_position(site, sites[site] + rng.normal(0.0, 0.01, 3), weight=20.0, bias=0.01)
        if "rays" in inputs:
            for site in ("r_wrist", "l_ankle", "head_center"):
                towards = sites[site] + rng.normal(0.0, 0.01, 3) - WORLD_FROM_SENSOR[:3, 3]
                frame.add_ray(site, origin=WORLD_FROM_SENSOR[:3, 3], direction=towards, weight=20.0, bias=0.02)
        frame.set_ground(normal=(0.0, 0.0, 1.0), offset=0.0)
        tracker.step(frame)
        if index == 30:
            tracker.scale(1.01)
    print(tracker.distance(np.array([[2.3, 0.0, 1.0], [2.0, 0.1, 1.2]])).tobytes().hex())


def rendered_silhouette() -> None:
    """One posture by targets and two silhouettes, one with depths, from several starts."""
    body = voodoo.Body.human(1.75)
    chain = voodoo.ik.Chain(body)
    rng = np.random.default_rng(2)
    for speed in (3.0, 11.0):
        poses, sites = chain.forward(swinging(chain, 1.0, speed, 4), world_from_base=STANDING)
        seen = voodoo.render_depth(body, poses, camera=CAMERA, world_from_sensor=WORLD_FROM_SENSOR).depth
        print(seen.tobytes().hex()[:4000])
        mask = (seen > 0.0).astype(np.uint8)
        deep = seen + 0.01 * rng.standard_normal(seen.shape) * (seen > 0.0)
        images = [
            voodoo.ik.Silhouette(mask, camera=CAMERA, world_from_camera=WORLD_FROM_SENSOR),
            voodoo.ik.Silhouette(mask, camera=CAMERA, world_from_camera=WORLD_FROM_SENSOR, depth=deep),
        ]
        targets = {name: sites[name] for name in ("l_wrist", "r_wrist", "l_ankle", "r_ankle", "head_center")}
        for views in (images[:0], images[:1], images[1:]):
            voodoo.ik.solve(chain, targets, images=views, world_from_base=STANDING)
