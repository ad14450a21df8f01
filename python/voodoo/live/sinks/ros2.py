"""Publishes poses on ROS 2: transforms, joint states, markers, and the list of tracked persons, with names of REP-155."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from voodoo._core import Estimate
from voodoo.errors import VoodooError
from voodoo.export.ros2 import BODIES, IDS, STORE, STRING, TRACKED, description, instant, person_id, tracked
from voodoo.export.skeleton import Skeleton
from voodoo.export.track import Track
from voodoo.export.upright import Turn
from voodoo.live.follow import Step
from voodoo.live.ros2.dds import Node, Offer, Publication
from voodoo.live.session import Output
from voodoo.live.sinks.people import upright_person
from voodoo.model.body import Body
from voodoo.pipeline.search import nobody

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
        self._resets = self._node.subscribe(RESET, Offer("std_msgs/msg/Empty", reliable=False, latched=False))
        self._follows = self._node.subscribe(FOLLOW, Offer(_PLACE, reliable=False, latched=False))
        self._publish_on("/tf", "tf2_msgs/msg/TFMessage", 100)
        self._publish_on(TRACKED, IDS, 1)
        # Subscribers can discover these topics before the first pose.
        self._publish_on(f"{BODIES}/{person_id(1)}/joint_states", "sensor_msgs/msg/JointState", 10)
        self._publish_on(f"{BODIES}/{person_id(1)}/pose", "geometry_msgs/msg/PoseWithCovarianceStamped", 10)
        self._publish_on(f"{BODIES}/{person_id(1)}/markers", _MARKERS, 10)

    def publish(self, step: Step) -> None:
        """See Output."""
        if self._resets.take() and self.on_reset is not None:
            self.on_reset()
        for raw in self._follows.take():
            chosen: Any = STORE.deserialize_cdr(raw, _PLACE)
            if self.on_choice is not None:
                self.on_choice(chosen.header.frame_id, np.array([chosen.point.x, chosen.point.y, chosen.point.z]))
        observed = {number for number, one in step.estimates.items() if one.joints and str(one.status) != "lost"}
        for number in sorted(observed):
            posed = upright_person(step, number, self._root())
            self._write_person(number, step.estimates[number], step.bodies[number], step.turn, posed)
        for number in sorted(self._displayed - observed):
            # Markers of persons who left are deleted once.
            body = step.bodies.get(number, self._bodies[number])
            self._write_person(number, nobody(step.stamp), body, step.turn)
        self._displayed = observed
        self._bodies = {number: step.bodies[number] for number in observed}
        self._write(tracked(step.stamp, [person_id(number) for number in sorted(observed)], root_frame=self._root()))

    def _write_person(
        self,
        number: int,
        estimate: Estimate,
        body: Body,
        turn: Turn | None,
        posed: tuple[Track, Skeleton] | None = None,
    ) -> None:
        person, size = person_id(number), sum(limb.shape.length for limb in body.limbs)
        if estimate.joints and abs(self._described.get(number, 0.0) - size) > _OTHER_SIZE * size:
            self._write(description(body, person))
            self._described[number] = size
        # Markers take as long as all other messages together.
        seen = self._publish_on(f"{BODIES}/{person}/markers", _MARKERS, 10).subscribers > 0
        how: dict[str, Any] = {"root_frame": self._root(), "person": person, "markers": seen}
        self._write(instant(estimate, body, **how, turn=turn, posed=posed))

    def _publish_on(self, topic: str, kind: str, depth: int) -> Publication:
        if topic not in self._topics:
            STORE.get_msgdef(kind)
            self._topics[topic] = self._node.advertise(topic, kind, depth=depth, latched=kind == STRING)
        return self._topics[topic]

    def _write(self, messages: Mapping[str, Any]) -> None:
        for topic, message in messages.items():
            kind = message.__msgtype__
            depth = 1 if kind == STRING else 10
            self._publish_on(topic, kind, depth).write(bytes(STORE.serialize_cdr(message, kind)))
