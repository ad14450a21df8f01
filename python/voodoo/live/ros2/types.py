"""ROS 2 message types for DDS, made from their definitions; the messages themselves remain bytes.

`cyclonedds` requires a class for each type, and would convert an image to a list of numbers. The classes here describe the type
and pass its bytes (CDR) on; rosbags reads and writes them like those of bags.
"""

from __future__ import annotations

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
    made.serialize = lambda message, *_, **__: bytes(message.data_as_sent)
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
