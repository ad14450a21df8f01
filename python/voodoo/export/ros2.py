"""A ROS 2 bag (MCAP) of a track: /tf, joint states and markers, for RViz, Foxglove and a robot's own nodes.

Names follow REP-155 and the human_description package of ROS4HRI: frames `body_<id>`, `torso_<id>`, `head_<id>`,
`l_shoulder_<id>` (the upper arm), `l_elbow_<id>` (the forearm), `l_wrist_<id>`, `l_hip_<id>`, `l_knee_<id>`,
`l_ankle_<id>` and the same for `r_`; joints `l_y_shoulder_<id>`, `l_p_shoulder_<id>`... All frames have x forward, y
left, z up when the person stands at rest (REP-103). The parent of `body_<id>` is the recording's root frame (REP-105).
"""

from __future__ import annotations

import shutil
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from rosbags.interfaces import Nodetype
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from voodoo._core import Estimate
from voodoo.errors import VoodooError
from voodoo.export.conventions import JOINT_COLOR, JOINT_M, Color, limb_color
from voodoo.export.human_frames import placed_names
from voodoo.export.layout import rows_of
from voodoo.export.skeleton import ellipsoids
from voodoo.export.track import Track
from voodoo.export.upright import Turn, by_axes, upright
from voodoo.export.urdf import urdf
from voodoo.measurements import ColorImage, DepthImage, FloatArray
from voodoo.model.body import Body
from voodoo.model.projection import CameraView
from voodoo.model.rotations import quaternions
from voodoo.whole import appearing_whole

BODIES, PERSONS = "/humans/bodies", "/humans/persons"
TRACKED = f"{BODIES}/tracked", f"{PERSONS}/tracked"
"""Topics of the ids of all persons who have transforms, and of their bodies, which are the same."""
IDS, STRING, BOOL = "hri_msgs/msg/IdsList", "std_msgs/msg/String", "std_msgs/msg/Bool"
SKELETON = "hri_msgs/msg/Skeleton2D"
STORE = get_typestore(Stores.ROS2_HUMBLE)
"""Release whose definitions are used; the messages used here have the same fields in other releases."""
_POINT = "hri_msgs/msg/NormalizedPointOfInterest2D"
for _fields, _kind in (
    ("std_msgs/Header header\nstring[] ids", IDS),
    ("float32 x\nfloat32 y\nfloat32 c", _POINT),
    ("std_msgs/Header header\nhri_msgs/NormalizedPointOfInterest2D[18] skeleton", SKELETON),
):
    STORE.register(get_types_from_msg(_fields, _kind))
TF, JOINTS = "tf2_msgs/msg/TFMessage", "sensor_msgs/msg/JointState"
POSE = "geometry_msgs/msg/PoseWithCovarianceStamped"
_MARKER = "visualization_msgs/msg/Marker"
_KINDS: Any = STORE.types[_MARKER]
_SPREAD_COLOR: Color = {"r": 0.9, "g": 0.9, "b": 0.9, "a": 0.3}


def person_id(number: int) -> str:
    """The REP-155 id of a person in `tracked`, topics and frames: it begins with a letter, as names in topics must."""
    return f"p{number}"


def description(body: Body, person: str) -> dict[str, Any]:
    """Topic -> message of the person's URDF in the body's current sizes and of the id of the person's body (std_msgs/String), and
    that the person is not known by name (std_msgs/Bool)."""
    return {
        f"/human_description_{person}": new(STRING, data=urdf(body, person)),
        f"{PERSONS}/{person}/body_id": new(STRING, data=person),
        f"{PERSONS}/{person}/anonymous": new(BOOL, data=True),
    }


def tracked(stamp: float, persons: Sequence[str], *, root_frame: str) -> dict[str, Any]:
    """Topic of TRACKED -> message (hri_msgs/IdsList) of the ids of all persons who have transforms at a time [s]."""
    return dict.fromkeys(TRACKED, new(IDS, header=header_at(stamp, root_frame), ids=list(persons)))


_KEYPOINTS = ("", "vc7") + tuple(
    f"{side}_{joint}"
    for joints in ("shoulder elbow wrist", "hip knee ankle")
    for side in "rl"
    for joint in joints.split()
)
"""Sites of the first keypoints of Skeleton2D; of nose, eyes and ears nothing is known."""
_LIMB_TO = {"elbow": "upperarm", "wrist": "forearm", "knee": "thigh", "ankle": "calf"}


