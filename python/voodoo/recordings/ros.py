"""ROS 1 and ROS 2 bags as recordings."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property, partial
from pathlib import Path

from voodoo.errors import RecordingError, reading
from voodoo.measurements import FloatArray, Measurement, RecordedFrame
from voodoo.names import TOPIC_KINDS, TopicKind
from voodoo.recordings import realsense
from voodoo.recordings.empty_scene import EmptyScene
from voodoo.recordings.left_out import LeftOut, leave_out, leaving_out
from voodoo.recordings.recording import Recording, SensorInfo, mean_rate, number_option, usable
from voodoo.recordings.ros_bag import TF_TYPES, Bag
from voodoo.recordings.ros_messages import Message, camera_of, depth_units, measured, stamp_of
from voodoo.recordings.ros_topics import TopicChoice, TopicFinder, TopicSource, checked_numbers
from voodoo.recordings.set_back import SetBack, out_of_order
from voodoo.recordings.together import in_turn, together
from voodoo.recordings.transforms import TransformTree, matrix
from voodoo.recordings.truth import OWN_ROOTS, STILL_FRAMES, find_beside, read_beside


class RosRecording(Recording):
    """A ROS bag: depth images, clouds, laser scans and color images in one root frame.

    There is one frame for each depth image (without depth: for each cloud, else each scan, else each image of the first
    camera); it also holds the measurements recorded since the previous frame. If there are only color images, those of all
    cameras are used, and a frame holds those within half an interval of the first camera's. Measurements after the last frame
    are not yielded. Stamps are header stamps in seconds; double precision keeps them to about 0.2 microseconds. Messages are read
    while iterating and color is decoded on access. A truncated bag is an error (`ros2 bag reindex` or `mcap recover`
    repair it), as is one whose index differs from its messages.

    truth.csv, truth_people.csv and init.json in the bag's folder or the one above become `reference`, `people` and `start`,
    unless `bare`. Their positions are in base_link, or else world, or else the first sensor's frame, or in the frame
    named by the key `frame` of init.json. Images in `background/` in the bag's folder or the one above are the `empty_scene`.

    A .bag of librealsense's recorder has no ROS frames: each stream is a frame ("Depth_0").

    Args:
        path: see voodoo.recordings.ros_bag.Bag.
        use: kinds of measurements to yield.
        depth_topic, points_topic, scan_topic, color_topic: one topic or several, instead of the one selected by type
            and name. The first one of the first kind defines the frames.
        camera_info_topic: calibration of the depth image, by default `camera_info` beside it.
        root_frame: by default odom, else map, if base_link moves in it; else base_link, else world, if the transforms of
            the bag have it; else the frame of the first sensor.
        meters_per_unit: of depth images; None: of 16-bit ones the value in a bag of librealsense's recorder, else 0.001, and of
            float ones 1.
        tf_max_age: maximum age of a changing transform [s].
        background: folder of images of the empty scene, instead of the one beside the bag.
        unpacked_gb: largest size of an unpacked archive, chunk or message [GB]; None: 2, and 200 times the size of the file.
        bare: read neither reference nor start.
        left_out: counts unusable measurements, which are then left out; None: they are errors.

    Raises:
        RecordingError: the bag is damaged, or calibration, transforms or usable topics are missing.
    """

    def __init__(
        self,
        path: Path,
        *,
        use: Sequence[TopicKind] = TOPIC_KINDS,
        depth_topic: TopicChoice = None,
        points_topic: TopicChoice = None,
        scan_topic: TopicChoice = None,
        color_topic: TopicChoice = None,
        camera_info_topic: str | None = None,
        root_frame: str | None = None,
        meters_per_unit: float | None = None,
        tf_max_age: float = 0.5,
        background: str | Path | None = None,
        unpacked_gb: float | None = None,
        bare: bool = False,
        left_out: LeftOut | None = None,
    ) -> None:
        """Read topics and transforms; see the class."""
        if isinstance(use, str) or not use or not set(use) <= set(TOPIC_KINDS):
            raise RecordingError(f"use: expected a tuple of some of {', '.join(TOPIC_KINDS)}, found {use!r}")
        self.path = path
        unit, max_age = checked_numbers(path, meters_per_unit, tf_max_age)
        self._left_out = left_out
        if unpacked_gb is not None:
            unpacked_gb = number_option(path, "unpacked_gb", unpacked_gb)
        self.numbers: dict[tuple[str, float], int] = {}
        self._bag = Bag(path, left_out=left_out, unpacked=None if unpacked_gb is None else int(unpacked_gb * 1e9))
        self.loader = "ros2" if self._bag.is_ros2 else "ros1"
        choices = dict(zip(TOPIC_KINDS, (depth_topic, points_topic, scan_topic, color_topic), strict=True))
        finder = TopicFinder(self._bag, choices=choices, camera_info_topic=camera_info_topic)
        with self._bag.kept_open():
            sources = finder.find(use)
            self._unused = finder.unused
            whole, self._float_unit = depth_units(unit)
            self._units = {s.topic: whole if unit else self._unit(s.topic, whole) for s in sources}
            self._set_back = SetBack()
            self._tree = TransformTree(path, max_age=max_age, set_back=self._set_back)
            self.root_frame = self._read_transforms(root_frame, sources)
        self._driver = sources[0]
        self._sources = {s.topic: s for s in sources if self._connected(s, optional=color_topic is None)}
        self.complete = self._driver.kind == "color" and len(sources) > 1
        if self.complete:
            self._check_together(sources)

        place = path if path.suffix.lower() == ".zip" else self._bag.file
        self.name = next(part for part in (place.stem, *(p.name for p in place.resolve().parents)) if part != "bag")
        if not bare:
            find, first = partial(find_beside, place), self._driver.first_stamp
            read_beside(self, find, root=self._own_root, first=first, left_out=left_out)
        cameras = {
            s.topic: (s.camera, (*s.topic.strip("/").split("/"), s.frame, s.frame.removesuffix("_optical_frame")))
            for s in self._sources.values()
            if s.kind == "color" and s.camera is not None
        }
        self._scene = EmptyScene(place, background, cameras)

    def __len__(self) -> int:
        """Number of messages on the topic that defines the frames."""
        return self._driver.messages

    def __iter__(self) -> Iterator[RecordedFrame]:
        """Read the bag; see Recording."""
        return (together if self.complete else in_turn)(self._measurements(), self._driver.topic)

    def _measurements(self) -> Iterator[Measurement]:
        """All used measurements, in the order of recording."""
        infos = {source.info_topic for source in self._sources.values() if source.info_topic is not None}
        last: dict[str, float] = {}
        clock = SetBack(self._set_back)
        numbers = dict.fromkeys(self._sources, -1)
        for topic, message in self._bag.read([*self._sources, *infos]):
            if topic in infos:
                if message is not None:
                    self._check_calibration(topic, message)
                continue
            numbers[topic] += 1
            make = partial(self._measured, topic, message, last, clock)
            where = f"{self.path}, topic {topic}"
            if message is not None and (item := usable(make, numbers[topic], where, self._left_out, self.numbers)):
                last[topic] = item.stamp
                if self._left_out is not None:
                    self._left_out.notes |= dict.fromkeys(clock.words)
                yield item

    def _measured(self, topic: str, message: Message, last: dict[str, float], clock: SetBack) -> Measurement:
        """The measurement of a message that is not older than the `last` of its topic."""
        where = f"{self.path}, topic {topic}"
        with reading(where, "a readable message"):
            written = stamp_of(message, where)
            moved = written if self._left_out is None else clock.of(topic, written)
            stamp = written if moved is None else moved
            before = last.get(topic, -math.inf)
            if moved is None or stamp < before or (stamp == before and self._left_out is not None):
                raise out_of_order(where, stamp, before)
            source = self._sources[topic]
            pose = self._tree.lookup(self.root_frame, self._bag.frame_of(topic, message), stamp)
            units, named = (self._units[topic], self._float_unit), f"{where}, stamp {stamp:.6f}"
            return measured(source.kind, message, named, (topic, stamp), pose, source.camera, units)

    @cached_property
    def _ends(self) -> dict[str, tuple[float, float]]:
        """Stamps of the first and the last message of every topic in use."""
        ends = {}
        with self._bag.kept_open():
            for source in self._sources.values():
                where, last = f"{self.path}, topic {source.topic}", self._bag.last(source.topic)
                with reading(where, "a readable message"):
                    ends[source.topic] = source.first_stamp, stamp_of(last, where)
        return ends

    def _span(self) -> tuple[float, float]:
        return self._ends[self._driver.topic]

    def _sensors(self) -> Iterator[SensorInfo]:
        for source in self._sources.values():
            first, end = self._ends[source.topic]
            rate = mean_rate(source.messages, end - first)
            yield SensorInfo(source.topic, source.kind, source.frame, source.messages, rate, source.detail)

    def _unit(self, topic: str, otherwise: float) -> float:
        """Scale of 16-bit depth in meters: the value of librealsense's recorder, if there is one."""
        units = realsense.beside(topic, realsense.UNITS)
        if all(item.name != units for item in self._bag.topics):
            return otherwise
        where = f"{self.path}, topic {units}"
        with reading(where, "a readable message"):
            return number_option(where, "meters_per_unit", float(f"{float(self._bag.first(str(units)).data):.7g}"))

    def _read_transforms(self, asked: str | None, sources: Sequence[TopicSource]) -> str:
        """Fill the transform tree and choose the root frame."""
        self._read_recorders_transforms()
        names = [t.name for t in self._bag.topics if t.type in TF_TYPES and t.messages]
        static = [name for name in names if name.endswith("tf_static")]
        dynamic = [name for name in names if name not in static]
        for topics, is_static in ((static, True), (dynamic, False)):
            for _, message in self._bag.read(topics):
                unread = leaving_out(self._left_out, "transforms that cannot be read")
                with unread, reading(self.path, "a readable transform"):
                    if message is not None:
                        self._tree.add(message, static=is_static)
        known = {*self._tree.frames, *(source.frame for source in sources)}
        self._own_root = next((name for name in OWN_ROOTS if name in known), sources[0].frame)
        if asked is not None:
            return asked
        if self._own_root != OWN_ROOTS[0]:
            return self._own_root
        # For a moving robot, persons and rooms are static in the frame in which the robot moves.
        moving = [frame for frame in STILL_FRAMES if self._tree.moves(frame, self._own_root)]
        return next(
            (frame for frame in moving if all(self._tree.reaches(frame, s.frame) for s in sources)), self._own_root
        )

    def _read_recorders_transforms(self) -> None:
        """Read the transforms of librealsense's recorder: the pose of each stream relative to the common reference."""
        for topic in self._bag.topics if self._bag.realsense else ():
            frames = realsense.transform_of(topic.name)
            if frames is not None and topic.messages:
                pose = self._bag.first(topic.name)
                where = f"{self.path}, topic {topic.name}"
                with reading(where, "a readable transform"):
                    stream_from_reference = matrix(pose.translation, pose.rotation, where)
                self._tree.add_edge(*frames, 0.0, stream_from_reference, static=True)

    def _check_together(self, sources: Sequence[TopicSource]) -> None:
        """Reject images of several cameras whose relative poses are unknown; report what is left out."""
        if len(self._sources) == 1:
            raise RecordingError(
                f"{self.path}: expected transforms between the cameras on tf or tf_static, found none between "
                f"{' and '.join(repr(source.frame) for source in sources)}; one camera alone is chosen with color_topic= "
                "(--topic color=NAME)"
            )
        left = [topic for topic, _ in self._unused]
        if left:
            self.assumed = (*self.assumed, f"not used: {', '.join(left)}; voodoo info says why")

    def _connected(self, source: TopicSource, *, optional: bool) -> bool:
        optional = optional and source.kind == "color" and source is not self._driver
        if optional and not self._tree.reaches(self.root_frame, source.frame):
            self._unused = (*self._unused, (source.topic, f"no transform {self.root_frame!r} from {source.frame!r}"))
            return False
        self._tree.path(self.root_frame, source.frame)
        return True

    def root_from(self, frame: str, stamp: float) -> FloatArray:
        """See Recording."""
        return self._tree.lookup(self.root_frame, frame, stamp)

    def _check_calibration(self, topic: str, message: Message) -> None:
        for source in self._sources.values():
            if source.info_topic == topic:
                where = f"{self.path}, topic {topic}"
                with leaving_out(self._left_out, "calibrations that cannot be used"):
                    camera = camera_of(message, source.topic, where)
                    if source.camera is not None and source.camera.model == "inverse_plumb_bob":
                        camera = replace(camera, model="inverse_plumb_bob")
                    if camera != source.camera:
                        words = f"{where}: expected one calibration, found {camera} after {source.camera}"
                        leave_out(self._left_out, RecordingError(words), "calibrations unlike the first")
