"""BVH, the motion format of animation programs: a hierarchy with offsets, then Euler angles frame by frame."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from voodoo.export.conventions import Y_UP_LEFT, plain
from voodoo.export.skeleton import Bone, FloatArray, held, mean_interval, placed_on_parents, skeleton
from voodoo.export.track import Track
from voodoo.model.body import Body
from voodoo.model.rotations import euler_angles
from voodoo.whole import write_whole


def write_bvh(path: str | Path, track: Track, body: Body, *, scale: float = 100.0) -> None:
    """Write a track as BVH.

    At rest, axes are X left, Y up, Z forward; with zero rotations the body stands at rest. Rotations are in the order Z, X, Y
    in degrees. Joints have the positions of the track: a joint whose position on its parent changes by more than 0.1 mm
    (lengths are refined while tracking) has position channels, which replace its OFFSET, the median. End sites are those of
    `body`. The format has a constant frame time, the median of the track, and no gaps: a searching frame repeats the previous
    pose, frames before the first pose have the first one, and a track without a pose has the body at rest.

    Args:
        path: .bvh file.
        track: with limb poses, in a frame whose z points up.
        body: with the sizes it was tracked with (`Tracker.body`).
        scale: BVH units per meter; animation programs expect centimeters.

    Raises:
        VoodooError: the track has no limb poses, is of another body, or its stamps do not increase.
        OSError: the file cannot be written.
    """
    posed = held(skeleton(track, body), track.found)
    parts = posed.bones
    lines = ["HIERARCHY"]
    order: list[int] = []
    offsets, still, moving = placed_on_parents(posed, track.found)
    _describe(parts, 0, "", (scale, still, moving), lines, order)
    lines += ["MOTION", f"Frames: {len(track)}", f"Frame Time: {mean_interval(track.stamps):.9f}"]
    local = Y_UP_LEFT @ posed.local() @ Y_UP_LEFT.T
    angles = np.empty((len(track), len(parts), 3))
    for index in range(len(parts)):
        angles[:, index] = np.degrees(euler_angles(local[:, index], "ZXY"))
    places = offsets @ Y_UP_LEFT.T * scale
    for shifts, turns in zip(places, angles, strict=True):
        row = [value for bone in order for value in (*(shifts[bone] if moving[bone] else ()), *turns[bone])]
        lines.append(" ".join(f"{value:.6f}" for value in row))
    write_whole(Path(path), "\n".join(lines) + "\n")


def _describe(
    parts: tuple[Bone, ...],
    index: int,
    indent: str,
    sizes: tuple[float, FloatArray, npt.NDArray[np.bool_]],
    lines: list[str],
    order: list[int],
) -> None:
    """Append the joint of a bone and, depth first, those of its children; `order` is that of the channels.

    `sizes`: BVH units per meter, offset (L, 3) of every joint, and which of them (L,) have position channels.
    """
    bone, (scale, offsets, moving) = parts[index], sizes
    order.append(index)
    root = bone.parent is None
    start = np.zeros(3) if root else offsets[index]
    turns = "Zrotation Xrotation Yrotation"
    channels = f"6 Xposition Yposition Zposition {turns}" if root or moving[index] else f"3 {turns}"
    lines += [
        f"{indent}{'ROOT' if root else 'JOINT'} {plain(bone.name)}",
        f"{indent}{{",
        f"{indent}\tOFFSET {_numbers(start, scale)}",
        f"{indent}\tCHANNELS {channels}",
    ]
    children = [child for child, other in enumerate(parts) if other.parent == index]
    for child in children:
        _describe(parts, child, indent + "\t", sizes, lines, order)
    if not children:
        lines += [
            f"{indent}\tEnd Site",
            f"{indent}\t{{",
            f"{indent}\t\tOFFSET {_numbers(bone.tip - bone.head, scale)}",
            f"{indent}\t}}",
        ]
    lines.append(f"{indent}}}")


def _numbers(vector: FloatArray, scale: float) -> str:
    return " ".join(f"{value:.6f}" for value in Y_UP_LEFT @ vector * scale)
