"""R07's dense form beside the sparse one: a level set in every whole picture, with the projected body as its prior.

    python lab/experiments/dense_regions.py ../shared/data/multiview/mv_d1_walk_turn_cmu --frames 30

Alternates, as the paper does: the level set grows where local Gaussians say so (two a pixel, of what is inside and outside
nearby), is held short by its curvature and near the projected body by the distance of both (lambda 0.05); then the pose moves to
its border. Prints the mean error of twelve joints and the time a frame of this and of `Tracker.step` with the same pictures.
"""

import argparse
import time
from pathlib import Path

import cv2
import numpy as np

import voodoo
from voodoo.evaluation.metrics import JOINTS
from voodoo.ik import Chain
from voodoo.measurements import ColorImage
from voodoo.recordings import open_recording
from voodoo.synthetic.render import render_depth

LAMBDA, LENGTH, STEP, WIDTH = 0.05, 0.6, 1.5, 1.5
"""Weights of the shape prior and of the border's length; step of the evolution; width of the smoothed border [px]."""
WINDOW_PX, ROUNDS, EVOLUTIONS, REACH_PX, BETWEEN_PX = 9.0, 3, 12, 14, 5
CARRIED, TURN_SIGMA, EDGE_PX = 0.7, 0.12, 2.0


def log_likelihood(picture, fraction):
    """Of each pixel under the Gaussian of those about it that `fraction` (H, W) counts, up to a constant."""
    blurred = [
        cv2.GaussianBlur(x, (0, 0), WINDOW_PX)
        for x in (fraction, fraction[..., None] * picture, fraction[..., None] * picture**2)
    ]
    count = blurred[0][..., None] + 1e-3
    mean = blurred[1] / count
    variance = np.maximum(blurred[2] / count - mean**2, 36.0)
    return -0.5 * ((picture - mean) ** 2 / variance + np.log(variance)).sum(axis=2)


def level_set(picture, prior):
    """Signed distance (H, W) of the region in a picture, above zero inside, that began as `prior`."""
    phi = prior.copy()
    for _ in range(EVOLUTIONS):
        inside = (phi > 0).astype(np.float32)
        ratio = np.clip(log_likelihood(picture, inside) - log_likelihood(picture, 1 - inside), -4, 4)
        down, across = np.gradient(phi)
        norm = np.hypot(down, across) + 1e-6
        curvature = np.gradient(down / norm, axis=0) + np.gradient(across / norm, axis=1)
        border = WIDTH / np.pi / (WIDTH**2 + phi**2)
        phi = phi + STEP * (border * (ratio + LENGTH * curvature) + 2 * LAMBDA * (prior - phi))
    return phi


def rows_of(item, body, poses):
    """Contour points of the posed body in one picture: limb, point, direction, how far the border lies [m], certainty [1/m]."""
    observed = render_depth(body, poses, camera=item.camera, world_from_sensor=item.root_from_sensor)
    mask = (observed.limb >= 0).astype(np.uint8)
    if not mask.any():
        return []
    (v0, u0), (v1, u1) = ((f(np.argwhere(mask), axis=0) + d).astype(int) for f, d in ((np.min, -30), (np.max, 30)))
    v0, u0 = max(v0, 0), max(u0, 0)
    crop = np.s_[v0:v1, u0:u1]
    distance = [cv2.distanceTransform(m, cv2.DIST_L2, 5) for m in (mask[crop], 1 - mask[crop])]
    prior = (distance[0] - distance[1]).astype(np.float32)
    phi = level_set(item.image[crop].astype(np.float32), prior)
    down, across = np.gradient(cv2.GaussianBlur(prior, (0, 0), 2.0))
    rows, camera = [], item.camera
    for contour in cv2.findContours(mask[crop], cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)[0]:
        for u, v in contour[::BETWEEN_PX, 0]:
            n = -np.array([across[v, u], down[v, u]])
            n /= np.linalg.norm(n) + 1e-9
            at = np.arange(-REACH_PX, REACH_PX + 1)
            us, vs = (np.rint(c + at * d).astype(int) for c, d in ((u, n[0]), (v, n[1])))
            there = (us >= 0) & (vs >= 0) & (us < phi.shape[1]) & (vs < phi.shape[0])
            signs = phi[vs[there], us[there]] > 0
            cuts = np.flatnonzero(signs[:-1] & ~signs[1:])
            if not cuts.size:
                continue
            offset = at[there][cuts[np.argmin(np.abs(at[there][cuts]))]] + 0.5
            z = float(observed.depth[v + v0, u + u0])
            x = np.array([(u + u0 - camera.cx) / camera.fx * z, (v + v0 - camera.cy) / camera.fy * z, z])
            m = np.array([n[0] * camera.fx / z, n[1] * camera.fy / z, 0.0])
            m[2] = -(m @ x) / z
            slope = np.linalg.norm(m)
            pose = item.root_from_sensor
            limb = observed.limb_names[observed.limb[v + v0, u + u0]]
            rows.append(
                (limb, pose[:3, :3] @ x + pose[:3, 3], pose[:3, :3] @ m / slope, offset / slope, slope / EDGE_PX)
            )
    return rows


