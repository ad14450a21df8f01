"""BVH, the motion format of animation programs: a hierarchy with offsets, then Euler angles frame by frame."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from voodoo.export.skeleton import Bone, FloatArray, held, mean_interval, skeleton
from voodoo.export.track import Track
from voodoo.model.body import Body

_Y_UP = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
"""(x, y, z) of BVH = (y, z, x) of the standing frame: X to the left, Y up, Z forward."""


def write_bvh(path: str | Path, track: Track, body: Body, *, scale: float = 100.0) -> None:
    """Write a track as BVH.

    Axes are X left, Y up, Z forward at rest; with zero rotations the body stands at rest. Rotations are in the order
    Z, X, Y in degrees. All joints are closed: where the solver left a gap (`Estimate.joint_gaps`), a limb is moved to
    its parent. The format has one constant frame time, the median of the track's, and no gaps: a searching frame repeats
    the pose before it, those before the first pose show that one, and a track of nobody the body at rest.

    Args:
        path: .bvh file.
        track: with limb poses, in a frame whose z points up.
        body: in the sizes it was tracked with (`Tracker.body`).
        scale: BVH units per metre; animation programs expect centimetres.

    Raises:
        VoodooError: the track has no limb poses, is of another body, or its stamps do not rise.
        OSError: the file cannot be written.
    """
    posed = held(skeleton(track, body), track.found)
    parts = posed.bones
    lines = ["HIERARCHY"]
    order: list[int] = []
    _describe(parts, 0, "", scale, lines, order)
    lines += ["MOTION", f"Frames: {len(track)}", f"Frame Time: {mean_interval(track.stamps):.9f}"]
    local = _Y_UP @ posed.local() @ _Y_UP.T
    angles = np.empty((len(track), len(parts), 3))
    for index in range(len(parts)):
        angles[:, index] = Rotation.from_matrix(local[:, index]).as_euler("ZXY", degrees=True)
    roots = posed.heads[:, 0] @ _Y_UP.T * scale
    for root, turns in zip(roots, angles[:, order], strict=True):
        lines.append(" ".join(f"{value:.6f}" for value in (*root, *turns.ravel())))
    Path(path).write_text("\n".join(lines) + "\n", encoding="ascii")


def _describe(
    parts: tuple[Bone, ...], index: int, indent: str, scale: float, lines: list[str], order: list[int]
) -> None:
    """Append the joint of a bone and, depth first, those of its children; `order` is that of the channels."""
    bone = parts[index]
    order.append(index)
    root = bone.parent is None
    start = np.zeros(3) if root else bone.head - parts[bone.parent or 0].head
    turns = "Zrotation Xrotation Yrotation"
    channels = f"6 Xposition Yposition Zposition {turns}" if root else f"3 {turns}"
    lines += [
        f"{indent}{'ROOT' if root else 'JOINT'} {bone.name}",
        f"{indent}{{",
        f"{indent}\tOFFSET {_numbers(start, scale)}",
        f"{indent}\tCHANNELS {channels}",
    ]
    children = [child for child, other in enumerate(parts) if other.parent == index]
    for child in children:
        _describe(parts, child, indent + "\t", scale, lines, order)
    if not children:
        lines += [
            f"{indent}\tEnd Site",
            f"{indent}\t{{",
            f"{indent}\t\tOFFSET {_numbers(bone.tip - bone.head, scale)}",
            f"{indent}\t}}",
        ]
    lines.append(f"{indent}}}")


def _numbers(vector: FloatArray, scale: float) -> str:
    return " ".join(f"{value:.6f}" for value in _Y_UP @ vector * scale)
