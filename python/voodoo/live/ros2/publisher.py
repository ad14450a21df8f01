"""Publishes poses on ROS 2: transforms, joint states, markers, and the list of tracked persons, with names of REP-155."""

from __future__ import annotations

from collections.abc import Callable

from voodoo._core import Estimate
from voodoo.export.ros2 import instant
from voodoo.live.follow import Step
from voodoo.live.ros2.dds import Node, Publication
from voodoo.live.ros2.types import IDS, STORE
from voodoo.live.session import Output
from voodoo.model.body import Body
from voodoo.pipeline.search import nobody

TRACKED = "/humans/bodies/tracked"


class Ros2Output(Output):
    """`/tf`, `/humans/bodies/body_<id>/joint_states`, `.../pose`, `.../markers`, and `/humans/bodies/tracked` (hri_msgs/IdsList).

    Stamps are those of the data. Persons that are lost or searched for are not listed as tracked and have no transforms.

    Args:
        root_frame: returns the frame of the poses, once a frame has arrived.
        node: None: one of its own.
    """

    name = "ros2"
    prompt = True

    def __init__(self, root_frame: Callable[[], str], *, node: Node | None = None) -> None:
        """Join the network."""
        self._root = root_frame
        self._node = Node(quiet=True) if node is None else node
        self._topics: dict[str, Publication] = {}
        self._displayed: set[int] = set()
        self._bodies: dict[int, Body] = {}
        self._publish_on("/tf", "tf2_msgs/msg/TFMessage", 100)
        self._publish_on(TRACKED, IDS, 1)
        # Subscribers can discover these topics before the first pose.
        self._publish_on(f"{_body(1)}/joint_states", "sensor_msgs/msg/JointState", 10)
        self._publish_on(f"{_body(1)}/pose", "geometry_msgs/msg/PoseWithCovarianceStamped", 10)
        self._publish_on(f"{_body(1)}/markers", "visualization_msgs/msg/MarkerArray", 10)

    def publish(self, step: Step) -> None:
        """See Output."""
        observed = {number for number, one in step.estimates.items() if one.joints and str(one.status) != "lost"}
        for number in sorted(observed):
            self._write_person(number, step.estimates[number], step.bodies[number])
        for number in sorted(self._displayed - observed):
            # Markers of persons who left are deleted once.
            self._write_person(number, nobody(step.stamp), step.bodies.get(number, self._bodies[number]))
        self._displayed = observed
        self._bodies = {number: step.bodies[number] for number in observed}
        self._write(TRACKED, self._ids(step.stamp, [str(number) for number in sorted(observed)]))

    def _write_person(self, number: int, estimate: Estimate, body: Body) -> None:
        messages = instant(estimate, body, root_frame=self._root(), person=str(number), topic=_body(number))
        for name, message in messages.items():
            self._write(name, message)

    def _ids(self, stamp: float, there: list[str]) -> object:
        seconds, rest = divmod(round(stamp * 1e9), 1_000_000_000)
        time = STORE.types["builtin_interfaces/msg/Time"](sec=seconds, nanosec=rest)
        header = STORE.types["std_msgs/msg/Header"](stamp=time, frame_id=self._root())
        return STORE.types[IDS](header=header, ids=there)

    def _publish_on(self, topic: str, kind: str, depth: int) -> Publication:
        if topic not in self._topics:
            STORE.get_msgdef(kind)
            self._topics[topic] = self._node.advertise(topic, kind, depth=depth)
        return self._topics[topic]

    def _write(self, topic: str, message: object) -> None:
        kind = message.__msgtype__  # type: ignore[attr-defined]
        self._publish_on(topic, kind, 10).write(bytes(STORE.serialize_cdr(message, kind)))


def _body(number: int) -> str:
    return f"/humans/bodies/body_{number}"
