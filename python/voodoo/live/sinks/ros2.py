"""Publishes poses on ROS 2: transforms, joint states, markers, and the list of tracked persons, with names of REP-155."""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping
from functools import lru_cache
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
    body_covariances,
    cdr,
    description,
    joint_message,
    markers,
    person_id,
    pose_message,
    root_on_parent,
    tracked,
    transforms_message,
)
from voodoo.export.template import STAMP_NS, STAMP_S, Template
from voodoo.live.follow import Step
from voodoo.live.ros2.dds import Node, Offer, Publication
from voodoo.live.session import Output
from voodoo.live.sinks.people import Shown, shown
from voodoo.measurements import FloatArray
from voodoo.model.body import Body
from voodoo.pipeline.search import nobody

ADDRESS = "ros2://"
RESET, FOLLOW = "/voodoo/reset", "/voodoo/follow"
_PLACE, _MARKERS = "geometry_msgs/msg/PointStamped", "visualization_msgs/msg/MarkerArray"
_NONE: FloatArray = np.empty(0)
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
        self._publish_on("/tf", TF, 100)
        self._publish_on(TRACKED, IDS, 1)
        # Subscribers can discover these topics before the first pose.
        self._publish_on(f"{BODIES}/{person_id(1)}/joint_states", JOINTS, 10)
        self._publish_on(f"{BODIES}/{person_id(1)}/pose", POSE, 10)
        self._publish_on(f"{BODIES}/{person_id(1)}/markers", _MARKERS, 10)

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
            self._write_people(step, people)
        for number in self._displayed | observed:
            # They take as long as everything else together; those of persons who left are deleted once.
            if self._publish_on(f"{BODIES}/{person_id(number)}/markers", _MARKERS, 10).subscribers:
                estimate = step.estimates[number] if number in observed else nobody(step.stamp)
                how: Any = {"root_frame": self._root(), "person": person_id(number), "turn": step.turn}
                self._write(markers(estimate, step.bodies.get(number) or self._bodies[number], **how))
        self._displayed = observed
        self._bodies = {number: step.bodies[number] for number in observed}
        ids = tuple(map(person_id, sorted(observed)))
        self._send(TRACKED, IDS, step.stamp, lambda: (_tracked(ids, self._root()), _NONE))

    def _write_people(self, step: Step, people: Shown) -> None:
        there, frame = people.present, people.frame
        numbers = [people.numbers[index] for index in there]
        ids = tuple(map(person_id, numbers))
        names, parents, *_ = people.frames
        above = () if frame == self._root() else (self._root(), frame, *root_on_parent(people.turn.pose))
        self._send(
            *("/tf", TF, step.stamp),
            lambda: (_transforms(ids, frame, above, names, parents), people.on_parents[there]),
        )
        sure = _covariances(people)
        for index, person in zip(there.tolist(), ids, strict=True):

            def joints(index: int = index, person: str = person) -> tuple[Template, FloatArray]:
                names, angles = people.angles
                return _joints(person, names), angles[index]

            def pose(index: int = index, person: str = person) -> tuple[Template, FloatArray]:
                return _pose(person, frame), np.concatenate([people.on_parents[index, 0], sure[index].ravel()])

            self._send(f"{BODIES}/{person}/joint_states", JOINTS, step.stamp, joints)
            if np.isfinite(sure[index]).all():
                self._send(f"{BODIES}/{person}/pose", POSE, step.stamp, pose)
        for number in numbers:  # last: it takes milliseconds
            size = float(step.bodies[number].core.sizes()[:, 0].sum())
            if abs(self._described.get(number, 0.0) - size) > _OTHER_SIZE * size:
                self._write(description(step.bodies[number], person_id(number)))
                self._described[number] = size

    def _send(self, topic: str, kind: str, stamp: float, made: Callable[[], tuple[Template, FloatArray]]) -> None:
        """Fill a template with numbers and publish it, if somebody subscribes."""
        publication = self._publish_on(topic, kind, 10)
        if publication.subscribers:
            template, numbers = made()
            at = struct.pack("<iI", *divmod(round(stamp * 1e9), 1_000_000_000))
            publication.write(template.filled(numbers.ravel(), at))

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


_STAMP = struct.pack("<iI", *divmod(STAMP_NS, 1_000_000_000))


@lru_cache(maxsize=16)
def _transforms(
    people: tuple[str, ...], root: str, above: tuple[Any, ...], names: tuple[str, ...], parents: tuple[int, ...]
) -> Template:
    placed = [row for person in people for row in placed_names(names, parents, person, root)]

    def encode(numbers: list[float]) -> bytes:
        rows = [(*both, numbers[7 * index : 7 * index + 7]) for index, both in enumerate(placed)]
        return cdr(transforms_message(STAMP_NS, [*([(*above[:2], above[2:])] if above else []), *rows]))

    return Template(encode, 7 * len(placed), kind="<f8", stamp=_STAMP)


@lru_cache(maxsize=64)
def _joints(person: str, joints: tuple[str, ...]) -> Template:
    return Template(
        lambda angles: cdr(joint_message(STAMP_NS, person, joints, angles)), len(joints), kind="<f8", stamp=_STAMP
    )


@lru_cache(maxsize=64)
def _pose(person: str, root: str) -> Template:
    def encode(numbers: list[float]) -> bytes:
        return cdr(pose_message(STAMP_NS, root, numbers[:7], numbers[7:]))

    return Template(encode, 7 + 36, kind="<f8", stamp=_STAMP)


@lru_cache(maxsize=16)
def _tracked(people: tuple[str, ...], root: str) -> Template:
    message = cdr(tracked(STAMP_S, people, root_frame=root)[TRACKED])
    return Template(lambda _: message, 0, kind="<f8", stamp=_STAMP)


def _covariances(people: Shown) -> FloatArray:
    """Covariances (P, 6, 6) of the poses of "body"."""
    root, unknown = people.posed.bones[0].name, np.full((6, 6), np.nan)
    found = np.array([one.limb_covariance.get(root, unknown) for one in people.estimates])
    if people.turn.words:
        turned = np.kron(np.eye(2), people.turn.pose[:3, :3])
        found = turned @ found @ turned.T
    return body_covariances(found, people.frames.places[:, 0] - people.limb_poses[:, 0, :3, 3])
