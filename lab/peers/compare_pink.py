"""voodoo.ik against pink (pin-pink on Pinocchio): a body of 26 freedoms, ten point targets, the same start
and tolerance.

    pip install pin-pink quadprog && python lab/peers/compare_pink.py

Both solve the same reachable postures from the same starts on one thread, called from Python, until the worst target
is nearer than the tolerance. pink steps by its own solve_ik and integrate, with its model built from the voodoo chain, joint by
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
    25, and a hinge at the right wrist: 26."""
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


Run = tuple[int, float, float, np.ndarray]
"""Steps, seconds, worst residual [m], positions reached (K, 3) [m]."""


def run_ours(chain: ik.Chain, start: np.ndarray, goals: np.ndarray, options: ik.Options) -> Run:
    """One call of ik.solve, targets and result included."""
    began = time.perf_counter()
    targets = dict(zip(SITES, goals, strict=True))
    posture = ik.solve(chain, targets, start=start, options=options)
    seconds = time.perf_counter() - began
    return posture.steps, seconds, max(posture.residuals), np.stack([posture.joints[site] for site in SITES])


def run_pink(model: pin.Model, start: np.ndarray, goals: np.ndarray, tolerance: float, most: int, gain: float) -> Run:
    """Steps of solve_ik and integrate; only the loop is timed."""
    data = model.createData()
    tasks = []
    for site, goal in zip(SITES, goals, strict=True):
        task = pink.tasks.FrameTask(f"site_{site}", position_cost=1.0, orientation_cost=0.0, lm_damping=0.0, gain=gain)
        task.set_target(pin.SE3(np.eye(3), goal))
        tasks.append(task)
    now = pink.Configuration(model, data, start)
    frames = [model.getFrameId(f"site_{site}") for site in SITES]
    worst, step = np.inf, 0
    began = time.perf_counter()
    while step < most and worst >= tolerance:
        step += 1
        velocity = pink.solve_ik(now, tasks, 1.0, solver="quadprog", damping=1e-8, limits=[])
        now.integrate_inplace(velocity, 1.0)
        worst = max(
            np.linalg.norm(now.data.oMf[frame].translation - goal) for frame, goal in zip(frames, goals, strict=True)
        )
    seconds = time.perf_counter() - began
    return step, seconds, float(worst), np.stack([now.data.oMf[frame].translation for frame in frames])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--postures", type=int, default=50)
    parser.add_argument("--rounds", type=int, default=9)
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
    options = ik.Options(steps=200, tolerance=arguments.tolerance)
    problems = []
    for _ in range(arguments.postures):
        start, goal = chain.rest(), chain.rest()
        middle = 0.5 * (np.maximum(chain.limits[6:, 0], -1.5) + np.minimum(chain.limits[6:, 1], 1.5))
        goal[6:] = middle + rng.uniform(-0.15, 0.15, n - 6)
        start[6:] = middle
        goal[:6] = rng.uniform(-0.1, 0.1, 6)
        expected = chain.forward(goal)[1]
        problems.append((start, np.stack([expected[site] for site in SITES])))
    # All postures by one, then all by the other, several times; the fastest of each, so that what else the machine does counts
    # for neither.
    rounds = []
    for _ in range(arguments.rounds):
        mine = [run_ours(chain, start, goals, options) for start, goals in problems]
        pinks = [
            run_pink(model, configuration(chain, model, start), goals, arguments.tolerance, 200, 1.0)
            for start, goals in problems
        ]
        rounds.append((mine, pinks))
    ours, theirs = (
        [min((done[who][index] for done in rounds), key=lambda run: run[1]) for index in range(len(problems))]
        for who in (0, 1)
    )
    apart = max(np.abs(one[3] - other[3]).max() for one, other in zip(ours, theirs, strict=True))
    assert apart < 2.0 * arguments.tolerance, "not the same answer"
    print("| | steps | us a posture | us a step | worst residual, um |\n|---|---|---|---|---|")
    per_step = []
    for name, rows in (("voodoo.ik", ours), ("pink", theirs)):
        steps, seconds, worst = np.array([row[:3] for row in rows]).T
        per_step.append(seconds.sum() / steps.sum())
        print(
            f"| {name} | {steps.mean():.1f} | {1e6 * seconds.mean():.1f} | {1e6 * per_step[-1]:.1f} | "
            f"{1e6 * worst.max():.2f} |"
        )
    posture = sum(row[1] for row in theirs) / sum(row[1] for row in ours)
    print(
        f"voodoo.ik is {per_step[1] / per_step[0]:.1f} times faster a step, {posture:.1f} times a posture; same positions"
    )


if __name__ == "__main__":
    main()
