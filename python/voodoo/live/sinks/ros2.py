"""Publishes poses on ROS 2: transforms, joint states, markers, and the list of tracked persons, with names of REP-155."""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from voodoo.errors import VoodooError
from voodoo.export.human_frames import placed_names
from voodoo.export.ros2 import (
    BODIES,
    IDS,
    JOINTS,
    POSE,
    STORE,
    STRING,
    TF,
    TRACKED,
    cdr,
    description,
    instant,
    joint_message,
    person_id,
    pose_message,
    root_on_parent,
    tracked,
    transforms_message,
)
from voodoo.export.template import STAMP_NS, Template
from voodoo.live.follow import Step
from voodoo.live.ros2.dds import Node, Offer, Publication
from voodoo.live.session import Output
from voodoo.live.sinks.people import Shown, shown
from voodoo.measurements import FloatArray
from voodoo.model.body import Body
from voodoo.pipeline.front_end import nobody

ADDRESS = "ros2://"
RESET, FOLLOW = "/voodoo/reset", "/voodoo/follow"
_PLACE, _MARKERS = "geometry_msgs/msg/PointStamped", "visualization_msgs/msg/MarkerArray"
_OTHER_SIZE = 0.01
"""A body whose limbs' lengths changed by this fraction together is described again."""


class Ros2Sink(Output):
    """`/tf`, `/humans/bodies/<id>/joint_states`, `.../pose`, `.../markers`, `/human_description_<id>` (URDF), and
    `/humans/bodies/tracked` (hri_msgs/IdsList).

    Markers are made while somebody subscribes to them. Stamps are those of the data. Persons that are lost or searched for are
    not listed as tracked and have no transforms. A message on RESET (std_msgs/Empty) lets everybody be searched for again; one on
    FOLLOW (geometry_msgs/PointStamped) lets only the person at that place be followed.

    Args:
        address: ros2://; the network is that of the environment.
        root_frame: see `Sink`.
        on_message: see `Sink`.
        node: None: one of its own.

    Raises:
        VoodooError: another address, no network, or cyclonedds is not installed.
    """

    name = "ros2"
    prompt = receiver = True

    def __init__(
        self,
        address: str = ADDRESS,
        *,
        root_frame: Callable[[], str],
        on_message: Callable[[str], None] = print,
        node: Node | None = None,
    ) -> None:
        """Join the network."""
        if address != ADDRESS:
            raise VoodooError(
                f"{address}: expected {ADDRESS} without a host, found one; ROS_DOMAIN_ID chooses the network"
            )
        self._root = root_frame
        self._node = Node(quiet=True) if node is None else node
        self._topics: dict[str, Publication] = {}
        self._displayed: set[int] = set()
        self._bodies: dict[int, Body] = {}
        self._described: dict[int, float] = {}
        self._templates: dict[str, tuple[object, Template]] = {}
        self._resets = self._node.subscribe(RESET, Offer("std_msgs/msg/Empty", reliable=False, latched=False))
        self._follows = self._node.subscribe(FOLLOW, Offer(_PLACE, reliable=False, latched=False))
        self._publish_on("/tf", TF, 100)
        self._publish_on(TRACKED, IDS, 1)
        for name, kind in (("joint_states", JOINTS), ("pose", POSE), ("markers", _MARKERS)):
            # Subscribers can discover these topics before the first pose.
            self._publish_on(f"{BODIES}/{person_id(1)}/{name}", kind)

    def publish(self, step: Step) -> None:
        """See Output."""
        if self._resets.take() and self.on_reset is not None:
            self.on_reset()
        for raw in self._follows.take():
            chosen: Any = STORE.deserialize_cdr(raw, _PLACE)
            if self.on_choice is not None:
                self.on_choice(chosen.header.frame_id, np.array([chosen.point.x, chosen.point.y, chosen.point.z]))
        people = shown(step, self._root())
        observed = set() if people is None else {people.numbers[index] for index in people.present}
        if people is not None and observed:
            self._write_people(people)
        for number in self._displayed | observed:
            # They take as long as everything else together; those of persons who left are deleted once.
            topic = f"{BODIES}/{person_id(number)}/markers"
            if self._publish_on(topic, _MARKERS).subscribers:
                estimate = step.estimates[number] if number in observed else nobody(step.stamp)
                how: Any = {"root_frame": self._root(), "person": person_id(number), "turn": step.turn}
                made = instant(estimate, step.bodies.get(number) or self._bodies[number], **how)
                self._write({topic: made[topic]})
        self._displayed = observed
        self._bodies = {number: step.bodies[number] for number in observed}
        ids = [person_id(number) for number in sorted(observed)]
        self._write(tracked(step.stamp, ids, root_frame=self._root()))

    def _write_people(self, people: Shown) -> None:
        there, frame, (names, parents, *_) = people.present, people.frame, people.frames
        ids = tuple(person_id(people.numbers[index]) for index in there)
        above = () if frame == self._root() else ((self._root(), frame, root_on_parent(people.turn.pose)),)

        def transforms(numbers: list[float]) -> Any:  # noqa: ANN401
            placed = [row for person in ids for row in placed_names(names, parents, person, frame)]
            rows = [(*row, numbers[7 * index : 7 * index + 7]) for index, row in enumerate(placed)]
            return transforms_message(STAMP_NS, [*above, *rows])

        self._send("/tf", TF, people.stamp, (ids, frame, repr(above)), lambda: people.on_parents[there], transforms)
        for index, person in zip(there.tolist(), ids, strict=True):
            self._write_person(people, index, person)
        for index, person in zip(there.tolist(), ids, strict=True):  # last: it takes milliseconds
            number, body = people.numbers[index], people.bodies[index]
            size = float(body.core.sizes()[:, 0].sum())
            if abs(self._described.get(number, 0.0) - size) > _OTHER_SIZE * size:
                self._write(description(body, person))
                self._described[number] = size

    def _write_person(self, people: Shown, index: int, person: str) -> None:
        topic, sure = f"{BODIES}/{person}", people.covariances[index]
        self._send(
            *(f"{topic}/joint_states", JOINTS, people.stamp, person),
            lambda: people.angles[1][index],
            lambda angles: joint_message(STAMP_NS, person, people.angles[0], angles),
        )
        if np.isfinite(sure).all():
            self._send(
                *(f"{topic}/pose", POSE, people.stamp, people.frame),
                lambda: np.concatenate([people.on_parents[index, 0], sure.ravel()]),
                lambda numbers: pose_message(STAMP_NS, people.frame, numbers[:7], numbers[7:]),
            )

    def _send(
        self,
        topic: str,
        kind: str,
        stamp: float,
        key: object,
        numbers: Callable[[], FloatArray],
        message: Callable[[list[float]], Any],
    ) -> None:
        """Publish a message, which is made again when its key changes, with numbers at a time, if somebody subscribes."""
        publication = self._publish_on(topic, kind)
        if publication.subscribers:
            values = numbers().ravel()
            key = key, len(values)
            if self._templates.get(topic, (None,))[0] != key:
                made = Template(lambda found: cdr(message(found)), len(values), kind="<f8", stamp=_stamp(STAMP_NS))
                self._templates[topic] = key, made
            publication.write(self._templates[topic][1].filled(values, _stamp(round(stamp * 1e9))))

    def _publish_on(self, topic: str, kind: str, depth: int = 10) -> Publication:
        if topic not in self._topics:
            STORE.get_msgdef(kind)
            self._topics[topic] = self._node.advertise(topic, kind, depth=depth, latched=kind == STRING)
        return self._topics[topic]

    def _write(self, messages: Mapping[str, Any]) -> None:
        for topic, message in messages.items():
            kind = message.__msgtype__
            self._publish_on(topic, kind, 1 if kind == STRING else 10).write(cdr(message))


def _stamp(nanoseconds: int) -> bytes:
    """A stamp in CDR."""
    return struct.pack("<iI", *divmod(nanoseconds, 1_000_000_000))
