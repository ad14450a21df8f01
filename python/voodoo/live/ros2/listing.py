"""What is published on a ROS 2 network, for those who do not know the name of their topic."""

from __future__ import annotations

import time

from voodoo.live.ros2.dds import Node
from voodoo.live.ros2.feed import CAMERA_INFO, MEASURED, TF

_DISCOVERY_S, _LISTEN_S, _POLL_S = 1.0, 2.0, 0.05


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
