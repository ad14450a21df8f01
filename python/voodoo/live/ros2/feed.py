"""Converts messages of ROS 2 topics to arrivals; independent of the network."""

from __future__ import annotations

import math
import threading
from collections.abc import Sequence
from functools import partial

from voodoo.errors import RecordingError, reading
from voodoo.export.ros2 import STORE, TF
from voodoo.live.clock import Clock
from voodoo.live.source import Arrival, Faults, faulty
from voodoo.measurements import FloatArray, Measurement
from voodoo.model.camera import Camera
from voodoo.recordings.ros_messages import (
    COLOR_CHANNELS,
    DEPTH_ENCODINGS,
    Message,
    camera_of,
    depth_units,
    frame_of,
    is_depth,
    measured,
    seconds,
    stamp_of,
)
from voodoo.recordings.ros_topics import CAMERA_INFO, CLOUD, COMPRESSED, IMAGES, MEASURED, SCAN, info_topic
from voodoo.recordings.set_back import BACK_S
from voodoo.recordings.transforms import TransformTree
from voodoo.recordings.truth import OWN_ROOTS, STILL_FRAMES

STANDING = (*STILL_FRAMES, *OWN_ROOTS)
"""Root frames, best first: the first two are fixed to the room while a robot moves."""
_KEPT_S = 10.0
_TF_PATIENCE_S = 0.05
ROOT_PATIENCE_S = 1.0
"""How long the first frame waits for a chain of transforms to one of STANDING."""


