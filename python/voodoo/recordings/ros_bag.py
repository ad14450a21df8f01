"""Access to the messages of ROS 1 and ROS 2 bags through rosbags, with every failure converted to a RecordingError."""

from __future__ import annotations

import shutil
import struct
import tempfile
import weakref
import zipfile
import zlib
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

from voodoo.errors import RecordingError, reading
from voodoo.recordings import realsense
from voodoo.recordings.left_out import LeftOut
from voodoo.recordings.ros_messages import Message, frame_of
from voodoo.recordings.stored import check_stored

_BAG_SUFFIXES = (".bag", ".mcap", ".db3")
_MOST_UNPACKED = 2**40
"""Largest size of a bag [bytes]."""
_LITTLE, _MOST_GAIN = 2**28, 200
"""An archive may unpack to a quarter of a gigabyte plus 200 times its own size. Bags compress to a tenth at best, static scenes
to a fiftieth, and archives made to fill disks to a thousandth."""
_MCAP_MAGIC = b"\x89MCAP0\r\n"
_MCAP_FOOTER = 0x02


@dataclass(frozen=True)
class Topic:
    """A topic of a bag: its message type in the notation of ROS 2, and the number of messages in the index of the bag."""

    name: str
    type: str
    messages: int


class Bag:
    """A bag on disk; every read opens it again, so reads may overlap.

    Args:
        path: a .bag, .mcap or .db3 file, a ROS 2 bag directory, a directory holding one of these (also as `bag/`),
            or a .zip holding one, which is unpacked into a temporary directory for the lifetime of this object.

        left_out: counts unusable messages, which are then left out; None: they are errors.

    Raises:
        RecordingError: there is no bag, or its index is damaged.
    """

    def __init__(self, path: Path, *, left_out: LeftOut | None = None) -> None:
        """Unpack the archive if needed, and read the index."""
        self.path = path
        self._left_out = left_out
        folder = path
        if path.suffix == ".zip":
            folder = Path(tempfile.mkdtemp(prefix="voodoo-"))
            weakref.finalize(self, shutil.rmtree, folder, ignore_errors=True)
            _unpack(path, folder)
        self._folder = folder
        with self._naming():
            self._survey()

    def _survey(self) -> None:
        """Find the bag and read its index."""
        self.file = find_bag(self._folder) if self._folder.is_dir() else self._folder
        for part in [self.file] if self.file.is_file() else sorted(self.file.iterdir()):
            if part.suffix in _BAG_SUFFIXES:
                check_stored(part, "a complete ROS bag", most=_MOST_UNPACKED)
            if part.suffix == ".mcap":
                check_mcap(part)
        with self._open() as reader:
            with reading(self.path, "the index of a ROS bag"):
                self.is_ros2: bool = reader.is2
                self.topics = _topics(reader)
                self.realsense: bool = not self.is_ros2 and realsense.is_recorders(item.name for item in self.topics)
                self.start_time: int = reader.start_time
                self.end_time: int = reader.end_time
        if self.file.is_dir():
            self._check_metadata()

    @contextmanager
    def _naming(self) -> Iterator[None]:
        """Errors inside name the given archive, not the folder it was unpacked to."""
        try:
            yield
        except RecordingError as error:
            if self._folder == self.path:
                raise
            raise RecordingError(str(error).replace(str(self._folder), str(self.path))) from error

    def read(self, topics: Collection[str]) -> Iterator[tuple[str, Message | None]]:
        """Messages of `topics` in the order they were recorded, as (topic, message); None for one that was left out.

        Raises:
            RecordingError: damage, or fewer messages than in the index of the bag.
        """
        counts = dict.fromkeys(topics, 0)
        with self._open() as reader:
            for topic, message in self._messages(reader, topics, None, self._left_out):
                counts[topic] += 1
                yield topic, message
        announced = {topic.name: topic.messages for topic in self.topics}
        for name, count in counts.items():
            if count != announced[name]:
                found = f"expected {announced[name]} messages on {name} as the bag's index says, found {count}"
                if self._left_out is None:
                    raise RecordingError(f"{self.path}: {found}")
                self._left_out.add("that are not in the file", f"{self.path}: {found}", abs(announced[name] - count))

    def first(self, topic: str, *, good: Callable[[Message], object] | None = None) -> Message:
        """The first message of `topic`; if damage is left out, the first one accepted by `good`.

        Args:
            topic: its name.
            good: raises a RecordingError for a message that cannot be used.

        Raises:
            RecordingError: damage, or no message although the index has some.
        """
        problem: RecordingError | None = None
        with self._open() as reader:
            for _, message in self._messages(reader, [topic], None, None if self._left_out is None else LeftOut()):
                if message is None:
                    continue
                try:
                    if good is not None and self._left_out is not None:
                        good(message)
                except RecordingError as error:
                    problem = problem or error
                    continue
                return message
        if problem is not None:
            raise problem
        raise RecordingError(f"{self.path}: expected messages on {topic} as the bag's index says, found none")

    def last(self, topic: str) -> Message:
        """The last message of `topic`; reads the end of the bag first."""
        found = None
        with self._open() as reader:
            for seconds in (1, 10, None):
                start = None if seconds is None else self.end_time - seconds * 1_000_000_000
                for _, message in self._messages(reader, [topic], start, None if self._left_out is None else LeftOut()):
                    found = message if message is not None else found
                if found is not None:
                    return found
        raise RecordingError(f"{self.path}: expected messages on {topic} as the bag's index says, found none")

    def frame_of(self, topic: str, message: Message) -> str:
        """The frame of a message: that of its header, except in bags of librealsense, whose frame ids are image numbers."""
        return realsense.frame_name(topic) if self.realsense else frame_of(message)

    def _check_metadata(self) -> None:
        """Compare metadata.yaml with the storage files: topics in only one of them would be left out silently."""
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
        with self._naming():
            with reading(self.path, "a complete ROS bag"):
                reader = AnyReader([self.file], default_typestore=_typestore())
                reader.open()
            try:
                yield reader
            finally:
                reader.close()

    def _messages(
        self, reader: AnyReader, topics: Collection[str], start: int | None, left_out: LeftOut | None
    ) -> Iterator[tuple[str, Message | None]]:
        connections = [connection for connection in reader.connections if connection.topic in topics]
        if not connections:
            return
        stream = reader.messages(connections, start=start)
        while True:
            try:
                with reading(self.path, "a complete ROS bag"):
                    item = next(stream, None)
            except RecordingError as error:
                if left_out is None:
                    raise
                left_out.add("rest of the file that cannot be read", error)
                return
            if item is None:
                return
            connection, _, raw = item
            try:
                with reading(f"{self.path}, topic {connection.topic}", f"a {connection.msgtype} message"):
                    if self.realsense and connection.topic.endswith("/image/data"):
                        raw = raw[: -realsense.EXTRA_BYTES]
                    message = reader.deserialize(raw, connection.msgtype)
            except RecordingError as error:
                if left_out is None:
                    raise
                left_out.add_error(error)
                message = None
            yield connection.topic, message


