"""Publishes poses on ROS 2: transforms, joint states, markers, and the list of tracked persons, with names of REP-155."""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping
from functools import lru_cache
from itertools import compress, repeat
from typing import Any

import numpy as np

import voodoo._core as _core
from voodoo.errors import VoodooError, reading
from voodoo.export import ros2
from voodoo.export.human_frames import placed_names
from voodoo.export.layout import Layout
from voodoo.export.template import STAMP_NS, template
from voodoo.live.follow import Step
from voodoo.live.ros2.dds import Node, Offer, Publication
from voodoo.live.session import Output
from voodoo.live.sinks.people import posed_people
from voodoo.measurements import ColorImage, DepthImage, FloatArray
from voodoo.model.body import Body
from voodoo.people import FORGET_AFTER_S
from voodoo.pipeline.front_end import nobody

ADDRESS = "ros2://"
RESET, FOLLOW = "/voodoo/reset", "/voodoo/follow"
_PLACE = "geometry_msgs/msg/PointStamped"
_ON_DEMAND = {"markers": "visualization_msgs/msg/MarkerArray", "skeleton2d": ros2.SKELETON}
_CHECK_S = 0.5
"""How often sizes, subscribers of markers, and what is asked for are looked at."""
_OTHER_SIZE = 0.01
"""A body whose limbs' lengths changed by this fraction together is described again."""


