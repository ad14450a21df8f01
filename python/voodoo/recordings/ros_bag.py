"""Access to the messages of ROS 1 and ROS 2 bags through rosbags, with every failure made a RecordingError."""

from __future__ import annotations

import shutil
import struct
import tempfile
import weakref
import zipfile
import zlib
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

from voodoo.errors import RecordingError, reading
from voodoo.recordings.ros_messages import Message

_BAG_SUFFIXES = (".bag", ".mcap", ".db3")
_MCAP_MAGIC = b"\x89MCAP0\r\n"
_MCAP_FOOTER = 0x02


@dataclass(frozen=True)
class Topic:
    """A topic of a bag: its message type as ROS 2 writes it and how many messages the bag's index announces."""

    name: str
    type: str
    messages: int


class Bag:
    """A bag on disk; every read opens it afresh, so reads may overlap.

    Args:
        path: a .bag, .mcap or .db3 file, a ROS 2 bag directory, a directory holding one of these (also as `bag/`),
            or a .zip holding one, which is unpacked into a temporary directory for the life of this object.

    Raises:
        RecordingError: no bag there, or its index is damaged.
    """

    def __init__(self, path: Path) -> None:
        """Unpack if need be, and read the index."""
        self.path = path
        folder = path
        if path.suffix == ".zip":
            folder = Path(tempfile.mkdtemp(prefix="voodoo-"))
            weakref.finalize(self, shutil.rmtree, folder, ignore_errors=True)
            _unpack(path, folder)
        self.file = find_bag(folder) if folder.is_dir() else folder
        for part in [self.file] if self.file.is_file() else sorted(self.file.iterdir()):
            if part.suffix == ".mcap":
                check_mcap(part)
        with self._open() as reader:
            with reading(self.path, "the index of a ROS bag"):
                self.is_ros2: bool = reader.is2
                self.topics = _topics(reader)
                self.start_time: int = reader.start_time
                self.end_time: int = reader.end_time
        if self.file.is_dir():
            self._check_metadata()

    def read(self, topics: Collection[str]) -> Iterator[tuple[str, Message]]:
        """Messages of `topics` in the order they were recorded, as (topic, message).

        Raises:
            RecordingError: damage, or fewer messages than the bag's index announces.
        """
        counts = dict.fromkeys(topics, 0)
        with self._open() as reader:
            for topic, message in self._messages(reader, topics, None):
                counts[topic] += 1
                yield topic, message
        announced = {topic.name: topic.messages for topic in self.topics}
        for name, count in counts.items():
            if count != announced[name]:
                raise RecordingError(
                    f"{self.path}: expected {announced[name]} messages on {name} as the bag's index says, found {count}"
                )

    def first(self, topic: str) -> Message:
        """The first message of `topic`.

        Raises:
            RecordingError: damage, or no message although the index announces some.
        """
        with self._open() as reader:
            for _, message in self._messages(reader, [topic], None):
                return message
        raise RecordingError(f"{self.path}: expected messages on {topic} as the bag's index says, found none")

    def last(self, topic: str) -> Message:
        """The last message of `topic`; looks at the end of the bag first."""
        found = None
        with self._open() as reader:
            for seconds in (1, 10, None):
                start = None if seconds is None else self.end_time - seconds * 1_000_000_000
                for _, message in self._messages(reader, [topic], start):
                    found = message
                if found is not None:
                    return found
        raise RecordingError(f"{self.path}: expected messages on {topic} as the bag's index says, found none")

    def _check_metadata(self) -> None:
        """Compare metadata.yaml with the storage files: what only one of them knows would be left out in silence."""
        stored: dict[tuple[str, str], int] = {}
        for part in sorted(self.file.iterdir()):
            if part.suffix in (".mcap", ".db3"):
                with reading(part, "a complete ROS bag"), AnyReader([part], default_typestore=_typestore()) as reader:
                    for topic in _topics(reader):
                        key = (topic.name, topic.type)
                        stored[key] = stored.get(key, 0) + topic.messages
        announced = {(topic.name, topic.type): topic.messages for topic in self.topics}
        for name, kind in sorted(stored.keys() | announced.keys()) if stored else ():
            expected, found = announced.get((name, kind), 0), stored.get((name, kind), 0)
            if expected != found:
                raise RecordingError(
                    f"{self.file / 'metadata.yaml'}: expected {found} messages on {name} ({kind}) as in the storage "
                    f"file, found {expected} (`ros2 bag reindex` repairs it, or open the storage file itself)"
                )

    @contextmanager
    def _open(self) -> Iterator[AnyReader]:
        with reading(self.path, "a complete ROS bag"):
            reader = AnyReader([self.file], default_typestore=_typestore())
            reader.open()
        try:
            yield reader
        finally:
            reader.close()

    def _messages(self, reader: AnyReader, topics: Collection[str], start: int | None) -> Iterator[tuple[str, Message]]:
        connections = [connection for connection in reader.connections if connection.topic in topics]
        if not connections:
            return
        stream = reader.messages(connections, start=start)
        while True:
            with reading(self.path, "a complete ROS bag"):
                item = next(stream, None)
            if item is None:
                return
            connection, _, raw = item
            with reading(f"{self.path}, topic {connection.topic}", f"a {connection.msgtype} message"):
                message = reader.deserialize(raw, connection.msgtype)
            yield connection.topic, message


