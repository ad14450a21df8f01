"""Poses with the schemas of Foxglove: transforms with names of REP-155, and limbs and joints as a scene."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from voodoo.errors import VoodooError
from voodoo.export.human_frames import frame_poses, on_parents
from voodoo.export.skeleton import Skeleton, skeleton
from voodoo.export.track import Track
from voodoo.export.upright import Turn, upright
from voodoo.model.body import Body
from voodoo.model.rotations import quaternions
from voodoo.whole import appearing_whole

SUFFIX = ".foxglove.mcap"
TRANSFORMS, SCENE = "/tf", "/people"
"""Topics: foxglove.FrameTransforms and foxglove.SceneUpdate."""
_LEFT, _RIGHT, _JOINT = (
    dict(zip("rgba", one, strict=True)) for one in ((0.9, 0.6, 0.3, 0.6), (0.3, 0.6, 0.9, 0.6), (0.9, 0.1, 0.1, 0.6))
)
_JOINT_M = 0.04


def library(wanted: object) -> ModuleType:
    """The package foxglove.

    Raises:
        VoodooError: it is not installed; `wanted` needs it.
    """
    try:
        import foxglove
        import foxglove.channels
        import foxglove.messages
    except ImportError:
        raise VoodooError(
            f"{wanted}: expected foxglove-sdk, found none; pip install 'voodoo-tracker[foxglove]'"
        ) from None
    return foxglove


class Channels:
    """The topics of a file or a server.

    Args:
        foxglove: the package.
        context: of the file or server.
    """

    def __init__(self, foxglove: Any, context: Any) -> None:  # noqa: ANN401
        """Open the topics."""
        self._messages, self._context = foxglove.messages, context  # topics do not keep their context
        self._transforms = foxglove.channels.FrameTransformsChannel(TRANSFORMS, context=context)
        self._scene = foxglove.channels.SceneUpdateChannel(SCENE, context=context)

    @property
    def are_wanted(self) -> bool:
        """Whether somebody receives them."""
        return bool(self._transforms.has_sinks() or self._scene.has_sinks())

    def log(self, stamp: float, people: Mapping[str, tuple[Track, Skeleton, Body]], root_frame: str) -> None:
        """Write a frame.

        Args:
            stamp: [s].
            people: REP-155 id -> track and skeleton of this frame, and body, of those who are there, in `root_frame`.
            root_frame: with z up.
        """
        m = self._messages
        time = m.Timestamp.from_epoch_secs(stamp)
        transforms, entities = [], []
        for person, (track, posed, body) in people.items():
            for name, parent, place, turn in on_parents(frame_poses(track, posed, 0, person)):
                transforms.append(
                    m.FrameTransform(
                        timestamp=time,
                        parent_frame_id=parent or root_frame,
                        child_frame_id=name,
                        translation=m.Vector3(**_xyz(place)),
                        rotation=m.Quaternion(**_xyz(turn, "xyzw")),
                    )
                )
            entities.append(self._entity(time, person, track, body, root_frame))
        log_time = round(stamp * 1e9)
        if transforms:
            self._transforms.log(m.FrameTransforms(transforms=transforms), log_time=log_time)
        all_before = m.SceneEntityDeletion(timestamp=time, type=m.SceneEntityDeletionType.All)
        self._scene.log(m.SceneUpdate(deletions=[all_before], entities=entities), log_time=log_time)

    def _entity(self, time: Any, person: str, track: Track, body: Body, root_frame: str) -> Any:  # noqa: ANN401
        m = self._messages
        poses = track.world_from_limb[0]
        lengths = np.array([limb.shape.length for limb in body.limbs])
        middles = poses[:, :3, 3] + poses[:, :3, 2] * lengths[:, None] / 2.0
        cylinders = []
        for limb, place, turn in zip(body.limbs, middles.tolist(), quaternions(poses[:, :3, :3]).tolist(), strict=True):
            # Scales are of the mean of both ends.
            a, b = limb.shape.a0 + limb.shape.a1, limb.shape.b0 + limb.shape.b1
            low = (limb.shape.a0 / a + limb.shape.b0 / b) if a and b else 1.0
            cylinders.append(
                m.CylinderPrimitive(
                    pose=m.Pose(position=m.Vector3(**_xyz(place)), orientation=m.Quaternion(**_xyz(turn, "xyzw"))),
                    size=m.Vector3(x=a, y=b, z=limb.shape.length),
                    bottom_scale=low,
                    top_scale=2.0 - low,
                    color=m.Color(**(_LEFT if limb.name.startswith("l_") else _RIGHT)),
                )
            )
        size, red = m.Vector3(x=_JOINT_M, y=_JOINT_M, z=_JOINT_M), m.Color(**_JOINT)
        still = m.Quaternion(x=0.0, y=0.0, z=0.0, w=1.0)
        spheres = [
            m.SpherePrimitive(pose=m.Pose(position=m.Vector3(**_xyz(place)), orientation=still), size=size, color=red)
            for place in track.joints[0].tolist()
        ]
        return m.SceneEntity(timestamp=time, frame_id=root_frame, id=person, cylinders=cylinders, spheres=spheres)


def _xyz(values: Iterable[float], names: str = "xyz") -> dict[str, float]:
    return dict(zip(names, values, strict=True))


def write_foxglove(
    path: str | Path, people: Mapping[str, tuple[Track, Body]], *, root_frame: str, turn: Turn | None = None
) -> None:
    """Write an MCAP file with the schemas of Foxglove, for the app of that name.

    Topics: `/tf` (foxglove.FrameTransforms, names of REP-155) and `/people` (foxglove.SceneUpdate: limbs as tapered cylinders,
    joints as spheres). In searching frames nobody is there.

    Args:
        path: .foxglove.mcap file.
        people: REP-155 id -> track with limb poses, and body in the sizes it was tracked with.
        root_frame: frame of the tracks.
        turn: see `write_bag`.

    Raises:
        VoodooError: foxglove-sdk is not installed, or a track without limb poses or of another body.
        OSError: the file cannot be written.
    """
    foxglove = library(path)
    context = foxglove.Context()
    channels = Channels(foxglove, context)
    frames: dict[float, dict[str, int]] = {}
    posed: dict[str, tuple[Track, Skeleton, Body]] = {}
    root = root_frame
    for person, (track, body) in people.items():
        track, root = upright(track, root_frame, turn)
        posed[person] = track, skeleton(track, body), body
        for index, (stamp, found) in enumerate(zip(track.stamps.tolist(), track.found.tolist(), strict=True)):
            frames.setdefault(stamp, {}).update({person: index} if found else {})
    with appearing_whole(Path(path)) as place, foxglove.open_mcap(str(place), context=context):
        for stamp, there in sorted(frames.items()):
            channels.log(stamp, {name: _at(*posed[name], index) for name, index in there.items()}, root)


def _at(track: Track, posed: Skeleton, body: Body, index: int) -> tuple[Track, Skeleton, Body]:
    one = np.array([index])
    return track.of_frames(one), posed.of_frames(one), body
