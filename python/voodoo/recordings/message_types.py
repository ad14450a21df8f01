"""Message types of ROS, as ROS defines them; what a bag says of them is compared, and not executed."""

from __future__ import annotations

from typing import Any

from rosbags.interfaces import Connection, MessageDefinitionFormat, Nodetype
from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from voodoo.errors import RecordingError, reading

_TRANSFORMS = "geometry_msgs/TransformStamped[] transforms"
_MOST_TEXT = 2**16
"""Largest size of the definition of a type [bytes]; those of ROS are ten times smaller."""


class MessageTypes:
    """Deserializes messages.

    rosbags makes Python code of the definitions in a bag, and a definition may describe a small message as one that fills the
    memory. The types that are read here are the same in all releases of ROS 2, and in ROS 1 since 2010.

    Args:
        is_ros2: ROS 2 instead of ROS 1.
    """

    def __init__(self, *, is_ros2: bool) -> None:
        """Load the definitions of ROS."""
        self._is_ros2 = is_ros2
        self._store: Typestore = get_typestore(Stores.ROS2_HUMBLE if is_ros2 else Stores.ROS1_NOETIC)
        if not is_ros2:
            for name in ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage"):
                self._store.register(get_types_from_msg(_TRANSFORMS, name))
        self._checked: set[tuple[str, str, str]] = set()

    def check(self, connection: Connection, source: object) -> None:
        """Check that a topic has messages as ROS defines them.

        Raises:
            RecordingError: a type that is not one of ROS, or another definition of it; names the source and the topic.
        """
        kind, definition = str(connection.msgtype), connection.msgdef
        key = (kind, definition.data, str(connection.digest))
        if key in self._checked:
            return
        where = f"{source}, topic {connection.topic}"
        with reading(where, f"a definition of {kind}"):
            if kind not in self._store.fielddefs:
                raise RecordingError(f"{where}: expected a message type of ROS, found {kind:.100}")
            if not self._is_ros2:
                expected, found = self._store.generate_msgdef(kind)[1], connection.digest
                if found not in (expected, "*"):
                    raise RecordingError(f"{where}: expected {kind} with the checksum {expected}, found {found:.40}")
            elif definition.format != MessageDefinitionFormat.NONE:
                self._compare(kind, definition.format, definition.data, where)
        self._checked.add(key)

    def _compare(self, kind: str, form: MessageDefinitionFormat, text: str, where: str) -> None:
        if len(text) > _MOST_TEXT:
            raise RecordingError(f"{where}: expected a definition of {_MOST_TEXT} bytes at most, found {len(text)}")
        if form == MessageDefinitionFormat.MSG:
            found = get_types_from_msg(text, kind)
        else:
            found = {}
            # Definitions of several files follow each other, each below such a line.
            line = "=" * 80 + "\n"
            for part in text.split(line + "IDL: ")[1:] or [f"\n{text}"]:
                found |= get_types_from_idl(part.split("\n", 1)[1].removesuffix(line))
        waiting, seen = [kind], set()
        while waiting:
            name = waiting.pop()
            if name in seen or name not in found:
                continue
            seen.add(name)
            fields = self._store.fielddefs[name][1] if name in self._store.fielddefs else None
            if found[name][1] != fields:
                raise RecordingError(f"{where}: expected {name} as in ROS 2, found a message with other fields")
            waiting += [used for _, field in fields if (used := _type_used(field)) is not None]

    def deserialize(self, data: bytes, kind: str) -> object:
        """The message in these bytes.

        Raises:
            Exception: damage, of many kinds.
        """
        read = self._store.deserialize_cdr if self._is_ros2 else self._store.deserialize_ros1
        return read(data, kind)


def _type_used(field: Any) -> str | None:  # noqa: ANN401 - of rosbags
    """The message type of a field, or of its elements."""
    node, value = field
    if node in (Nodetype.ARRAY, Nodetype.SEQUENCE):
        node, value = value[0]
    return value if node == Nodetype.NAME else None
