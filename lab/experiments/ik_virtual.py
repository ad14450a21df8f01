"""J10's three experiments in a virtual plane (its figures 6, 7 and 8): a chain of four segments, with and without
images.

    python lab/experiments/ik_virtual.py [--out DIR]

Writes experiment_1.png, _2.png and _3.png: above without, below with the image constraint; gray the start, red the
chain, blue the end point it shall reach, white (experiment 3: black) the silhouette it shall lie in (the object it shall avoid).
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

import voodoo
from voodoo import ik

SEGMENT = 0.25
STEPS = (0, 1, 2, 4, 8, 15, 40)
SIZE = 240
CAMERA = voodoo.Camera(SIZE, SIZE, 300.0, 300.0, 119.5, 119.5)
WORLD_FROM_CAMERA = np.array([[1.0, 0, 0, 0], [0, -1.0, 0, 0.35], [0, 0, -1.0, 3.0], [0, 0, 0, 1.0]])
"""The chain moves in the plane z = 0; the camera looks down on it from 3 m above."""


def planar_chain(segments: int = 4) -> ik.Chain:
    """Segments of 0.25 m in the x-y plane, hinged about z, the first at the origin; at rest all along y."""
    text = 'name = "planar"\n[[limbs]]\nname = "base"\nshape = { length = 0.01, a0 = 0.01, b0 = 0.01, a1 = 0.01, b1 = 0.01 }\n'
    # Hinges turn about the joint's x axis, limbs run along their z: a turn of -120 degrees about (1, 1, 1) puts these
    # on the base's z and y.
    first = "on_parent = { rotation = [-1.2091995761561452, -1.2091995761561452, -1.2091995761561452] }\n"
    for index in range(segments):
        parent = f"segment_{index - 1}" if index else "base"
        place = f"on_parent = {{ position = [0.0, 0.0, {SEGMENT}] }}\n" if index else first
        text += f'[[limbs]]\nname = "segment_{index}"\nparent = "{parent}"\n'
        text += f"shape = {{ length = {SEGMENT}, a0 = 0.02, b0 = 0.02, a1 = 0.02, b1 = 0.02 }}\n"
        text += f'[limbs.joint]\nname = "joint_{index}"\n{place}semi_axes = [0.01, 0.0]\n'
        text += f'[[sites]]\nname = "joint_{index}"\nlimb = "segment_{index}"\nposition = [0.0, 0.0, 0.0]\n'
    text += f'[[sites]]\nname = "tip"\nlimb = "segment_{segments - 1}"\nposition = [0.0, 0.0, {SEGMENT}]\n'
    return ik.Chain(voodoo.Body.from_toml(text), root="fixed")


def pixels(chain: ik.Chain, angles: np.ndarray) -> np.ndarray:
    """The joints and the tip (5, 2) in the picture."""
    points = np.stack(list(chain.forward(angles)[1].values()))
    camera_from_world = np.linalg.inv(WORLD_FROM_CAMERA)
    return CAMERA.project(points @ camera_from_world[:3, :3].T + camera_from_world[:3, 3])


def drawn(chain: ik.Chain, angles: np.ndarray, width: int = 12) -> np.ndarray:
    """The chain as a mask with thick segments."""
    mask = np.zeros((SIZE, SIZE), dtype=np.uint8)
    cv2.polylines(mask, [np.rint(pixels(chain, angles)).astype(np.int32)], False, 1, width)
    return mask


@dataclass(frozen=True)
class Experiment:
    """A start, an end point and the pixels the chain shall lie in."""

    name: str
    start: np.ndarray
    objective: np.ndarray | None
    tip: np.ndarray
    mask: np.ndarray

    @property
    def image(self) -> ik.Silhouette:
        return ik.Silhouette(self.mask, camera=CAMERA, world_from_camera=WORLD_FROM_CAMERA)


def experiments(chain: ik.Chain) -> list[Experiment]:
    def tip(angles: np.ndarray) -> np.ndarray:
        return chain.forward(angles)[1]["tip"]

    # 1: another configuration with another end point.
    start, objective = np.array([0.5, 0.3, -0.4, -0.5]), np.array([-0.5, -0.6, 0.9, 0.5])
    first = Experiment("experiment_1", start, objective, tip(objective), drawn(chain, objective))
    # 2: the start is the mirror image of the objective about the line to the end point: same end point.
    objective = np.array([0.3, -0.9, -0.5, -0.3])
    end = tip(objective)
    turn = 2.0 * float(np.arctan2(-end[0], end[1]))
    start = np.array([turn - objective[0], *(-objective[1:])])
    second = Experiment("experiment_2", start, objective, end, drawn(chain, objective))
    # 3: an object the chain of the plain solution lies on.
    start, goal = np.array([0.9, -0.2, -0.3, -0.4]), np.array([-0.35, 0.5, 0.0])
    plain = ik.solve(chain, {"tip": goal}, start=start, steps=STEPS[-1]).angles
    corner = pixels(chain, plain)[2]
    mask = np.ones((SIZE, SIZE), dtype=np.uint8)
    x, y = np.rint(corner).astype(int)
    mask[y - 14 : y + 15, x - 14 : x + 15] = 0
    return [first, second, Experiment("experiment_3", start, None, goal, mask)]


def run(chain: ik.Chain, experiment: Experiment, *, with_image: bool, steps: int) -> ik.Posture:
    images = [experiment.image] if with_image else []
    return ik.solve(
        chain, {"tip": experiment.tip}, images=images, start=experiment.start, steps=steps, caution=0.02, margin=0.0
    )


def picture(chain: ik.Chain, experiment: Experiment, angles: np.ndarray, words: str) -> np.ndarray:
    canvas = np.where(experiment.mask[..., None] != 0, 255, 60).astype(np.uint8).repeat(3, axis=2)
    if experiment.objective is not None:
        canvas = np.where(experiment.mask[..., None] != 0, 255, 110).astype(np.uint8).repeat(3, axis=2)
    big = cv2.resize(canvas, None, fx=2, fy=2, interpolation=cv2.INTER_NEAREST)

    def line(angles: np.ndarray, color: tuple[int, int, int], width: int) -> np.ndarray:
        points = np.rint(2.0 * pixels(chain, angles) + 0.5).astype(np.int32)
        cv2.polylines(big, [points], False, color, width, cv2.LINE_AA)
        return points

    line(experiment.start, (170, 170, 170), 3)
    for point in line(angles, (40, 40, 220), 3):
        cv2.circle(big, point.tolist(), 5, (40, 40, 220), -1, cv2.LINE_AA)
    camera_from_world = np.linalg.inv(WORLD_FROM_CAMERA)
    goal = CAMERA.project((camera_from_world[:3, :3] @ experiment.tip + camera_from_world[:3, 3])[None])[0]
    cv2.circle(big, np.rint(2.0 * goal + 0.5).astype(int).tolist(), 9, (220, 120, 0), 2, cv2.LINE_AA)
    cv2.putText(big, words, (8, 22), cv2.FONT_HERSHEY_SIMPLEX, 0.55, (0, 140, 0), 1, cv2.LINE_AA)
    return big


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("out/ik_virtual"))
    out = parser.parse_args().out
    out.mkdir(parents=True, exist_ok=True)
    chain = planar_chain()
    for experiment in experiments(chain):
        rows = []
        for with_image in (False, True):
            row = []
            for steps in STEPS:
                posture = run(chain, experiment, with_image=with_image, steps=steps)
                h, _ = chain.criterion(posture.angles, [experiment.image])
                words = f"{'image' if with_image else 'plain'}, {steps} steps, h={h:.2f} px"
                row.append(picture(chain, experiment, posture.angles, words))
            rows.append(np.hstack(row))
        cv2.imwrite(str(out / f"{experiment.name}.png"), np.vstack(rows))
        print(f"wrote {out / experiment.name}.png")


if __name__ == "__main__":
    main()
