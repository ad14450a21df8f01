"""A participant in a ROS 2 network, by Cyclone DDS.

`cyclonedds` requires a class for each message type, and would convert an image to a list of numbers. The classes here are made
from the definitions of ROS, and pass the bytes of a message (CDR) on; rosbags reads and writes them like those of bags.
"""

from __future__ import annotations

import os
import threading
from contextlib import nullcontext, suppress
from dataclasses import dataclass
from functools import cache
from typing import Any

from rosbags.interfaces import Nodetype

from voodoo.errors import VoodooError, installed
from voodoo.export.ros2 import STORE

_BYTES = ("byte", "char", "octet")
"""Names of ROS for uint8; those of other numbers are the library's, too."""


def idl() -> Any:  # noqa: ANN401 - a module that may not be installed
    """The module `cyclonedds.idl`.

    Raises:
        VoodooError: it is not installed.
    """
    return installed("cyclonedds.idl", "ROS 2 topics need Cyclone DDS: pip install 'voodoo-tracker[ros2]'")


def dds_name(kind: str) -> str:
    """The name of a type on the network: of "sensor_msgs/msg/Image" "sensor_msgs::msg::dds_::Image_"."""
    package, _, name = kind.rsplit("/", 2)
    return f"{package}::msg::dds_::{name}_"


def ros_name(name: str) -> str:
    """The inverse mapping; "" if the type is not a ROS message."""
    parts = name.split("::")
    if len(parts) != 4 or parts[1:3] != ["msg", "dds_"] or not parts[3].endswith("_"):
        return ""
    return f"{parts[0]}/msg/{parts[3][:-1]}"


def message_of(kind: Any, data: bytes) -> Any:  # noqa: ANN401
    """A message of a class of `dds_type` from its bytes (CDR with its header of four bytes), kept as `data_as_sent`."""
    message = kind.__new__(kind)
    message.data_as_sent = bytes(data)
    return message


@cache
def dds_type(kind: str) -> Any:  # noqa: ANN401 - a class made at run time
    """The class of a message type for `cyclonedds`.

    Raises:
        VoodooError: `cyclonedds` is not installed, or an unknown type.
    """
    made = _struct(kind, topic=True)
    # The library adds options.
    made.serialize = lambda message, *_, **__: message.data_as_sent
    made.deserialize = made.deserialize_key = lambda data, *_, **__: message_of(made, data)
    return made


@cache
def _struct(kind: str, *, topic: bool = False) -> Any:  # noqa: ANN401
    if kind not in STORE.fielddefs:
        raise VoodooError(f"ROS 2: expected a type that is known here, found {kind!r}")
    module = idl()
    _, fields = STORE.fielddefs[kind]
    found = {name: _field(node) for name, node in fields}
    name = dds_name(kind).replace("::", ".")
    return module.make_idl_struct(kind.replace("/", "_"), name, found, dataclassify=not topic)


def _field(node: Any) -> Any:  # noqa: ANN401
    kind, content = node
    types = idl().types
    if kind is Nodetype.NAME:
        return _struct(content)
    if kind is Nodetype.ARRAY:
        return types.array[_field(content[0]), content[1]]
    if kind is Nodetype.SEQUENCE:
        inner = _field(content[0])
        return types.sequence[inner, content[1]] if content[1] else types.sequence[inner]
    name = content[0]
    if name == "string":
        return str
    return bool if name == "bool" else getattr(types, "uint8" if name in _BYTES else name)


_LOOPBACK = """<General><Interfaces><NetworkInterface address="127.0.0.1" multicast="false"/></Interfaces>
<AllowMulticast>false</AllowMulticast></General><Discovery><ParticipantIndex>auto</ParticipantIndex>
<MaxAutoParticipantIndex>60</MaxAutoParticipantIndex><Peers><Peer address="127.0.0.1"/></Peers></Discovery>"""
_SETTINGS = """<CycloneDDS><Domain>{}<Internal><SocketReceiveBufferSize min="default"/>
<HeartbeatInterval>300 ms</HeartbeatInterval></Internal></Domain></CycloneDDS>"""
"""A message that follows a lost one asks for it; only the last one before a pause waits for a heartbeat, which wakes threads."""
_MS = 1_000_000
_domains: dict[int, Any] = {}
_quiet: set[str] = set()
"""Publications of this process that its other nodes must not treat as offers."""
_lock = threading.Lock()


@dataclass(frozen=True)
class Offer:
    """A publication found on a topic.

    Args:
        kind: message type, e.g. "sensor_msgs/msg/Image".
        reliable: lost messages are sent again.
        latched: late subscribers get the last messages.
    """

    kind: str
    reliable: bool
    latched: bool


def domain_id() -> int:
    """The ROS_DOMAIN_ID of the environment, by default 0.

    Raises:
        VoodooError: it is no number from 0 to 232.
    """
    word = os.environ.get("ROS_DOMAIN_ID", "0") or "0"
    if not word.isdecimal() or int(word) > 232:
        raise VoodooError(f"ROS_DOMAIN_ID: expected a number from 0 to 232, found {word!r}")
    return int(word)


def on_loopback() -> bool:
    """Whether the environment restricts ROS 2 to this machine, by the variables that ROS 2 defines."""
    discovered = os.environ.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "").upper()
    return discovered == "LOCALHOST" or os.environ.get("ROS_LOCALHOST_ONLY", "") == "1"


