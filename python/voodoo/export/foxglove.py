"""Poses with the schemas of Foxglove: transforms with names of REP-155, and limbs and joints as a scene."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from itertools import accumulate, islice
from pathlib import Path
from types import ModuleType
from typing import Any

import voodoo._core as _core
from voodoo.errors import VoodooError, installed
from voodoo.export.conventions import JOINT_COLOR, JOINT_M, limb_color
from voodoo.export.human_frames import placed_names
from voodoo.export.layout import FoxgloveAbout, rows_of
from voodoo.export.template import STAMP_NS, template
from voodoo.export.track import Track
from voodoo.export.upright import Turn, upright
from voodoo.measurements import FloatArray
from voodoo.model.body import Body
from voodoo.whole import appearing_whole

SUFFIX = ".foxglove.mcap"
TRANSFORMS, SCENE = "/tf", "/people"
"""Topics: foxglove.FrameTransforms and foxglove.SceneUpdate."""


def library(needed_by: object) -> ModuleType:
    """The package foxglove.

    Raises:
        VoodooError: it is not installed; `needed_by` needs it.
    """
    missing = f"{needed_by}: expected foxglove-sdk, found none; pip install 'voodoo-tracker[foxglove]'"
    for part in ("channels", "messages"):
        installed(f"foxglove.{part}", missing)
    return installed("foxglove", missing)


class Channels:
    """The topics of a file or a server.

    Args:
        foxglove: the package.
        context: of the file or server.
    """

    def __init__(self, foxglove: Any, context: Any) -> None:  # noqa: ANN401
        """Open the topics."""
        self._messages, self._context = foxglove.messages, context  # topics do not keep their context
        self._transforms, self._scene = (
            foxglove.Channel(topic, schema=kind.get_schema(), message_encoding="protobuf", context=context)
            for topic, kind in ((TRANSFORMS, self._messages.FrameTransforms), (SCENE, self._messages.SceneUpdate))
        )
        self._template_of = lru_cache(8)(self._make_template)

    @property
    def are_subscribed(self) -> bool:
        """Whether somebody receives them."""
        return bool(self._transforms.has_sinks() or self._scene.has_sinks())

    def log(
        self,
        stamp: float,
        people: Sequence[str],
        about: Sequence[FoxgloveAbout],
        numbers: Sequence[FloatArray],
        root_frame: str,
    ) -> None:
        """Write a frame of those who are there, by their REP-155 ids; `root_frame` has z up. The numbers of each are those
        of a row of `Layout`."""
        at = round(stamp * 1e9)
        made = self._template_of(tuple(people), tuple(about), root_frame)
        *transforms, scene = made.filled(numbers, _timestamp(*divmod(at, 1_000_000_000)))
        for message in transforms:
            self._transforms.log(message, log_time=at)
        self._scene.log(scene, log_time=at)

    def _make_template(
        self, people: tuple[str, ...], about: tuple[FoxgloveAbout, ...], root_frame: str
    ) -> _core.Template:
        """Messages of persons: transforms, if somebody is there, and the scene."""
        m = self._messages
        time = m.Timestamp(*divmod(STAMP_NS, 1_000_000_000))
        size, red = m.Vector3(x=JOINT_M, y=JOINT_M, z=JOINT_M), m.Color(**JOINT_COLOR)
        before = m.SceneEntityDeletion(timestamp=time, type=m.SceneEntityDeletionType.All)

        def transform(parent: str, name: str, row: list[float]) -> Any:  # noqa: ANN401
            how = {"translation": m.Vector3(**_xyz(row)), "rotation": m.Quaternion(**_xyz(row[3:], "xyzw"))}
            return m.FrameTransform(timestamp=time, parent_frame_id=parent, child_frame_id=name, **how)

        def pose(row: list[float]) -> Any:  # noqa: ANN401
            return m.Pose(position=m.Vector3(**_xyz(row)), orientation=m.Quaternion(**_xyz(row[3:], "xyzw")))

        def cylinder(limb: str, row: list[float]) -> Any:  # noqa: ANN401
            size, scales = m.Vector3(**_xyz(row[7:])), {"bottom_scale": row[10], "top_scale": row[11]}
            return m.CylinderPrimitive(pose=pose(row), size=size, color=m.Color(**limb_color(limb)), **scales)

        def sphere(row: list[float]) -> Any:  # noqa: ANN401
            return m.SpherePrimitive(pose=pose([*row, 0.0, 0.0, 0.0, 1.0]), size=size, color=red)

        ends = [0, *accumulate(of[-1] for of in about)]

        def encode(numbers: FloatArray) -> list[bytes]:
            transforms, entities = [], []
            for person, first, (names, parents, limbs, joints, _) in zip(people, ends[:-1], about, strict=True):
                left = iter(numbers[first:].tolist())
                placed = placed_names(names, parents, person, root_frame)
                transforms += [transform(*pair, list(islice(left, 7))) for pair in placed]
                cylinders = [cylinder(limb, list(islice(left, 12))) for limb in limbs]
                spheres = [sphere(list(islice(left, 3))) for _ in range(joints)]
                what = {"cylinders": cylinders, "spheres": spheres}
                entities.append(m.SceneEntity(timestamp=time, frame_id=root_frame, id=person, **what))
            scene = m.SceneUpdate(deletions=[before], entities=entities)
            return [one.encode() for one in (*[m.FrameTransforms(transforms=transforms)] * bool(people), scene)]

        return template(encode, ends[-1], stamp=_timestamp(*divmod(STAMP_NS, 1_000_000_000)))


def _timestamp(seconds: int, nanoseconds: int) -> bytes:
    """Fields of google.protobuf.Timestamp, always of the same length: seven bits a byte, the highest says that more follow.

    Raises:
        VoodooError: a time before zero, or too large.
    """
    s, n = seconds, nanoseconds
    first = 0x08, s & 127 | 128, s >> 7 & 127 | 128, s >> 14 & 127 | 128, s >> 21 & 127 | 128, s >> 28
    fields = (*first, 0x10, n & 127 | 128, n >> 7 & 127 | 128, n >> 14 & 127 | 128, n >> 21 & 127 | 128, n >> 28)
    try:
        return bytes(fields)
    except ValueError:
        raise VoodooError(f"stamps: expected none before zero and none that are no times, found {seconds} s") from None


def _xyz(values: Iterable[float], names: str = "xyz") -> dict[str, float]:
    return dict(zip(names, values, strict=False))


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
        VoodooError: foxglove-sdk is not installed, a stamp before zero, or a track without limb poses or of another body.
        OSError: the file cannot be written.
    """
    foxglove = library(path)
    context = foxglove.Context()
    channels = Channels(foxglove, context)
    frames: dict[float, tuple[list[str], list[FoxgloveAbout], list[FloatArray]]] = {}
    root = root_frame
    for person, (track, body) in people.items():
        track, root = upright(track, root_frame, turn)
        found = track.of_frames(track.found)
        layout, found_rows = rows_of(found, body)
        rows = iter(found_rows)
        for stamp, there in zip(track.stamps.tolist(), track.found.tolist(), strict=True):
            persons, abouts, numbers = frames.setdefault(stamp, ([], [], []))
            if there:
                persons.append(person)
                abouts.append(layout.shapes)
                numbers.append(next(rows))
    with appearing_whole(Path(path)) as place, foxglove.open_mcap(str(place), context=context):
        for stamp in sorted(frames):
            channels.log(stamp, *frames[stamp], root)
