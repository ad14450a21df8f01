"""Frames of REP-155 on a tracked body: names, parents and poses."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from voodoo.export.conventions import NAMES
from voodoo.export.skeleton import FloatArray, Skeleton
from voodoo.export.track import Track
from voodoo.model.rotations import quaternions

FRAMES = {limb: names.rep155 for limb, names in NAMES.items() if names.rep155}
"""REP-155 frame of each limb of the default humans; other limbs (the neck) keep their own name."""


def frame_poses(track: Track, posed: Skeleton, index: int, person: str) -> dict[str, tuple[str | None, FloatArray]]:
    """Frames of one instant: name -> (parent, root_from_frame (4, 4)); the parent of `body_` is None, the root
    frame."""
    sites = dict(zip(track.joint_names, track.joints[index], strict=True))
    bones = posed.bones
    limb_frames = [f"{FRAMES.get(bone.name, bone.name)}_{person}" for bone in bones]
    body_frame = f"body_{person}"
    trunk = posed.rotations[index, 0]
    frames: dict[str, tuple[str | None, FloatArray]] = {
        body_frame: (None, _pose(trunk, _middle(sites, "hip", posed.heads[index, 0])))
    }
    for number, bone in enumerate(bones):
        place, turn = posed.heads[index, number], posed.rotations[index, number]
        parent = body_frame if bone.parent is None or bone.name.endswith("_thigh") else limb_frames[bone.parent]
        if bone.name in ("torso", "thorax"):
            place = _middle(sites, "shoulder", place)
        elif bone.parent is None:
            place = frames[body_frame][1][:3, 3]
        elif bone.name == "head" and "head_center" in sites:
            place = sites["head_center"]
        frames[limb_frames[number]] = (parent, _pose(turn, place))
        # In bodies without hand or foot, the forearm or calf carries the frame of the wrist or ankle.
        for limb, end, site in (("_forearm", "_hand", "_wrist"), ("_calf", "_foot", "_ankle")):
            side = bone.name.removesuffix(limb)
            if bone.name.endswith(limb) and side + end not in track.limb_names and side + site in sites:
                frames[f"{side}{site}_{person}"] = (limb_frames[number], _pose(turn, sites[side + site]))
    return frames


def on_parents(
    frames: Mapping[str, tuple[str | None, FloatArray]],
) -> list[tuple[str, str | None, list[float], list[float]]]:
    """Of each frame: name, parent, and place (3) [m] and rotation (x, y, z, w) on it."""
    poses = np.array([pose for _, pose in frames.values()])
    above = np.array([np.eye(4) if parent is None else frames[parent][1] for parent, _ in frames.values()])
    relative = np.linalg.inv(above) @ poses
    turns, places = quaternions(relative[:, :3, :3]).tolist(), relative[:, :3, 3].tolist()
    parents = [parent for parent, _ in frames.values()]
    return list(zip(frames, parents, places, turns, strict=True))


def _pose(turn: FloatArray, place: FloatArray) -> FloatArray:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = turn, place
    return pose


def _middle(sites: dict[str, FloatArray], joint: str, otherwise: FloatArray) -> FloatArray:
    both = [sites.get(f"{side}_{joint}") for side in "lr"]
    if both[0] is None or both[1] is None:
        return otherwise
    return np.asarray((both[0] + both[1]) / 2.0)