def _typestore() -> Typestore:
    """Bags of older ROS 2 releases have no message definitions; those used here are the same in all releases."""
    return get_typestore(Stores.ROS2_HUMBLE)


def _topics(reader: AnyReader) -> tuple[Topic, ...]:
    return tuple(Topic(name, str(item.msgtype), item.msgcount) for name, item in sorted(reader.topics.items()))


def find_bag(folder: Path) -> Path:
    """The bag in a folder: itself with metadata.yaml, else `bag/`, else the only .bag, .mcap or .db3 file in it.

    Raises:
        RecordingError: none, or several files without a metadata.yaml that orders them.
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


def _is_of_bag(name: str) -> bool:
    return name == "metadata.yaml" or name.endswith(_BAG_SUFFIXES)


def zip_members(path: Path) -> list[str]:
    """Names in a .zip.

    Raises:
        RecordingError: not a .zip, or a damaged one.
    """
    with reading(path, "a complete .zip file"), zipfile.ZipFile(path) as archive:
        return archive.namelist()


def _unpack(path: Path, folder: Path) -> None:
    with reading(path, "a complete .zip file"), zipfile.ZipFile(path) as archive:
        members = [member for member in archive.infolist() if not member.is_dir()]
        requested = [member for member in members if _is_of_bag(PurePosixPath(member.filename).name)]
        unpacked, packed = sum(member.file_size for member in requested), path.stat().st_size
        room = min(_MOST_UNPACKED, shutil.disk_usage(folder).free)
        if unpacked > room or unpacked > _LITTLE + _MOST_GAIN * packed:
            raise RecordingError(
                f"{path}: expected an archive that unpacks to at most {min(room, _LITTLE + _MOST_GAIN * packed)} bytes, "
                f"found {unpacked}"
            )
        for member in requested:
            name = PurePosixPath(member.filename).name
            if (folder / name).exists():
                raise RecordingError(f"{path}: expected one bag, found several files named {name}")
            with archive.open(member) as source, (folder / name).open("wb") as target:
                shutil.copyfileobj(source, target)


def check_mcap(path: Path) -> None:
    """Check that the records of an MCAP file are consecutive up to its footer and that the summary is valid.

    A reader that skips records by their length would silently skip a damaged length.
    See the MCAP specification, "Records" and "Footer".

    Raises:
        RecordingError: names the offset.
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