def keypoints_message(estimate: Estimate, image: DepthImage | ColorImage) -> Any:  # noqa: ANN401
    """Skeleton2D of a person with a pose: where the camera of an image sees the joints, normalized by its size, and the
    probability that the limb to a joint ends within 10 cm of it; all 0 for a joint that is unknown or outside of the image."""
    places, sure, camera = estimate.joints, estimate.limb_probability, image.camera
    known = [number for number, site in enumerate(_KEYPOINTS) if site in places]
    view = CameraView(camera, image.root_from_sensor)
    pixels, _ = view.project(np.array([places[_KEYPOINTS[number]] for number in known]).reshape(-1, 3))
    points = [new(_POINT) for _ in range(18)]
    for number, at in zip(known, (pixels + 0.5) / (camera.width, camera.height), strict=True):
        side, _, joint = _KEYPOINTS[number].partition("_")
        probability = sure.get(f"{side}_{_LIMB_TO.get(joint)}", sure[estimate.limb_names[0]])
        if ((at >= 0.0) & (at <= 1.0)).all():
            points[number] = new(_POINT, x=float(at[0]), y=float(at[1]), c=float(np.nan_to_num(probability)))
    return new(SKELETON, header=header_at(image.stamp, image.sensor), skeleton=points)


def write_bag(
    path: str | Path, track: Track, body: Body, *, root_frame: str, person: str = "p1", turn: Turn | None = None
) -> None:
    """Write a new bag folder, or the .mcap file of one.

    Topics: `/tf` (tf2_msgs/TFMessage), `/humans/bodies/tracked` and `/humans/persons/tracked` (hri_msgs/IdsList),
    `/humans/persons/<person>/body_id` and `anonymous`, and `/human_description_<person>` (std_msgs/String, URDF; these three once
    at the beginning), `/humans/bodies/<person>/joint_states` (sensor_msgs/JointState) and
    `/humans/bodies/<person>/markers` (visualization_msgs/MarkerArray: limbs as cylinders of their mean girth, joints, and
    where these are known ellipsoids of one standard deviation about them). If the covariance is known,
    `/humans/bodies/<person>/pose` (geometry_msgs/PoseWithCovarianceStamped) is the pose of `body_<person>` with its covariance.
    Searching frames have no transforms, no joint states and no pose; their markers delete those of the frame before.
    Where the root is turned, all of it is in the frame `<root_frame>_upright` with x forward and z up, which /tf
    has as a child of the root frame.

    Args:
        path: the folder, which must not exist, or a .mcap file.
        track: with limb poses.
        body: in the sizes it was tracked with.
        root_frame: frame of the track, e.g. "base_link".
        person: REP-155 id.
        turn: how the root frame is turned upright; None: a camera's optical frame, by its name, by its axes.

    Raises:
        VoodooError: the folder exists, an empty name, stamps before zero (a bag has none), or a track without limb poses or
            of another body.
        OSError: the bag cannot be written.
    """
    write_people_bag(path, {person: (track, body)}, root_frame=root_frame, turn=turn)


def write_people_bag(
    path: str | Path, people: Mapping[str, tuple[Track, Body]], *, root_frame: str, turn: Turn | None = None
) -> None:
    """Write a new bag folder of several people, or the .mcap file of one.

    As `write_bag`, with frames `body_<person>`, `torso_<person>`, ... and topics `/humans/bodies/<person>/...` for each of them.

    Args:
        path: the folder, which must not exist, or a .mcap file.
        people: REP-155 id, which begins with a letter -> track with limb poses, and body in the sizes it was tracked with.
        root_frame: frame of the tracks.
        turn: see `write_bag`.

    Raises:
        VoodooError: as `write_bag`.
        OSError: the bag cannot be written.
    """
    path = Path(path)
    for name in people:
        if not name.isidentifier():
            raise VoodooError(f"person: expected a name, found {name!r}")
    humans = [_Human(track, body, name, root_frame, turn) for name, (track, body) in people.items()]
    if path.suffix != ".mcap" and path.exists():
        raise VoodooError(f"{path}: expected a folder that does not exist yet, found one")
    kinds = {"/tf": TF} | dict.fromkeys(TRACKED, IDS)
    first: dict[str, Any] = {}
    frames: list[tuple[float, int, int]] = []
    there: dict[float, list[str]] = {}
    for number, human in enumerate(humans):
        kinds |= human.kinds()
        first |= description(human.body, human.person)
        frames += [(float(stamp), number, index) for index, stamp in enumerate(human.track.stamps)]
    kinds |= {topic: message.__msgtype__ for topic, message in first.items()}
    frames.sort()
    for stamp, number, index in frames:
        there.setdefault(stamp, []).extend([humans[number].person] if humans[number].track.found[index] else [])
    with bag(path) as writer:
        connect = {name: writer.add_connection(name, kind, typestore=STORE) for name, kind in kinds.items()}
        for stamp, number, index in frames:
            messages = first | humans[number].messages(index)
            if stamp in there:
                messages |= tracked(stamp, there.pop(stamp), root_frame=humans[number].root)
            first = {}
            for name, message in messages.items():
                writer.write(connect[name], round(stamp * 1e9), cdr(message))


