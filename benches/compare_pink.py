"""voodoo.ik against pink (pin-pink on Pinocchio): a body of 26 freedoms, ten point targets, the same start and
tolerance.

    pip install pin-pink quadprog && python benches/compare_pink.py

Both solve the same reachable postures from the same starts on one thread, called from Python, until the worst target
is nearer
than the tolerance. pink steps by its own solve_ik and integrate, with its model built from the voodoo chain, joint by
joint.
"""

from __future__ import annotations

import argparse
import os
import platform
import time

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
import pink
import pinocchio as pin

import voodoo
from voodoo import ik

SITES = (
    "l_hand",
    "r_hand",
    "l_elbow",
    "r_elbow",
    "l_shoulder",
    "l_ankle",
    "r_ankle",
    "l_knee",
    "r_knee",
    "head_center",
)


def body() -> voodoo.Body:
    """Papers' human with an elbow of three freedoms less: 6 root, 3 neck, 2 x (3 shoulder, 1 elbow, 3 hip, 1 knee) =
    25, and a
    hinge at the right wrist: 26."""
    text = voodoo.Body.human(1.75, model="papers").to_toml()
    text += """
[[limbs]]
name = "r_palm"
parent = "r_forearm"
shape = { length = 0.08, a0 = 0.03, b0 = 0.02, a1 = 0.03, b1 = 0.02 }
[limbs.joint]
name = "r_palm"
on_parent = { position = [0.0, 0.0, 0.38] }
semi_axes = [0.01, 0.0]
limits = [[-1.2, 1.2], [0.0, 0.0], [0.0, 0.0]]
"""
    return voodoo.Body.from_toml(text)


def pinocchio_model(chain: ik.Chain) -> pin.Model:
    """The same chain: free flyer, spherical joints and hinges, one frame a site."""
    parts = {limb[0]: limb for limb in chain.body.core.parts()[1]}
    model = pin.Model()
    joints, offset = {}, {}
    for name in chain.limb_names:
        _, parent, _, joint, _ = parts[name]
        if parent is None:
            joints[name] = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "root")
            offset[name] = pin.SE3.Identity()
        else:
            places = [pin.SE3(pin.exp3(np.array(rotation)), np.array(position)) for position, rotation in joint[1:3]]
            hinge = sum(axis > 0.0 for axis in joint[3]) == 1
            kind = pin.JointModelRX() if hinge else pin.JointModelSpherical()
            joints[name] = model.addJoint(joints[parent], kind, offset[parent] * places[0], joint[0])
            offset[name] = places[1].inverse()
        model.appendBodyToJoint(joints[name], pin.Inertia.Random(), pin.SE3.Identity())
    for site, limb, position in chain.body.core.parts()[2]:
        place = offset[limb] * pin.SE3(np.eye(3), np.array(position))
        model.addFrame(pin.Frame(f"site_{site}", joints[limb], 0, place, pin.FrameType.OP_FRAME))
    return model


def configuration(chain: ik.Chain, model: pin.Model, angles: np.ndarray) -> np.ndarray:
    """pinocchio's configuration vector of joint angles."""
    q = pin.neutral(model)
    names = list(chain.angle_names)
    q[:3] = angles[:3]
    q[3:7] = pin.Quaternion(pin.exp3(angles[3:6])).coeffs()
    for joint, name in zip(list(model.joints)[2:], list(model.names)[2:], strict=True):
        if joint.nq == 1:
            q[joint.idx_q] = angles[names.index(f"{name}_flexion")]
        else:
            first = names.index(f"{name}_rx")
            q[joint.idx_q : joint.idx_q + 4] = pin.Quaternion(pin.exp3(angles[first : first + 3])).coeffs()
    return q


def run_pink(
    model: pin.Model, start: np.ndarray, goals: np.ndarray, tolerance: float, most: int, gain: float
) -> tuple[int, float, float]:
    """Steps, seconds in the loop, and worst residual [m]."""
    data = model.createData()
    tasks = []
    for site, goal in zip(SITES, goals, strict=True):
        task = pink.tasks.FrameTask(f"site_{site}", position_cost=1.0, orientation_cost=0.0, lm_damping=0.0, gain=gain)
        task.set_target(pin.SE3(np.eye(3), goal))
        tasks.append(task)
    now = pink.Configuration(model, data, start)
    frames = [model.getFrameId(f"site_{site}") for site in SITES]
    began = time.perf_counter()
    step = 0
    while step < most:
        step += 1
        velocity = pink.solve_ik(now, tasks, 1.0, solver="quadprog", damping=1e-8, limits=[])
        now.integrate_inplace(velocity, 1.0)
        worst = max(
            np.linalg.norm(now.data.oMf[frame].translation - goal) for frame, goal in zip(frames, goals, strict=True)
        )
        if worst < tolerance:
            break
    return step, time.perf_counter() - began, worst


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--postures", type=int, default=50)
    parser.add_argument("--tolerance", type=float, default=1e-6)
    arguments = parser.parse_args()
    chain = ik.Chain(body())
    model = pinocchio_model(chain)
    n = len(chain.angle_names)
    print(
        f"{platform.processor() or platform.machine()}, Python {platform.python_version()}, pink {pink.__version__}, "
        f"pinocchio {pin.__version__}, one thread; {n} freedoms (pinocchio: {model.nv}), {len(SITES)} targets"
    )
    rng = np.random.default_rng(7)
    ours, theirs, positions = [], [], []
    for _ in range(arguments.postures):
        start, goal = chain.rest(), chain.rest()
        middle = 0.5 * (np.maximum(chain.limits[6:, 0], -1.5) + np.minimum(chain.limits[6:, 1], 1.5))
        goal[6:] = middle + rng.uniform(-0.15, 0.15, n - 6) * 1.0
        start[6:] = middle
        goal[:6] = rng.uniform(-0.1, 0.1, 6)
        wanted = chain.forward(goal)[1]
        goals = np.stack([wanted[site] for site in SITES])
        targets = [ik.Target.at(site, position) for site, position in zip(SITES, goals, strict=True)]
        ik.solve(chain, targets, start=start, steps=2)
        began = time.perf_counter()
        posture = ik.solve(chain, targets, start=start, steps=200, tolerance=arguments.tolerance)
        ours.append((posture.steps, time.perf_counter() - began, max(posture.residuals)))
        theirs.append(run_pink(model, configuration(chain, model, start), goals, arguments.tolerance, 200, 1.0))
        positions.append(np.max(np.abs(np.stack([posture.joints[site] for site in SITES]) - goals)))
    print("| | steps | ms a posture | us a step | worst residual, um |\n|---|---|---|---|---|")
    for name, rows in (("voodoo.ik", ours), ("pink", theirs)):
        steps, seconds, worst = np.array(rows).T
        print(
            f"| {name} | {steps.mean():.1f} | {1e3 * seconds.mean():.3f} | {1e6 * seconds.sum() / steps.sum():.1f} | {1e6 * worst.max():.2f} |"  # noqa: E501
        )
    step = [np.sum([row[1] for row in rows]) / np.sum([row[0] for row in rows]) for rows in (theirs, ours)]
    posture = [np.sum([row[1] for row in rows]) for rows in (theirs, ours)]
    print(f"voodoo.ik is {step[0] / step[1]:.1f} times faster a step, {posture[0] / posture[1]:.1f} times a posture")


if __name__ == "__main__":
    main()
