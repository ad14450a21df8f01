"""Postures a second of J10's arm: two joints of three freedoms, 15 steps, with and without the image constraint, one
core; and what the constraint's time goes to. The same picture twice, with twice the caution, leads the same way, so what it
adds is the sampling and its gradient; what else one picture adds is steps in the null space and kinematics of postures tried.

    python lab/experiments/ik_speed.py
"""

from __future__ import annotations

import platform
import time

import numpy as np

import voodoo
from voodoo import ik

TEXT = """
name = "arm"
[[limbs]]
name = "base"
shape = { length = 0.01, a0 = 0.01, b0 = 0.01, a1 = 0.01, b1 = 0.01 }
[[limbs]]
name = "upper"
parent = "base"
shape = { length = 0.32, a0 = 0.05, b0 = 0.05, a1 = 0.04, b1 = 0.04 }
joint = { name = "shoulder" }
[[limbs]]
name = "lower"
parent = "upper"
shape = { length = 0.26, a0 = 0.04, b0 = 0.04, a1 = 0.03, b1 = 0.03 }
joint = { name = "elbow", on_parent = { position = [0.0, 0.0, 0.32] } }
[[sites]]
name = "wrist"
limb = "lower"
position = [0.0, 0.0, 0.26]
"""


ROUNDS = 15


def main() -> None:
    chain = ik.Chain(voodoo.Body.from_toml(TEXT), limbs=("upper", "lower"))
    camera = voodoo.Camera(320, 240, 290.0, 290.0, 159.5, 119.5)
    pose = np.eye(4)
    pose[2, 3] = -3.0
    v, u = np.mgrid[:240, :320]
    # A narrow person the arm hardly fits into, so that the image step never comes to rest early.
    image = ik.Silhouette((np.abs(u - 150) < 6) & (np.abs(v - 120) < 60), camera=camera, world_from_camera=pose)
    rng = np.random.default_rng(0)
    count = 5_000
    parts = np.split(np.arange(count), count // 50)
    starts = rng.uniform(-0.8, 0.8, (count, 6))
    goals = np.array([chain.forward(row)[1]["wrist"] for row in rng.uniform(-0.8, 0.8, (count, 6))])[:, None]
    print(f"{platform.machine()}, Python {platform.python_version()}, one thread, {count} postures, 15 steps a phase")
    print(
        "| images | postures a second | us a posture | steps | tried | compared | us a step | reached within 0.1 mm |\n"
        "|---|---|---|---|---|---|---|---|"
    )
    took, looks = [], []
    for views in (0, 1, 2):
        # The fastest of some rounds for each few hundred postures: waiting for other programs does not count.
        fastest = np.full(len(parts), np.inf)
        for _ in range(ROUNDS):
            found = []
            for index, part in enumerate(parts):
                began = time.perf_counter()
                found.append(
                    ik.solve_many(
                        chain,
                        ["wrist"],
                        goals[part],
                        images=[image] * views,
                        starts=starts[part],
                        steps=15,
                        caution=0.3 * max(views, 1),
                    )
                )
                fastest[index] = min(fastest[index], time.perf_counter() - began)
        best, steps = fastest.sum(), sum(some.steps.sum() for some in found)
        took.append(1e6 * best / count)
        tried, checked = (sum(getattr(some, name).sum() for some in found) / count for name in ("tried", "compared"))
        looks.append(checked)
        reached = np.linalg.norm(np.concatenate([some.joints[:, 0] for some in found]) - goals[:, 0], axis=1) < 1e-4
        print(
            f"| {views} | {count / best:.0f} | {1e6 * best / count:.1f} | {steps / count:.1f} | {tried:.1f} | {checked:.1f} | "
            f"{1e6 * best / steps:.2f} | "
            f"{100 * reached.mean():.1f} % |"
        )
    plain, one, two = took
    print(f"one picture: {plain:.1f} us without it, {two - one:.1f} us sampling and gradient, ", end="")
    print(
        f"{2 * one - two - plain:.1f} us null space, kinematics and limits; {two - one:.1f} us / {looks[1]:.1f} postures = ",
        end="",
    )
    print(f"{1e3 * (two - one) / looks[1]:.0f} ns a picture and posture")


if __name__ == "__main__":
    main()