@contextmanager
def bag(path: Path) -> Iterator[Writer]:
    """Write a new bag: a folder, or for .mcap the only file of one; it appears when it is complete."""
    with appearing_whole(path) as place:
        folder = place.with_suffix("") if path.suffix == ".mcap" else place
        with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
            yield writer
        if folder != place:
            next(folder.glob("*.mcap")).rename(place)
            shutil.rmtree(folder)


class _Human:
    """The messages of one person."""

    def __init__(self, track: Track, body: Body, person: str, root_frame: str, turn: Turn | None = None) -> None:
        if not root_frame:
            raise VoodooError("root_frame: expected a name, found none")
        track, self.root = upright(track, root_frame, turn)
        above = (by_axes(root_frame) if turn is None else turn).pose
        self._above = [] if self.root == root_frame else [(root_frame, self.root, root_on_parent(above))]
        self.track, self.body, self.person, self.topic = track, body, person, f"{BODIES}/{person}"
        if (track.stamps < 0.0).any():
            raise VoodooError(f"stamps: expected none before zero, as a bag wants it, found {track.stamps.min()} s")
        self._displayed = track.found
        if self._displayed.any():
            layout, rows = rows_of(track.of_frames(self._displayed), body)
            frames, *_, angles, sure, _ = layout.parts(rows)
            self._joints, self._frames = layout.angles, placed_names(*layout.shapes[:2], person, self.root)
            shown = zip(angles, frames, sure, strict=True)
            self._rows = dict(zip(np.flatnonzero(self._displayed).tolist(), shown, strict=True))

    def kinds(self) -> dict[str, str]:
        """Topics and types of the messages, without /tf."""
        kinds = {f"{self.topic}/joint_states": JOINTS}
        kinds |= {f"{self.topic}/pose": POSE} if np.isfinite(self.track.root_covariance).any() else {}
        return kinds | {f"{self.topic}/markers": "visualization_msgs/msg/MarkerArray"}

    def messages(self, index: int) -> dict[str, Any]:
        """Topic -> message of a frame."""
        at = float(self.track.stamps[index])
        header = header_at(at, self.root)
        messages: dict[str, Any] = {}
        drawn = [new(_MARKER, header=header, action=_KINDS.DELETEALL)]
        if self._displayed[index]:
            angles, rows, sure = self._rows[index]
            placed = [(parent, name, row) for (parent, name), row in zip(self._frames, rows.tolist(), strict=True)]
            messages["/tf"] = transforms_message(at, [*self._above, *placed])
            messages[f"{self.topic}/joint_states"] = joint_message(at, self.person, self._joints, angles)
            if np.isfinite(sure).all():
                messages[f"{self.topic}/pose"] = pose_message(at, self.root, rows[0].tolist(), sure)
            drawn = _markers(self.track, self.body, index, header)
        messages[f"{self.topic}/markers"] = new("visualization_msgs/msg/MarkerArray", markers=drawn)
        return messages


def root_on_parent(pose: FloatArray) -> list[float]:
    """Place and rotation, as in the rows of `Layout`, of the upright frame on the root frame that `pose` turns."""
    return [*(-pose[:3, :3].T @ pose[:3, 3]).tolist(), *quaternions(pose[:3, :3].T).tolist()]


def transforms_message(stamp: float, rows: Iterable[tuple[str, str, Sequence[float]]]) -> Any:  # noqa: ANN401
    """TFMessage of parents, names, and place x, y, z and rotation x, y, z, w on the parent, at a time [s]."""
    transforms = []
    for parent, name, row in rows:
        place, turn = _geometry("Vector3", row[:3]), _geometry("Quaternion", row[3:])
        moved = new("geometry_msgs/msg/Transform", translation=place, rotation=turn)
        about: dict[str, Any] = {"header": header_at(stamp, parent), "child_frame_id": name}
        transforms.append(new("geometry_msgs/msg/TransformStamped", transform=moved, **about))
    return new(TF, transforms=transforms)


def joint_message(stamp: float, person: str, joints: Sequence[str], angles: npt.ArrayLike) -> Any:  # noqa: ANN401
    """JointState of angles [rad] at a time [s]."""
    header, names = header_at(stamp, f"body_{person}"), [f"{name}_{person}" for name in joints]
    return new(JOINTS, header=header, name=names, position=np.ascontiguousarray(angles, dtype=np.float64))


def pose_message(stamp: float, root: str, row: Sequence[float], covariance: npt.ArrayLike) -> Any:  # noqa: ANN401
    """PoseWithCovarianceStamped of a place x, y, z and rotation x, y, z, w with its covariance (36 numbers), at a time [s]."""
    uncertain = np.asarray(covariance, dtype=np.float64).ravel()
    pose = new("geometry_msgs/msg/PoseWithCovariance", pose=_pose(row), covariance=uncertain)
    return new(POSE, header=header_at(stamp, root), pose=pose)


