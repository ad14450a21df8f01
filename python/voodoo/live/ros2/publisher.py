"""Publishes poses on ROS 2: transforms, joint states, markers, and who is there, named by REP-155."""

from __future__ import annotations

from collections.abc import Callable

from voodoo.export.ros2 import instant
from voodoo.live.follow import Step
from voodoo.live.ros2.dds import Node, Publication
from voodoo.live.ros2.types import IDS, STORE
from voodoo.live.session import Output

TRACKED = "/humans/bodies/tracked"


class Ros2Output(Output):
    """`/tf`, `/humans/bodies/body_<id>/joint_states`, `.../markers`, and `/humans/bodies/tracked` (hri_msgs/IdsList).

    Stamps are those of the data. Who is lost or searched for is not among the tracked, and has no transforms.

    Args:
        root_frame: tells the frame of the poses, once something came.
        node: None: one of its own.
    """

    name = "ros2"
    prompt = True

    def __init__(self, root_frame: Callable[[], str], *, node: Node | None = None) -> None:
        """Join the network."""
        self._root = root_frame
        self._node = Node() if node is None else node
        self._topics: dict[str, Publication] = {}
        self._shown: set[int] = set()
        self._publish_on("/tf", "tf2_msgs/msg/TFMessage", 100)
        self._publish_on(TRACKED, IDS, 1)

    def publish(self, step: Step) -> None:
        """See Output."""
        there = []
        for number, estimate in step.estimates.items():
            seen = bool(estimate.joints) and str(estimate.status) != "lost"
            if not seen and number not in self._shown:
                continue
            self._shown.discard(number)
            topic = f"/humans/bodies/body_{number}"
            messages = instant(estimate, step.bodies[number], root_frame=self._root(), person=str(number), topic=topic)
            if seen:
                there.append(str(number))
                self._shown.add(number)
            else:
                continue
            for name, message in messages.items():
                self._write(name, message)
        self._write(TRACKED, self._ids(step.stamp, there))

    def _ids(self, stamp: float, there: list[str]) -> object:
        seconds, rest = divmod(round(stamp * 1e9), 1_000_000_000)
        time = STORE.types["builtin_interfaces/msg/Time"](sec=seconds, nanosec=rest)
        header = STORE.types["std_msgs/msg/Header"](stamp=time, frame_id=self._root())
        return STORE.types[IDS](header=header, ids=there)

    def _publish_on(self, topic: str, kind: str, depth: int) -> Publication:
        if topic not in self._topics:
            self._topics[topic] = self._node.advertise(topic, kind, depth=depth)
        return self._topics[topic]

    def _write(self, topic: str, message: object) -> None:
        kind = message.__msgtype__  # type: ignore[attr-defined]
        self._publish_on(topic, kind, 10).write(bytes(STORE.serialize_cdr(message, kind)))