def moved(chain, angles, rows):
    """The angles after a Gauss-Newton step to the borders."""
    poses, _ = chain.forward(angles)
    back = {limb: np.linalg.inv(pose) for limb, pose in poses.items()}
    local = [back[limb][:3, :3] @ x + back[limb][:3, 3] for limb, x, *_ in rows]
    jacobian = np.empty((len(rows), len(angles)))
    for column in range(len(angles)):
        nudged, _ = chain.forward(angles + 1e-4 * np.eye(len(angles))[column])
        for index, ((limb, x, n, *_), y) in enumerate(zip(rows, local, strict=True)):
            jacobian[index, column] = n @ (nudged[limb][:3, :3] @ y + nudged[limb][:3, 3] - x) / 1e-4
    distance, weight = np.array([[row[3], row[4]] for row in rows]).T
    weight = weight**2 / (1 + (distance / 0.05) ** 2) ** 2 / 8.0
    normal = (jacobian * weight[:, None]).T @ jacobian + np.eye(len(angles)) / TURN_SIGMA**2
    return angles + np.linalg.solve(normal, (jacobian * weight[:, None]).T @ distance)


def main(path: Path, frames: int) -> tuple[float, float]:
    """Mean errors [m] of the dense form and of the sparse one."""
    recording = open_recording(path)
    start, truth = recording.start, recording.reference
    tracker = voodoo.Tracker(voodoo.Body.human(start["height_m"]))
    chain = Chain(tracker.reset(joints=start["joints"]) and tracker.body)
    angles = before = chain.project(tracker.estimate.world_from_limb)
    errors, seconds = [[], []], [0.0, 0.0]
    for recorded in list(recording)[:frames]:
        pictures = [item for item in recorded.measurements if isinstance(item, ColorImage)]
        clock = time.process_time()
        angles, before = angles + CARRIED * (angles - before), angles
        for _ in range(ROUNDS):
            poses, _ = chain.forward(angles)
            angles = moved(chain, angles, [row for item in pictures for row in rows_of(item, chain.body, poses)])
        seconds[0] += time.process_time() - clock
        frame = voodoo.Frame(recorded.stamp)
        for item in pictures:
            pose = {"world_from_sensor": item.root_from_sensor, "stamp": item.stamp, "source": item.sensor}
            frame.add_color(np.ascontiguousarray(item.image), camera=item.camera, **pose)
        clock = time.process_time()
        sparse = tracker.step(frame)
        seconds[1] += time.process_time() - clock
        true = truth.positions[np.argmin(np.abs(truth.stamps - recorded.stamp))]
        for kept, joints in zip(errors, (chain.forward(angles)[1], sparse.joints), strict=True):
            kept.append([np.linalg.norm(joints[name] - true[truth.names.index(name)]) for name in JOINTS])
    for name, kept, spent in zip(("dense", "sparse"), errors, seconds, strict=True):
        print(f"{name:<8}{100 * np.mean(kept):5.1f} cm, {1e3 * spent / len(kept):7.1f} ms a frame")
    return float(np.mean(errors[0])), float(np.mean(errors[1]))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recording", type=Path)
    parser.add_argument("--frames", type=int, default=30)
    options = parser.parse_args()
    main(options.recording, options.frames)