def _markers(track: Track, body: Body, index: int, header: Any) -> list[Any]:  # noqa: ANN401
    result: list[Any] = []

    def add(name: str, kind: int, row: Sequence[float], size: Sequence[float], rgba: Color, **more: Any) -> None:  # noqa: ANN401
        color, scale = new("std_msgs/msg/ColorRGBA", **rgba), _geometry("Vector3", size)
        about = {"header": header, "ns": name, "type": kind, "pose": _pose(row), "scale": scale, "color": color}
        result.append(new(_MARKER, **about, **more))

    poses = track.world_from_limb[index]
    turns = quaternions(poses[:, :3, :3])
    for number, (limb, pose) in enumerate(zip(body.limbs, poses, strict=True)):
        middle = pose[:3, :3] @ np.array([0.0, 0.0, limb.shape.length / 2]) + pose[:3, 3]
        size = (limb.shape.a0 + limb.shape.a1, limb.shape.b0 + limb.shape.b1, limb.shape.length)
        add("limbs", _KINDS.CYLINDER, (*middle, *turns[number]), size, limb_color(limb.name), id=number)
    points = [_geometry("Point", position) for position in track.joints[index].tolist()]
    add("joints", _KINDS.SPHERE_LIST, (*[0.0] * 6, 1.0), (JOINT_M,) * 3, JOINT_COLOR, points=points)
    known = np.isfinite(track.covariance[index]).all(axis=(1, 2)).nonzero()[0]
    sizes, axes = ellipsoids(track.covariance[index][known])
    for number, turn, size in zip(known.tolist(), axes, 2.0 * sizes, strict=True):
        add("uncertainty", _KINDS.SPHERE, (*track.joints[index, number], *turn), size, _SPREAD_COLOR, id=number)
    return result


def new(kind: str, **fields: Any) -> Any:  # noqa: ANN401
    """A message of a type, by its fields; others are zero, empty or false."""
    return STORE.types[kind](**{**_unset(kind), **fields})


@cache
def _unset(kind: str) -> dict[str, Any]:
    """Fields of a message that says nothing."""
    return {name: _nothing(*node) for name, node in STORE.fielddefs[kind][1]}


def _nothing(form: Nodetype, content: Any) -> Any:  # noqa: ANN401 - of rosbags
    if form == Nodetype.NAME:
        return new(content)
    if form == Nodetype.BASE:
        return "" if content[0] == "string" else np.zeros((), content[0]).item()
    (of, inner), count = content
    if of == Nodetype.BASE and inner[0] != "string":
        return np.zeros(count if form == Nodetype.ARRAY else 0, inner[0])
    return []


def header_at(stamp: float, frame: str) -> Any:  # noqa: ANN401
    """A std_msgs/Header of a time [s]."""
    seconds, rest = divmod(round(stamp * 1e9), 1_000_000_000)
    time = new("builtin_interfaces/msg/Time", sec=seconds, nanosec=rest)
    return new("std_msgs/msg/Header", stamp=time, frame_id=frame)


def _pose(row: Sequence[float]) -> Any:  # noqa: ANN401
    place, turn = _geometry("Point", row[:3]), _geometry("Quaternion", row[3:])
    return new("geometry_msgs/msg/Pose", position=place, orientation=turn)


def _geometry(kind: str, values: Sequence[float]) -> Any:  # noqa: ANN401
    """A Point, Vector3 or Quaternion of its x, y, z and w."""
    return new(f"geometry_msgs/msg/{kind}", **dict(zip("xyzw", map(float, values), strict=False)))


def instant(
    estimate: Estimate, body: Body, *, root_frame: str, person: str, turn: Turn | None = None
) -> dict[str, Any]:
    """Topic -> message of one frame, as `write_bag` writes them: /tf, joint states and markers.

    Args:
        estimate: of the frame; without a pose (status "searching") there are no transforms and no joint states.
        body: in its current sizes.
        root_frame: frame of the estimate; if it is turned, see `write_bag`.
        person: REP-155 id.
        turn: see `write_bag`.

    Raises:
        VoodooError: a stamp before zero.
    """
    # Angles are not needed; if nobody was found, the names come from the body.
    track = Track.of([estimate], body=None if estimate.joints else body)
    return _Human(track, body, person, root_frame, turn).messages(0)


def cdr(message: Any) -> bytes:  # noqa: ANN401 - its class is made from a message definition
    """A message as ROS 2 sends and stores it."""
    return bytes(STORE.serialize_cdr(message, message.__msgtype__))