class RosFeed:
    """Turns messages into arrivals.

    Args:
        topics: topics of the measurements; the first one defines the frames.
        faults: counts unusable messages.
        clock: host clock.
        root_frame: None: the best of STANDING that transforms lead to, else the frame of the first topic.
        meters_per_unit: scale of depth; None: 0.001 of 16-bit images, 1 of float ones.
        tf_max_age: largest age of a changing transform [s].
        sensor_pose: root_from_sensor (4, 4) of the first topic instead of transforms, and the name of that root frame.

    Attributes:
        unusable: messages of the first topic that could not become an arrival.
        expects_transforms: transforms are published; earlier messages wait for them for ROOT_PATIENCE_S, then they are used.
    """

    def __init__(
        self,
        topics: Sequence[str],
        faults: Faults,
        clock: Clock,
        *,
        root_frame: str | None = None,
        meters_per_unit: float | None = None,
        tf_max_age: float = 0.5,
        sensor_pose: tuple[str, FloatArray] | None = None,
    ) -> None:
        """Start without messages."""
        self.unusable = 0
        self._topics, self.faults, self.clock = tuple(topics), faults, clock
        self._units = depth_units(meters_per_unit)
        self._pose = sensor_pose
        self._tree = TransformTree("tf", max_age=tf_max_age)
        self._lock = threading.Lock()  # transforms arrive in one thread and are read in another
        self._newest = -math.inf
        self._root = root_frame if sensor_pose is None else sensor_pose[0]
        self._since: float | None = None
        self._cameras: dict[str, Camera] = {}
        self.expects_transforms = True
        for kind in (*MEASURED, CAMERA_INFO, TF):
            STORE.get_msgdef(kind)  # otherwise the first message of a type takes tens of milliseconds

    @property
    def root_frame(self) -> str:
        """The target frame of `root_from_sensor`; "" until it is known."""
        return self._root or ""

    def root_from(self, frame: str, stamp: float) -> FloatArray:
        """root_from_frame (4, 4) at a time [s].

        Raises:
            RecordingError: no chain of transforms, or none near that time.
        """
        with self._lock:
            return self._tree.lookup(self.root_frame, frame, stamp)

    def take(self, topic: str, kind: str, raw: bytes) -> list[Arrival]:
        """Process a message.

        Args:
            topic: topic of the message.
            kind: its type, e.g. "sensor_msgs/msg/Image".
            raw: as it was sent (CDR, with its header of four bytes).
        """
        now = self.clock.now()
        try:
            with reading(topic, f"a {kind} message"):
                message = STORE.deserialize_cdr(raw, kind)
            if kind == TF:
                with self._lock:
                    self._take_transforms(message, static=topic.endswith("tf_static"))
            elif kind == CAMERA_INFO:
                self._take_calibration(topic, message)
            elif topic in self._topics and kind in MEASURED:
                if self._knows_root(topic, message, now):
                    return [self._arrival(topic, kind, message)]
                self.unusable += topic == self._topics[0]
        except RecordingError as error:
            self.unusable += topic == self._topics[0]
            self.faults.add_error(error, now, "unreadable message")
        return []

    def _take_transforms(self, message: Message, *, static: bool) -> None:
        for item in message.transforms:
            stamp = seconds(item.header.stamp)
            if not static:
                if stamp < self._newest - BACK_S:
                    self._tree.keep(stamp - _KEPT_S, stamp)  # later transforms are in the future
                    self._newest = stamp
                self._newest = max(self._newest, stamp)
            try:
                with reading("tf", "a transform"):  # each alone, so that an invalid one does not affect the others
                    self._tree.add(STORE.types[TF](transforms=[item]), static=static)
            except RecordingError as error:
                self.faults.add("transform unusable", error, self.clock.now())
        if not static:
            self._tree.keep(self._newest - _KEPT_S, math.inf)

    def _take_calibration(self, topic: str, message: Message) -> None:
        for image in self._topics:
            if info_topic(image) != topic:
                continue
            try:
                with faulty("calibration unusable"):
                    self._cameras[image] = camera_of(message, image, topic)
            except RecordingError:
                self._cameras.pop(image, None)
                raise

    def _arrival(self, topic: str, kind: str, message: Message) -> Arrival:
        stamp = stamp_of(message, topic)
        sensed = _measured_as(topic, kind, message)
        drives, frame = topic == self._topics[0], frame_of(message)
        measure = partial(self._measure, topic, kind, sensed, message, stamp, frame)
        ready = partial(self._is_ready, frame, stamp)
        return Arrival(topic, sensed, stamp, measure, drives, ready=ready, patience=_TF_PATIENCE_S)

    def _is_ready(self, frame: str, stamp: float) -> bool:
        if self._pose is not None or self.root_frame == frame:
            return True
        with self._lock:
            return self._tree.covers(self.root_frame, frame, stamp)

    def _knows_root(self, topic: str, message: Message, now: float) -> bool:
        """Choose the root frame if possible; until then no measurements are made."""
        if self._root is not None:
            return True
        if topic != self._topics[0]:
            return False
        frame = frame_of(message)
        self._since = now if self._since is None else self._since
        reached = [root for root in STANDING if root in self._tree.frames and self._tree.reaches(root, frame)]
        if not reached and self.expects_transforms and now - self._since < ROOT_PATIENCE_S:
            return False
        self._root = next(iter(reached), frame)
        self.faults.log(f"root frame {self._root!r}")
        return True

    def _root_from_sensor(self, topic: str, frame: str, stamp: float) -> FloatArray:
        if self._pose is not None and topic == self._topics[0]:
            return self._pose[1]
        with faulty("transform missing", f"{topic}, stamp {stamp:.6f}: "):
            return self.root_from(frame, stamp)

    def _measure(self, topic: str, kind: str, sensed: str, message: Message, stamp: float, frame: str) -> Measurement:
        where = f"{topic}, stamp {stamp:.6f}"
        pose = self._root_from_sensor(topic, frame, stamp)
        camera = self._cameras.get(topic)
        if camera is None and kind in IMAGES:
            expected = f"a calibration on {info_topic(topic)}"
            raise RecordingError(f"{where}: expected {expected}, found none", reason="calibration missing")
        with faulty("damaged picture" if kind == COMPRESSED else _cut(message)):
            return measured(sensed, message, where, (topic, stamp), pose, camera, self._units)


def _measured_as(topic: str, kind: str, message: Message) -> str:
    """Kind of measurement of a message: "depth", "color", "points" or "scan".

    Raises:
        RecordingError: an image of neither depth nor color.
    """
    if kind in (CLOUD, SCAN):
        return "points" if kind == CLOUD else "scan"
    if kind == COMPRESSED:
        return "depth" if is_depth(topic, message) else "color"
    if message.encoding in DEPTH_ENCODINGS:
        return "depth"
    if message.encoding in COLOR_CHANNELS:
        return "color"
    known = ", ".join((*DEPTH_ENCODINGS, *COLOR_CHANNELS))
    raise RecordingError(f"{topic}: expected one of {known}, found {message.encoding!r}", reason="unknown encoding")


def _cut(message: Message) -> str:
    """The fault of a message that cannot be read: it may have fewer bytes than its fields announce."""
    row = int(getattr(message, "row_step", 0)) or int(getattr(message, "step", 0))
    return "half a message" if row and len(message.data) < row * int(message.height) else "unreadable message"
