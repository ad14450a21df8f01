"""Selects the topics of a bag that are measurements, and their calibrations."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

from voodoo.errors import RecordingError, reading
from voodoo.model.camera import Camera
from voodoo.names import TOPIC_KINDS, TopicKind
from voodoo.recordings import realsense
from voodoo.recordings.order import natural
from voodoo.recordings.recording import number_option
from voodoo.recordings.ros_bag import Bag
from voodoo.recordings.ros_messages import (
    DEPTH_ENCODINGS,
    NO_DISTANCES,
    Message,
    base_topic,
    camera_of,
    channels_of,
    has_distances,
    is_depth,
    stamp_of,
)

TopicChoice: TypeAlias = str | Sequence[str] | None

IMAGE, COMPRESSED = "sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"
CLOUD, SCAN = "sensor_msgs/msg/PointCloud2", "sensor_msgs/msg/LaserScan"
CAMERA_INFO, STRING = "sensor_msgs/msg/CameraInfo", "std_msgs/msg/String"
IMAGES = (IMAGE, COMPRESSED)
MEASURED = (*IMAGES, CLOUD, SCAN)
"""Message types of measurements."""
_TYPES: dict[TopicKind, tuple[str, ...]] = {"depth": IMAGES, "points": (CLOUD,), "scan": (SCAN,), "color": IMAGES}


@dataclass(frozen=True)
class TopicSource:
    """A topic that is read: kind, number of messages, and from its first message the frame id, the
    stamp [s] and a description of the format. `camera` and the topic it came from are set for images."""

    topic: str
    kind: TopicKind
    messages: int
    frame: str
    first_stamp: float
    detail: str
    camera: Camera | None = None
    info_topic: str | None = None


def info_topic(topic: str) -> str:
    """Topic of the calibration of an image topic: its name with the last part replaced."""
    return f"{base_topic(topic).rsplit('/', 1)[0]}/camera_info"


def checked_numbers(where: object, meters_per_unit: float | None, tf_max_age: float) -> tuple[float | None, float]:
    """The numbers given for topics: meters per unit of depth, None if not given, and the largest age of a transform [s].

    Raises:
        RecordingError: one is out of range; `where` begins the message.
    """
    if meters_per_unit is not None:
        meters_per_unit = number_option(where, "meters_per_unit", meters_per_unit)
    return meters_per_unit, number_option(where, "tf_max_age", tf_max_age)


class TopicFinder:
    """Selects topics by type, name and encoding, or as set by the user.

    If several topics of a kind qualify, the user must choose one. Color images beside other kinds are optional: if they are
    ambiguous or not calibrated, they are left out and noted in `unused`. If there are only images, those of all calibrated
    cameras are used: color images, or gray ones if there are no color images.

    Args:
        bag: the bag.
        choices: topics set by the user, by kind.
        camera_info_topic: calibration of the depth image, if it is not beside the image.
    """

    def __init__(self, bag: Bag, *, choices: dict[TopicKind, TopicChoice], camera_info_topic: str | None) -> None:
        """Store the choices."""
        self.bag = bag
        self.unused: list[tuple[str, str]] = []
        self._choices = {
            kind: [names] if isinstance(names, str) else None if names is None else list(names)
            for kind, names in choices.items()
        }
        self._camera_info_topic = camera_info_topic
        self._topics = {topic.name: topic for topic in bag.topics}
        self._first: dict[str, Message] = {}

    def find(self, use: Sequence[TopicKind]) -> list[TopicSource]:
        """Sources of the kinds in `use`; the first one defines the frames.

        Raises:
            RecordingError: nothing usable, an ambiguous choice, a missing calibration or a wrong encoding.
        """
        sources: list[TopicSource] = []
        for kind in (each for each in TOPIC_KINDS if each in use):
            chosen = self._choices[kind] is not None
            if kind == "color" and not chosen and not sources:
                sources += self._cameras()
                continue
            try:
                found = [self._source(name, kind) for name in (self._chosen(kind) if chosen else self._automatic(kind))]
            except RecordingError as error:
                if kind != "color" or chosen:
                    raise
                self.unused.append(("color", str(error)))
            else:
                sources += [source for source in found if chosen or not self._same_as_depth(source, sources)]
        if not sources:
            listing = ", ".join(f"{topic.name} ({topic.type})" for topic in self.bag.topics) or "no topics"
            why = "".join(f"; {topic}: {reason}" for topic, reason in self.unused)
            raise RecordingError(f"{self.bag.path}: expected topics for {', '.join(use)}, found {listing}{why}")
        return sources

    def _chosen(self, kind: TopicKind) -> list[str]:
        names, fit = self._choices[kind] or [], self._of_types(*_TYPES[kind])
        for name in names:
            if name not in fit:
                topic = self._topics.get(name)
                found = "no such topic" if topic is None else f"{topic.messages} messages of type {topic.type}"
                raise RecordingError(
                    f"{self.bag.path}: {kind}_topic {name!r}: expected one of {', '.join(fit) or 'none in this bag'}, "
                    f"found {found}"
                )
        return names

    def _of_types(self, *types: str) -> list[str]:
        """Topics with messages of some types."""
        return [topic.name for topic in self.bag.topics if topic.type in types and topic.messages]

    def _free(self, kind: TopicKind) -> list[str]:
        """Topics of the types of a kind that the user chose for no kind."""
        chosen = {name for names in self._choices.values() for name in names or ()}
        return [name for name in self._of_types(*_TYPES[kind]) if name not in chosen]

    def _automatic(self, kind: TopicKind) -> list[str]:
        names = self._free(kind)
        if kind == "depth":
            names = self._depth_candidates(names)
        elif kind == "color":
            usable = self._pictures(names, channels=3)
            names = [name for name in usable if "color" in name.lower() or "rgb" in name.lower()] or usable
        # image_transport publishes the same image several times; the raw one is used
        bases = {base_topic(name): name for name in sorted(names, key=len, reverse=True)}
        if len(bases) > 1:
            raise RecordingError(
                f"{self.bag.path}: expected one topic for {kind}, found {', '.join(sorted(bases.values()))}; "
                f"choose with {kind}_topic= (--topic {kind}=NAME) or leave it out with use="
            )
        return list(bases.values())

    def _depth_candidates(self, names: list[str]) -> list[str]:
        """Topics of depth by their encoding; if the names of some have "depth", these."""
        usable: list[str] = []
        refused: dict[str, str] = {}
        for name in names:
            named = "depth" in name.lower()
            try:
                message = self._message(name)
            except RecordingError:
                if named:
                    raise
                continue
            compressed = self._topics[name].type == COMPRESSED
            if not is_depth(name, message):
                if named and not compressed and message.encoding not in DEPTH_ENCODINGS:
                    refused[name] = f"encoding {message.encoding!r}"
            elif compressed and not has_distances(message):
                refused[name] = NO_DISTANCES
            else:
                usable.append(name)
        self.unused += [
            (name, words if words == NO_DISTANCES else "not a depth encoding") for name, words in refused.items()
        ]
        if refused and not usable and not (self._of_types(CLOUD, SCAN) and set(refused.values()) == {NO_DISTANCES}):
            found = ", ".join(f"{name}: {words}" for name, words in refused.items())
            raise RecordingError(
                f"{self.bag.path}: expected a depth topic encoded as {', '.join(DEPTH_ENCODINGS)}, found {found}"
            )
        return [name for name in usable if "depth" in name.lower()] or usable

    def _cameras(self) -> list[TopicSource]:
        """Image topics of all cameras, one per camera."""
        names = self._free("color")
        names = self._pictures(names, channels=3) or self._pictures(names, channels=1)
        bases = {base_topic(name): name for name in sorted(names, key=len, reverse=True)}
        found: dict[str, TopicSource] = {}
        for name in sorted(bases.values(), key=natural):
            try:
                source = self._source(name, "color")
            except RecordingError as error:
                self.unused.append((name, str(error)))
                continue
            if source.frame in found:
                self.unused.append((name, f"the camera of {found[source.frame].topic} (frame {source.frame!r})"))
            else:
                found[source.frame] = source
        return list(found.values())

    def _pictures(self, names: list[str], *, channels: int) -> list[str]:
        """Topics with images of at least a number of channels."""
        return [name for name in names if channels_of(name, self._message(name)) >= channels]

    def _same_as_depth(self, source: TopicSource, sources: list[TopicSource]) -> bool:
        """Whether a cloud has the same data as a depth image, which would then have twice its weight."""
        same = source.kind == "points" and any(s.kind == "depth" and s.frame == source.frame for s in sources)
        if same:
            self.unused.append((source.topic, "same frame as the depth image, hence the same points (points_topic=)"))
        return same

    def _source(self, name: str, kind: TopicKind) -> TopicSource:
        topic, message = self._topics[name], self._message(name)
        camera, info = None, None
        with reading(f"{self.bag.path}, topic {name}", f"a {topic.type} message"):
            if kind in ("depth", "color"):
                info, camera = self._calibration(name, kind, self.bag.frame_of(name, message))
                words = message.format if topic.type == COMPRESSED else message.encoding
                detail = f"{camera.width}x{camera.height} {words}"
            elif kind == "points":
                fields = "/".join(field.name for field in message.fields)
                detail = f"cloud of {message.height * message.width} points ({fields})"
            else:
                detail = f"scan of {len(message.ranges)} rays"
            stamp, frame = stamp_of(message, f"{self.bag.path}, topic {name}"), self.bag.frame_of(name, message)
        return TopicSource(name, kind, topic.messages, frame, stamp, detail, camera, info)

    def _calibration(self, name: str, kind: TopicKind, frame: str) -> tuple[str, Camera]:
        """CameraInfo beside the image, or the one chosen for depth."""
        expected = (realsense.info_topic if self.bag.realsense else info_topic)(name)
        if kind == "depth" and self._camera_info_topic is not None:
            expected = self._camera_info_topic
        infos = self._of_types(CAMERA_INFO)
        if expected not in infos:
            raise RecordingError(
                f"{self.bag.path}: expected the calibration of {name} (frame {frame!r}) on {expected}, "
                f"found CameraInfo topics: {', '.join(infos) or 'none'}"
                + (" (choose with camera_info_topic=, --topic camera_info=NAME)" if kind == "depth" else "")
            )
        source = f"{self.bag.path}, topic {expected}"
        camera = camera_of(self._message(expected, lambda info: camera_of(info, name, source)), name, source)
        lens = realsense.beside(name, realsense.LENS)
        if lens in self._of_types(STRING):
            camera = realsense.with_lens(camera, self._message(lens))
        return expected, camera

    def _message(self, name: str, good: Callable[[Message], object] | None = None) -> Message:
        if name not in self._first:
            source = f"{self.bag.path}, topic {name}"
            stamped = self._topics[name].type not in (CAMERA_INFO, STRING)
            self._first[name] = self.bag.first(
                name, good=good or ((lambda message: stamp_of(message, source)) if stamped else None)
            )
        return self._first[name]
