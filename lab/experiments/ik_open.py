"""What pictures leave open: how far elbows and knees may be from the truth while the silhouettes are as content as with it.

    python lab/experiments/ik_open.py DATA/rendered

Every second frame by itself: arms and legs at the truth, then turned about the line between their known ends in steps of 5
degrees. Where the image criterion is no more than 0.1 px above that of the truth, and no joint limit is broken, nothing speaks
against a turn. Frames in which the truth itself breaks one are left out.
The number is the mean distance of these places from the one that is nearest to all of them, the best guess: of all, and of those
that hang together with the truth, which is what is left to someone who knows where the joint was before.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
from ik_limbs import LIMBS, OTHER, Bodies
from ik_tables import Rendered, rendered

from voodoo import ik

CONTENT_PX = 0.1
REACHED_M = 0.005
TURNS = np.radians(np.arange(0.0, 360.0, 5.0))
EVERY = 2
STEPS = 60


def left_open(sequence: Rendered, views: int) -> dict[str, np.ndarray]:
    """Joint -> (F, 2) [m] for so many views: mean distance to the best guess, of all turns and of those around the truth."""
    truth = sequence.truth
    bodies = Bodies(truth, sequence.height)
    found: dict[str, list[tuple[float, float]]] = {joint: [] for joint in LIMBS}
    angles = dict(bodies.starts)
    for frame in range(0, len(sequence.depths), EVERY):
        true = {joint: truth[joint][frame] for joint in LIMBS}
        images = [sequence.front(frame, true), sequence.side[frame]][:views]
        postures = {}
        for joint, (_, _, end) in LIMBS.items():
            targets = {end: truth[end][frame], joint: true[joint]}
            base = bodies.base(frame, joint)
            postures[joint] = ik.solve(
                bodies.chains[joint], targets, start=angles[joint], world_from_base=base, steps=STEPS
            )
            angles[joint] = postures[joint].angles
        for joint, chain in bodies.chains.items():
            others = postures[OTHER[joint]].world_from_limb
            base = bodies.base(frame, joint)
            costs, places = [], []
            for world_from_limb, place in turned(chain, postures[joint], joint, base):
                turn = chain.project(world_from_limb, world_from_base=base, closest=False)
                # Angles are moved into their limits, and the joint with them.
                reached = chain.forward(turn, world_from_base=base)[1][joint]
                allowed = np.linalg.norm(reached - place) < REACHED_M
                cost = chain.criterion(turn, images, world_from_base=base, others=others)[0]
                costs.append(cost if allowed else np.inf)
                places.append(place)
            if np.isfinite(costs[0]):  # where the truth itself is not allowed, there is nothing to compare with
                found[joint].append(scatter(np.array(places), np.array(costs) <= costs[0] + CONTENT_PX))
    return {joint: np.array(values) for joint, values in found.items() if values}


def turned(
    chain: ik.Chain, posture: ik.Posture, joint: str, base: np.ndarray
) -> Iterator[tuple[dict[str, np.ndarray], np.ndarray]]:
    """Poses of all limbs of the body, and the joint's place, for every turn about the line between the ends."""
    limbs, first, last = LIMBS[joint]
    start, end = posture.joints[first], posture.joints[last]
    way = (end - start) / np.linalg.norm(end - start)
    for turn in TURNS:
        move = np.eye(4)
        move[:3, :3] = cv2.Rodrigues(turn * way)[0]
        move[:3, 3] = start - move[:3, :3] @ start
        poses = {name: base for name in chain.body.limb_names}
        poses.update({limb: move @ posture.world_from_limb[limb] for limb in limbs})
        yield poses, move[:3, :3] @ posture.joints[joint] + move[:3, 3]


def scatter(places: np.ndarray, content: np.ndarray) -> tuple[float, float]:
    """Mean distance to the best guess, of all content turns and of those that hang together with the first."""
    refused = np.flatnonzero(~content)
    around = np.ones(len(content), dtype=bool)
    if len(refused):
        around[refused[0] : refused[-1] + 1] = False

    def guess(chosen: np.ndarray) -> float:
        apart = np.linalg.norm(chosen[:, None] - chosen[None], axis=2)
        return float(apart.mean(axis=1).min())

    return guess(places[content]), guess(places[around])


def words(found: dict[str, np.ndarray], part: str) -> str:
    """Means [mm] over both sides of "elbow", "knee" or "both"."""
    some = np.mean([values.mean(axis=0) for joint, values in found.items() if part in ("both", joint[2:])], axis=0)
    return " / ".join(f"{1e3 * value:.1f}" for value in some)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rendered", type=Path)
    folder = parser.parse_args().rendered
    parts = ("elbow", "knee", "both")
    print(
        "| left open [mm], all turns / around the truth | " + " | ".join(f"one: {p} | two: {p}" for p in parts) + " |"
    )
    print("|---|" + "---|" * (2 * len(parts)))
    for path in sorted(path.parent for path in folder.glob("*/bag")):
        sequence = rendered(path)
        one, two = (left_open(sequence, views) for views in (1, 2))
        cells = [words(found, part) for part in parts for found in (one, two)]
        print(f"| {sequence.name} | " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