class Node:
    """Topics of a ROS 2 network. Respects ROS_DOMAIN_ID, and the restriction to this machine if the environment sets it.

    Args:
        quiet: its publications are hidden from other nodes of this process.

    Raises:
        VoodooError: `cyclonedds` is not installed, or no network.
    """

    def __init__(self, *, quiet: bool = False) -> None:
        """Join the network."""
        idl()
        from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsPublication
        from cyclonedds.core import DDSException, WaitSet
        from cyclonedds.domain import Domain, DomainParticipant

        number = domain_id()
        try:
            alone = on_loopback()
            # Other code of this process may have joined before.
            with _lock, nullcontext() if alone else suppress(DDSException):
                if number not in _domains and not os.environ.get("CYCLONEDDS_URI"):
                    _domains[number] = Domain(number, _SETTINGS.format(_LOOPBACK if alone else ""))
            self._participant = DomainParticipant(number)
            self._publications = BuiltinDataReader(self._participant, BuiltinTopicDcpsPublication)
            self._waitset = WaitSet(self._participant)
        except DDSException as error:
            raise VoodooError(f"ROS 2: expected a network, found none: {error}") from error
        self._offers: dict[str, tuple[str, Offer]] = {}
        self._is_quiet = quiet

    def offers(self) -> dict[str, Offer]:
        """Topic -> current publication; of several the last."""
        from cyclonedds.qos import Policy

        for sample in self._publications.take(N=1000):
            key = str(getattr(sample, "key", ""))
            info = getattr(sample, "sample_info", None)
            alive = info is None or int(info.instance_state) == 16  # DDS_IST_ALIVE
            name = getattr(sample, "topic_name", "")
            if not alive or not name.startswith("rt/") or key in _quiet:
                self._offers.pop(key, None)
                continue
            reliable = isinstance(sample.qos[Policy.Reliability], Policy.Reliability.Reliable)
            durability = sample.qos[Policy.Durability]
            latched = durability is not None and durability != Policy.Durability.Volatile
            self._offers[key] = (name[2:], Offer(ros_name(sample.type_name), reliable, latched))
        return dict(self._offers.values())

    def subscribe(self, topic: str, offer: Offer, *, depth: int = 5) -> Subscription:
        """Subscribe to a topic."""
        return Subscription(self._participant, self._waitset, topic, offer, depth)

    def advertise(self, topic: str, kind: str, *, depth: int = 10, latched: bool = False) -> Publication:
        """Publish on a topic, reliably, while the returned publication is alive; latched: late subscribers get the last."""
        made = Publication(self._participant, topic, kind, depth, latched)
        if self._is_quiet:
            _quiet.add(made.key)
        return made

    def wait(self, seconds: float) -> None:
        """Wait until a message arrives on a subscribed topic, at most this long [s]."""
        self._waitset.wait(timeout=max(int(seconds * 1000), 1) * _MS)


def _qos(reliable: bool, latched: bool, depth: int) -> Any:  # noqa: ANN401
    from cyclonedds.qos import Policy, Qos

    return Qos(
        Policy.Reliability.Reliable(max_blocking_time=100 * _MS) if reliable else Policy.Reliability.BestEffort,
        Policy.Durability.TransientLocal if latched else Policy.Durability.Volatile,
        Policy.History.KeepLast(depth),
        Policy.DataRepresentation(use_cdrv0_representation=True),
    )


class Subscription:
    """A subscription to a topic.

    Attributes:
        topic: its name.
        kind: message type.
    """

    def __init__(self, participant: Any, waitset: Any, topic: str, offer: Offer, depth: int) -> None:  # noqa: ANN401
        """Subscribe."""
        from cyclonedds.core import InstanceState, ReadCondition, SampleState, ViewState
        from cyclonedds.sub import DataReader
        from cyclonedds.topic import Topic

        self.topic, self.kind = topic, offer.kind
        qos = _qos(offer.reliable, offer.latched, depth)
        self._reader = DataReader(participant, Topic(participant, f"rt{topic}", dds_type(offer.kind)), qos)
        condition = ReadCondition(self._reader, SampleState.NotRead | ViewState.Any | InstanceState.Any)
        waitset.attach(condition)
        self._condition = condition

    def take(self) -> list[bytes]:
        """Received messages, as they were sent."""
        if not self._condition.triggered:
            return []
        return [sample.data_as_sent for sample in self._reader.take(N=100) if hasattr(sample, "data_as_sent")]

    def lost(self) -> int:
        """Number of messages that the network lost since the last call."""
        return int(self._reader.get_sample_lost_status().total_count_change)

    @property
    def publishers(self) -> int:
        """Number of publishers."""
        return len(self._reader.get_matched_publications())


class Publication:
    """A publication on a topic.

    Attributes:
        key: unique identifier.
    """

    def __init__(self, participant: Any, topic: str, kind: str, depth: int, latched: bool) -> None:  # noqa: ANN401
        """Advertise."""
        from cyclonedds.core import DDSException
        from cyclonedds.pub import DataWriter
        from cyclonedds.topic import Topic

        made, self._failed = dds_type(kind), DDSException
        self._sample = message_of(made, b"")
        self._writer = DataWriter(participant, Topic(participant, f"rt{topic}", made), _qos(True, latched, depth))
        self.key = str(self._writer.guid)

    def write(self, message: bytes) -> None:
        """Publish a message (CDR with its header).

        Raises:
            OSError: a subscriber holds it up, or the network is gone.
        """
        self._sample.data_as_sent = message
        try:
            self._writer.write(self._sample)
        except self._failed as error:
            raise OSError(str(error)) from error

    @property
    def subscribers(self) -> int:
        """Number of subscribers."""
        return int(self._writer.get_publication_matched_status().current_count)