class Ros2Sink(Output):
    """`/tf`, `/humans/bodies/<id>/joint_states`, `.../pose`, `.../markers`, `.../skeleton2d` in the first camera,
    `/human_description_<id>` (URDF), `/humans/bodies/tracked`, `/humans/persons/tracked` (hri_msgs/IdsList), and of each person
    `body_id` and `anonymous`.

    Markers and 2-D skeletons are made while somebody subscribes to them. Stamps are those of the data. Persons that are lost or
    searched for are not listed as tracked and have no transforms. A message on RESET (std_msgs/Empty) lets everybody be searched
    for again; one on FOLLOW (geometry_msgs/PointStamped) lets only the person at that place be followed.

    Args:
        address: ros2://; the network is that of the environment.
        root_frame: see `Sink`.
        on_message: see `Sink`.
        node: None: one of its own.

    Raises:
        VoodooError: another address, no network, or cyclonedds is not installed.
    """

    name = "ros2"
    receiver, waits = True, False

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
        self._root, self._on_message = root_frame, on_message
        self._node = Node(quiet=True) if node is None else node
        self._topics: dict[str, Publication] = {}
        self._displayed: dict[int, Body] = {}
        self._described: dict[int, float] = {}
        self._present: dict[int, float] = {}
        self._requested: dict[int, dict[str, int]] = {}
        self._checked = -np.inf
        self._template_of = lru_cache(8)(self._make_template)
        self._resets = self._node.subscribe(RESET, Offer("std_msgs/msg/Empty", reliable=False, latched=False))
        self._follows = self._node.subscribe(FOLLOW, Offer(_PLACE, reliable=False, latched=False))
        self._publish_on("/tf", ros2.TF, 100)
        for topic in ros2.TRACKED:
            self._publish_on(topic, ros2.IDS, 1)
        for name, kind in (("joint_states", ros2.JOINTS), ("pose", ros2.POSE), *_ON_DEMAND.items()):
            # Subscribers can discover these topics before the first pose.
            self._publish_on(f"{ros2.BODIES}/{ros2.person_id(1)}/{name}", kind)

    def publish(self, step: Step) -> None:
        """See Output."""
        root = self._root()
        people = posed_people(step, root)
        frame, numbers = people.frame, [people.rows_there]
        observed = {number: step.bodies[number] for number in people.there}
        if observed and frame != root:
            numbers.append(np.array(ros2.root_on_parent(people.turn.pose)))
        publications, made = self._template_of(people.ids, people.sure, root, frame, people.layout)
        # Together: what follows takes longer, and the network wakes once.
        messages = made.filled(numbers, _stamp(round(step.stamp * 1e9)))
        for publication, message in zip(publications, messages, strict=True):
            publication.write(message)
        displayed = self._displayed | observed  # markers of persons who left are deleted once
        if displayed.keys() != self._requested.keys() or abs(step.stamp - self._checked) > _CHECK_S:
            self._checked = step.stamp
            self._obey()
            self._drop_who_left(step)
            self._describe(observed)
            self._requested = {number: self._subscribers(number) for number in displayed}
        image = next((item for item in step.frame.measurements if isinstance(item, (DepthImage, ColorImage))), None)
        for number in displayed:
            if self._requested[number]["markers"]:
                estimate = step.estimates[number] if number in observed else nobody(step.stamp)
                how: Any = {"root_frame": root, "person": ros2.person_id(number), "turn": step.turn}
                topic = _topic(number, "markers")
                self._write({topic: ros2.instant(estimate, displayed[number], **how)[topic]})
            if self._requested[number]["skeleton2d"] and number in observed and image is not None:
                self._write({_topic(number, "skeleton2d"): ros2.keypoints_message(step.estimates[number], image)})
        self._displayed = observed

    def _subscribers(self, number: int) -> dict[str, int]:
        return {name: self._publish_on(_topic(number, name), kind).subscribers for name, kind in _ON_DEMAND.items()}

    def _obey(self) -> None:
        if self._resets.take() and self.on_reset is not None:
            self.on_reset()
        for raw in self._follows.take():
            try:
                with reading(FOLLOW, f"a {_PLACE} message", error=VoodooError):
                    chosen: Any = ros2.STORE.deserialize_cdr(raw, _PLACE)
            except VoodooError as error:
                self._on_message(f"{self.name}: {error}")
                continue
            if self.on_choice is not None:
                self.on_choice(chosen.header.frame_id, np.array([chosen.point.x, chosen.point.y, chosen.point.z]))

    def _drop_who_left(self, step: Step) -> None:
        """Withdraw the topics of persons whom the tracker has forgotten: numbers rise as long as the session lasts."""
        self._present.update(dict.fromkeys(step.estimates, step.stamp))
        for number in [one for one, at in self._present.items() if abs(step.stamp - at) > FORGET_AFTER_S]:
            description = f"/human_description_{ros2.person_id(number)}"
            folders = tuple(f"{above}/{ros2.person_id(number)}/" for above in (ros2.BODIES, ros2.PERSONS))
            for topic in [one for one in self._topics if one == description or one.startswith(folders)]:
                del self._topics[topic]
            del self._present[number]
            self._described.pop(number, None)
            self._template_of.cache_clear()

    def _describe(self, observed: Mapping[int, Body]) -> None:
        for number, body in observed.items():
            size = float(np.sum([limb.shape.length for limb in body.limbs]))
            if abs(self._described.get(number, 0.0) - size) > _OTHER_SIZE * size:
                self._write(ros2.description(body, ros2.person_id(number)))
                self._described[number] = size

    def _make_template(
        self, ids: tuple[str, ...], sure: tuple[bool, ...], root: str, frame: str, layout: Layout | None
    ) -> tuple[list[Publication], _core.Template]:
        """Topics, and the messages on them, of persons of whom some have a covariance."""
        known = list(compress(ids, sure))
        topics = [("/tf", ros2.TF)] * bool(ids)
        topics += [(f"{ros2.BODIES}/{person}/joint_states", ros2.JOINTS) for person in ids]
        topics += [(f"{ros2.BODIES}/{person}/pose", ros2.POSE) for person in known]
        topics += [(topic, ros2.IDS) for topic in ros2.TRACKED]
        count = len(ids) * sum(layout.widths) if layout else 0

        def encode(numbers: FloatArray) -> list[bytes]:
            at, messages = STAMP_NS / 1e9, list(ros2.tracked(STAMP_NS / 1e9, ids, root_frame=root).values())
            if layout and ids:
                frames, *_, angles, covariances, _ = layout.parts(numbers[:count])
                rows = [(root, frame, numbers[count:].tolist())] * (frame != root)
                for person, of_person in zip(ids, frames.tolist(), strict=True):
                    placed = placed_names(*layout.shapes[:2], person, frame)
                    rows += [(*pair, row) for pair, row in zip(placed, of_person, strict=True)]
                about = [ros2.joint_message(at, *one) for one in zip(ids, repeat(layout.angles), angles)]
                poses = compress(zip(frames[:, 0].tolist(), covariances, strict=True), sure)
                about += [ros2.pose_message(at, frame, *one) for one in poses]
                messages = [ros2.transforms_message(at, rows), *about, *messages]
            return [ros2.cdr(one) for one in messages]

        turned = 7 if ids and frame != root else 0
        return [self._publish_on(*one) for one in topics], template(encode, count + turned, stamp=_stamp(STAMP_NS))

    def _publish_on(self, topic: str, kind: str, depth: int = 10) -> Publication:
        if topic not in self._topics:
            ros2.STORE.get_msgdef(kind)
            latched = kind in (ros2.STRING, ros2.BOOL)
            self._topics[topic] = self._node.advertise(topic, kind, depth=1 if latched else depth, latched=latched)
        return self._topics[topic]

    def _write(self, messages: Mapping[str, Any]) -> None:
        for topic, message in messages.items():
            self._publish_on(topic, message.__msgtype__).write(ros2.cdr(message))


def _topic(number: int, name: str) -> str:
    return f"{ros2.BODIES}/{ros2.person_id(number)}/{name}"


def _stamp(nanoseconds: int) -> bytes:
    """A stamp in CDR."""
    return struct.pack("<iI", *divmod(nanoseconds, 1_000_000_000))
