"""ROS 2 topics as a live source, and a list of them for those who do not know the name of theirs."""

from __future__ import annotations

import time
from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

from voodoo.errors import VoodooError
from voodoo.export.ros2 import TF
from voodoo.live.clock import Clock, HostClock
from voodoo.live.ros2.dds import Node, Offer, Subscription
from voodoo.live.ros2.feed import RosFeed
from voodoo.live.source import Arrival, Faults, Source, SourceGone
from voodoo.recordings.camera_files import read_calibration
from voodoo.recordings.ros_topics import CAMERA_INFO, IMAGES, MEASURED, checked_numbers, info_topic

_DISCOVERY_S, _LISTEN_S, _POLL_S = 3.0, 2.0, 0.05
_DEPTH, _TF_DEPTH = 30, 100
"""Queue length for a busy machine. Messages dropped from it are counted; those lost before it are not."""


class Ros2Source(RosFeed, Source):
    """Depth or color images (raw, compressed), clouds and scans of ROS 2 topics, with CameraInfo and transforms.

    Args:
        topics: topics of the measurements; the first one defines the frames.
        root_frame, meters_per_unit: see RosFeed.
        calibration: a calibration.toml with the pose of the first topic's camera, instead of transforms.
        tf_max_age: largest age of a changing transform [s].

    Raises:
        VoodooError: no topics, or a number out of range.
    """

    def __init__(
        self, topics: Sequence[str], *, root_frame: str | None = None, calibration: Path | None = None,
        meters_per_unit: float | None = None, tf_max_age: float = 0.5,
    ) -> None:  # fmt: skip
        """Nothing is subscribed yet."""
        if not topics:
            raise VoodooError("ros2: expected ros2:TOPIC[,TOPIC...], found no topic")
        place = None if calibration is None else read_calibration(calibration)
        pose = None if place is None else (place.root_frame, place.depth.world_from_sensor)
        named = [topic if topic.startswith("/") else f"/{topic}" for topic in topics]
        self.name = f"ros2:{named[0]}"
        unit, age = checked_numbers(self.name, meters_per_unit, tf_max_age)
        how: dict[str, Any] = {"meters_per_unit": unit, "tf_max_age": age, "sensor_pose": pose}
        super().__init__(named, Faults(), HostClock(), root_frame=root_frame, **how)
        self._subscriptions: dict[str, Subscription] = {}
        self._gone = False

    @cached_property
    def _node(self) -> Node:
        return Node()

    def open(self, clock: Clock, faults: Faults) -> None:
        """See Source."""
        self.faults, self.clock = faults, clock
        self._subscribe("/tf", Offer(TF, reliable=True, latched=False), _TF_DEPTH)
        self._subscribe("/tf_static", Offer(TF, reliable=True, latched=True), _TF_DEPTH)
        until = time.monotonic() + _DISCOVERY_S
        while not self._discover():
            if time.monotonic() > until:
                there = [topic for topic, offer in self._node.offers().items() if offer.kind in MEASURED]
                raise SourceGone(
                    f"{self._topics[0]}: expected somebody who publishes it, found nobody yet; "
                    f"published are {', '.join(sorted(there)) or 'no images, clouds or scans'}"
                )
            self._node.wait(_POLL_S)

    def _discover(self) -> bool:
        """Subscribe to the topics offered so far; returns whether all are."""
        offers = self._node.offers()
        self.expects_transforms = bool({"/tf", "/tf_static"} & offers.keys())
        for topic in self._topics:
            offer = offers.get(topic)
            if offer is None or topic in self._subscriptions:
                continue
            if offer.kind not in MEASURED:
                raise VoodooError(
                    f"{topic}: expected one of {', '.join(MEASURED)}, found {offer.kind or 'no ROS type'}"
                )
            if offer.kind in IMAGES:
                info = info_topic(topic)
                offered = offers.get(info, Offer(CAMERA_INFO, reliable=False, latched=False))
                self._subscribe(info, Offer(CAMERA_INFO, offered.reliable, offered.latched), _DEPTH)
            self._subscribe(topic, offer, _DEPTH)
        return self._topics[0] in self._subscriptions

    def _subscribe(self, topic: str, offer: Offer, depth: int) -> None:
        if topic not in self._subscriptions:
            self._subscriptions[topic] = self._node.subscribe(topic, offer, depth=depth)

    def read(self, timeout: float) -> Sequence[Arrival]:
        """See Source."""
        self._node.wait(timeout)
        arrivals: list[Arrival] = []
        # Transforms and calibrations first, because images wait for them.
        for subscription in sorted(self._subscriptions.values(), key=lambda one: one.kind in MEASURED):
            for raw in subscription.take():
                arrivals += self.take(subscription.topic, subscription.kind, raw)
        lost = self._subscriptions[self._topics[0]].lost()
        if lost:
            self.faults.add("lost on the way", f"{self._topics[0]}: messages did not arrive", self.clock.now(), lost)
        if not arrivals:
            self._check_states()
        return arrivals

    def _check_states(self) -> None:
        """Report once that there are no publishers any more, and search for topics that are offered later."""
        self._discover()
        gone = self._subscriptions[self._topics[0]].publishers == 0
        if gone and not self._gone:
            self.faults.add("gone", f"{self._topics[0]}: nobody publishes it any more", self.clock.now())
        elif self._gone and not gone:
            self.faults.log(f"{self.name}: it is there again")
        self._gone = gone

    def about(self) -> dict[str, Any]:
        """See Source."""
        return {"name": self.name, "kind": "ros2", "topics": list(self._topics), "root_frame": self.root_frame}


def listing(node: Node | None = None, *, seconds: float = _LISTEN_S) -> list[str]:
    """A line for each topic that is published: name, type, and rate of those that voodoo reads.

    Args:
        node: None: one of its own.
        seconds: how long messages are counted [s].

    Raises:
        VoodooError: see Node.
    """
    node = Node() if node is None else node
    found = time.monotonic() + _DISCOVERY_S
    while not node.offers() and time.monotonic() < found:
        time.sleep(_POLL_S)
    offers = node.offers()
    read = {topic: offer for topic, offer in offers.items() if offer.kind in (*MEASURED, CAMERA_INFO, TF)}
    subscriptions = {topic: node.subscribe(topic, offer, depth=100) for topic, offer in read.items()}
    counts, began = dict.fromkeys(read, 0), time.monotonic()
    while (waited := time.monotonic() - began) < seconds:
        node.wait(_POLL_S)
        for topic, subscription in subscriptions.items():
            counts[topic] += len(subscription.take())
    lines = []
    for topic, offer in sorted(offers.items(), key=lambda item: (item[1].kind not in MEASURED, item[0])):
        rate = f"  {counts[topic] / waited:.1f} Hz" if topic in counts else ""
        lines.append(f"{topic}  {offer.kind or 'no ROS type'}{rate}")
    return lines
