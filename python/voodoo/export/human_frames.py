"""Frames of REP-155 on a tracked body: names, parents and poses."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

import voodoo._core as _core
from voodoo.export.conventions import NAMES
from voodoo.export.skeleton import FloatArray, Skeleton

FRAMES = {limb: names.rep155 for limb, names in NAMES.items() if names.rep155}
"""REP-155 frame of each limb of the default humans; other limbs (the neck) keep their own name."""


class HumanFrames(NamedTuple):
    """Frames of F poses: N a pose, parents first.

    Attributes:
        names: N names without that of the person; the first is "body".
        parents: N numbers of the parent; -1 of the first one, which is on the root frame.
        places: (F, N, 3) [m] in the root frame.
        on_parents: (F, N, 7): place x, y, z [m] and rotation x, y, z, w of each frame on its parent.
    """

    names: tuple[str, ...]
    parents: tuple[int, ...]
    places: FloatArray
    on_parents: FloatArray


def human_frames(joint_names: tuple[str, ...], joints: FloatArray, posed: Skeleton) -> HumanFrames:
    """Frames of poses with joints (F, J, 3)."""
    names, parents, plan = _plan(joint_names, posed.limbs)
    points = np.concatenate([posed.heads, joints], axis=1)
    return HumanFrames(names, parents, *_core.placed(posed.rotations, points, plan))


def placed_names(names: Sequence[str], parents: Sequence[int], person: str, root: str) -> list[tuple[str, str]]:
    """Parent and name of each of the frames of a person."""
    names = [f"{name}_{person}" for name in names]
    return [(names[above] if above >= 0 else root, name) for name, above in zip(names, parents, strict=True)]


@lru_cache(maxsize=64)
def _plan(
    joint_names: tuple[str, ...], limbs: tuple[tuple[str, int | None], ...]
) -> tuple[tuple[str, ...], tuple[int, ...], npt.NDArray[np.int64]]:
    """Of each frame the name; the parent; and the plan of `placed`: the limb it turns with, two points in the middle of which it
    is (heads of limbs, then joints), and the parent."""
    sites = {name: len(limbs) + index for index, name in enumerate(joint_names)}
    there = {name for name, _ in limbs}

    def middle(joint: str, otherwise: int) -> tuple[int, int]:
        left, right = sites.get(f"l_{joint}"), sites.get(f"r_{joint}")
        return (otherwise, otherwise) if left is None or right is None else (left, right)

    rows: list[tuple[str, int, int, int, int]] = [("body", 0, *middle("hip", 0), -1)]
    frame_of: list[int] = []
    for number, (name, above) in enumerate(limbs):
        parent = 0 if above is None or name.endswith("_thigh") else frame_of[above]
        ends = number, number
        if name in ("torso", "thorax"):
            ends = middle("shoulder", number)
        elif above is None:
            ends = rows[0][2:4]
        elif name == "head" and "head_center" in sites:
            ends = sites["head_center"], sites["head_center"]
        frame_of.append(len(rows))
        rows.append((FRAMES.get(name, name), number, *ends, parent))
        # In bodies without hand or foot, the forearm or calf carries the frame of the wrist or ankle.
        for limb, end, site in (("_forearm", "_hand", "_wrist"), ("_calf", "_foot", "_ankle")):
            side = name.removesuffix(limb)
            if name.endswith(limb) and side + end not in there and side + site in sites:
                place = sites[side + site]
                rows.append((side + site, number, place, place, frame_of[number]))
    return tuple(row[0] for row in rows), tuple(row[-1] for row in rows), np.array([row[1:] for row in rows])