def _typestore() -> Typestore:
    """Bags of older ROS 2 releases carry no message definitions; those used here are the same in all releases."""
    return get_typestore(Stores.ROS2_HUMBLE)


def _topics(reader: AnyReader) -> tuple[Topic, ...]:
    return tuple(Topic(name, str(item.msgtype), item.msgcount) for name, item in sorted(reader.topics.items()))


def find_bag(folder: Path) -> Path:
    """The bag in a folder: itself with metadata.yaml, else `bag/`, else the only .bag, .mcap or .db3 file in it.

    Raises:
        RecordingError: none, or several files and no metadata.yaml that says how they belong together.
    """
    for candidate in (folder, folder / "bag"):
        if (candidate / "metadata.yaml").is_file():
            return candidate
    for candidate in (folder, folder / "bag"):
        if candidate.is_dir():
            files = sorted(item for item in candidate.iterdir() if item.suffix in _BAG_SUFFIXES and item.is_file())
            if len(files) == 1:
                return files[0]
            if files:
                names = ", ".join(item.name for item in files)
                raise RecordingError(f"{candidate}: expected a metadata.yaml or a single bag file, found {names}")
    raise RecordingError(f"{folder}: expected a ROS bag (metadata.yaml, .mcap, .db3 or .bag), found none")


def zip_members(path: Path) -> list[str]:
    """Names in a .zip.

    Raises:
        RecordingError: not a .zip, or a damaged one.
    """
    with reading(path, "a complete .zip file"), zipfile.ZipFile(path) as archive:
        return archive.namelist()


def _unpack(path: Path, folder: Path) -> None:
    with reading(path, "a complete .zip file"), zipfile.ZipFile(path) as archive:
        for member in archive.infolist():
            name = PurePosixPath(member.filename).name
            if not member.is_dir() and (name == "metadata.yaml" or name.endswith(_BAG_SUFFIXES)):
                if (folder / name).exists():
                    raise RecordingError(f"{path}: expected one bag, found several files named {name}")
                with archive.open(member) as source, (folder / name).open("wb") as target:
                    shutil.copyfileobj(source, target)


def check_mcap(path: Path) -> None:
    """Check that the records of an MCAP file follow each other up to its footer and that the summary is sound.

    A reader that skips records by their length would step over a damaged length in silence.
    See the MCAP specification, "Records" and "Footer".

    Raises:
        RecordingError: naming the offset.
    """
    size = path.stat().st_size
    with reading(path, "a readable file"), path.open("rb") as file:
        if file.read(8) != _MCAP_MAGIC:
            raise RecordingError(f"{path}: expected an MCAP file, found other bytes at its start")
        position = 8
        while True:
            head = file.read(9)
            if len(head) < 9:
                raise RecordingError(f"{path}: expected a complete MCAP file, found it cut off at byte {size}")
            code, length = struct.unpack("<BQ", head)
            if position + 9 + length > size:
                raise RecordingError(
                    f"{path}: expected a complete MCAP file, found a record of {length} bytes at byte {position} of "
                    f"{size}: cut off or damaged"
                )
            if code == _MCAP_FOOTER:
                break
            position += 9 + length
            file.seek(position)
        footer = file.read(length)
        if length != 20 or file.read() != _MCAP_MAGIC:
            raise RecordingError(f"{path}: expected an MCAP footer at byte {position}, found damage")
        summary_start, _, summary_crc = struct.unpack("<QQI", footer)
        if summary_crc:
            file.seek(summary_start)
            summary = file.read(position + 9 + 16 - summary_start)
            if zlib.crc32(summary) != summary_crc:
                raise RecordingError(f"{path}: expected a sound MCAP summary, found a wrong checksum")
