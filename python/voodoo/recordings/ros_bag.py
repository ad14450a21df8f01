"""Access to the messages of ROS 1 and ROS 2 bags, with every failure converted to a RecordingError.

What a bag says of its message types is compared with the definitions of ROS, and not executed.
"""

from __future__ import annotations

import shutil
import tempfile
import zipfile
from collections import Counter, deque
from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path, PurePosixPath

from rosbags.interfaces import Connection, MessageDefinitionFormat
from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from voodoo.errors import RecordingError, reading
from voodoo.names import ROS1_SUFFIXES, ROS2_SUFFIXES
from voodoo.recordings import realsense
from voodoo.recordings.bag_files import BagFile, BagFolder, FolderIndex, bag_file
from voodoo.recordings.left_out import LeftOut, leave_out
from voodoo.recordings.mcap_file import or_error
from voodoo.recordings.ros_messages import Message, frame_of
from voodoo.stored import MOST_RECORDED, check_stored
from voodoo.unpacking import Unpacking

TF_TYPES = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")
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
            for name in TF_TYPES:
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
        for name in found.keys() & self._store.fielddefs.keys():
            if found[name][1] != self._store.fielddefs[name][1]:
                raise RecordingError(f"{where}: expected {name} as in ROS 2, found a message with other fields")

    def deserialize(self, data: bytes, kind: str) -> object:
        """The message in these bytes.

        Raises:
            Exception: damage, of many kinds.
        """
        read = self._store.deserialize_cdr if self._is_ros2 else self._store.deserialize_ros1
        return read(data, kind)


_SUFFIXES = (*ROS1_SUFFIXES, *ROS2_SUFFIXES)
_ADVICE = "; --option unpacked_gb=N allows N gigabytes"


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
        unpacked: largest size of an unpacked archive, chunk or message [bytes]; None: see voodoo.unpacking.Unpacking.

    Raises:
        RecordingError: there is no bag, or its index is damaged.
    """

    def __init__(self, path: Path, *, left_out: LeftOut | None = None, unpacked: int | None = None) -> None:
        """Unpack the archive if needed, and read the index."""
        self.path = path
        self._left_out, self._unpacked = left_out, unpacked
        self._reader: BagFile | None = None
        self._index: FolderIndex | None = None
        folder = path
        if path.suffix.lower() == ".zip":
            self._unpacked_to = tempfile.TemporaryDirectory(prefix="voodoo-", ignore_cleanup_errors=True)
            folder = Path(self._unpacked_to.name)
            _unpack(path, folder, unpacked)
        self._folder = folder
        with self._naming():
            self.file = find_bag(folder) if folder.is_dir() else folder
        self.is_ros2: bool = self.file.suffix.lower() not in ROS1_SUFFIXES
        self._types = MessageTypes(is_ros2=self.is_ros2)
        with self._open() as reader:
            with reading(self.path, "the index of a ROS bag"):
                self.topics = _topics(reader.connections)
                self.realsense: bool = not self.is_ros2 and realsense.is_recorders(item.name for item in self.topics)
                self.start_time: int = reader.metadata.start_time
                self.end_time: int = reader.metadata.end_time
            for topic in self.topics:
                if not 0 <= topic.messages <= MOST_RECORDED:
                    raise RecordingError(
                        f"{self.path}: expected the number of messages on {topic.name} in the index, found {topic.messages}"
                    )
            if isinstance(reader, BagFolder):
                self._check_metadata(reader)
                self._index = reader.index

    @contextmanager
    def _naming(self) -> Iterator[None]:
        """Errors inside name the given archive, not the folder it was unpacked to."""
        try:
            yield
        except RecordingError as error:
            if self._folder == self.path:
                raise
            raise self._named(error) from error

    def _named(self, error: RecordingError) -> RecordingError:
        return type(error)(str(error).replace(str(self._folder), str(self.path)), reason=error.reason, hint=error.hint)

    def read(self, topics: Collection[str]) -> Iterator[tuple[str, Message | None]]:
        """Messages of `topics` in the order they were recorded, as (topic, message); None for one that was left out.

        Raises:
            RecordingError: damage, or fewer messages than in the index of the bag.
        """
        counts = dict.fromkeys(topics, 0)
        try:
            for topic, message in self._messages(topics):
                counts[topic] += 1
                if isinstance(message, RecordingError):
                    leave_out(self._left_out, message)
                    message = None
                yield topic, message
        except _Stopped as error:
            leave_out(self._left_out, RecordingError(str(error)), "rest of the file that cannot be read")
        announced = {topic.name: topic.messages for topic in self.topics}
        for name, count in counts.items():
            if count != announced[name]:
                found = f"expected {announced[name]} messages on {name} as the bag's index says, found {count}"
                missing = RecordingError(f"{self.path}: {found}")
                leave_out(self._left_out, missing, "that are not in the file", abs(announced[name] - count))

    def first(self, topic: str, *, good: Callable[[Message], object] | None = None) -> Message:
        """The first message of `topic`; if damage is left out, the first one accepted by `good`.

        Args:
            topic: its name.
            good: raises a RecordingError for a message that cannot be used.

        Raises:
            RecordingError: damage, or no message although the index has some.
        """
        problems: list[RecordingError] = []
        for message in self._usable(topic, problems, good=good):
            return message
        raise (problems or [self._without(topic)])[0]

    def _usable(
        self,
        topic: str,
        problems: list[RecordingError],
        start: int | None = None,
        good: Callable[[Message], object] | None = None,
    ) -> Iterator[Message]:
        """The messages of a topic; if damage is left out, those that can be used, and `problems` get the others."""
        for _, message in self._messages([topic], start):
            try:
                if isinstance(message, RecordingError):
                    raise message
                if good is not None and self._left_out is not None:
                    good(message)
            except RecordingError as error:
                if self._left_out is None:
                    raise
                problems.append(error)
            else:
                yield message

    def last(self, topic: str) -> Message:
        """The last message of `topic`; reads the end of the bag first."""
        problems: list[RecordingError] = []
        for seconds in (1, 10, None):
            start = None if seconds is None else self.end_time - seconds * 1_000_000_000
            if found := deque(self._usable(topic, problems, start), maxlen=1):
                return found[0]
        raise (problems or [self._without(topic)])[0]

    def _without(self, topic: str) -> RecordingError:
        return RecordingError(f"{self.path}: expected messages on {topic} as the bag's index says, found none")

    def frame_of(self, topic: str, message: Message) -> str:
        """The frame of a message: that of its header, except in bags of librealsense, whose frame ids are image numbers."""
        return realsense.frame_name(topic) if self.realsense else frame_of(message)

    def _check_metadata(self, reader: BagFolder) -> None:
        """Compare metadata.yaml with the storage files: topics in only one of them would be left out silently."""
        listed = {storage.path.name for storage in reader.storages}  # type: ignore[attr-defined]
        beside = sorted(part.name for part in self.file.iterdir() if part.suffix.lower() in ROS2_SUFFIXES)
        if any(name not in listed for name in beside):
            raise RecordingError(
                f"{self.file / 'metadata.yaml'}: expected all of {', '.join(beside)}, found {', '.join(sorted(listed))} "
                "(`ros2 bag reindex` repairs it, or open the storage file itself)"
            )
        stored: Counter[tuple[str, str]] = Counter()
        for storage in reader.storages:
            stored.update({(topic.name, topic.type): topic.messages for topic in _topics(storage.connections)})
        announced = Counter({(topic.name, topic.type): topic.messages for topic in self.topics})
        for name, kind in sorted(stored.keys() | announced.keys()):
            expected, found = announced[name, kind], stored[name, kind]
            if expected != found:
                raise RecordingError(
                    f"{self.file / 'metadata.yaml'}: expected {found} messages on {name} ({kind}) as in the storage "
                    f"file, found {expected} (`ros2 bag reindex` repairs it, or open the storage file itself)"
                )

    @contextmanager
    def kept_open(self) -> Iterator[None]:
        """Inside, `first`, `last` and `read` one after the other open and check the bag once, not each of them."""
        with self._open() as self._reader:
            try:
                yield
            finally:
                self._reader = None

    @contextmanager
    def _open(self) -> Iterator[BagFile]:
        with self._naming():
            if self._reader is not None:
                yield self._reader
                return
            with reading(self.path, "a complete ROS bag"):
                reader = bag_file(self.file, Unpacking(self._unpacked, kept=False, advice=_ADVICE), index=self._index)
                reader.open()
            try:
                yield reader
            finally:
                reader.close()

    def _messages(
        self, topics: Collection[str], start: int | None = None
    ) -> Iterator[tuple[str, Message | RecordingError]]:
        """Topic and message, or why it cannot be read.

        Raises:
            RecordingError: the file, or the definition of the messages of a topic, cannot be read.
            _Stopped: the rest of the file cannot be read.
        """
        with self._open() as reader:
            connections = [item for item in reader.connections if item.topic in topics]
            for item in connections:
                self._types.check(item, self.path)
            stream = reader.messages(connections, start) if connections else iter(())
            while True:
                try:
                    with reading(self.path, "a complete ROS bag"):
                        found = next(stream, None)
                except RecordingError as error:
                    raise _Stopped(str(error)) from error
                if found is None:
                    return
                connection, _, data = found
                yield connection.topic, self._message(connection, data)

    def _message(self, connection: Connection, data: bytes | RecordingError) -> Message | RecordingError:
        if isinstance(data, RecordingError):
            return self._named(data)
        if self.realsense and connection.topic.endswith("/image/data"):
            data = data[: -realsense.EXTRA_BYTES]
        read = partial(self._types.deserialize, data, connection.msgtype)
        return or_error(read, f"{self.path}, topic {connection.topic}", f"a {connection.msgtype} message")


class _Stopped(RecordingError):
    """A bag of which the rest cannot be read."""


def _topics(connections: Iterable[Connection]) -> tuple[Topic, ...]:
    """One for each name; its type is "None" if the connections of that name do not agree."""
    named: dict[str, list[Connection]] = {}
    for item in connections:
        named.setdefault(item.topic, []).append(item)
    return tuple(
        Topic(
            name,
            str(items[0].msgtype if len({item.msgtype for item in items}) == 1 else None),
            sum(item.msgcount for item in items),
        )
        for name, items in sorted(named.items())
    )


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
            files = sorted(item for item in candidate.iterdir() if item.suffix.lower() in _SUFFIXES and item.is_file())
            if len(files) == 1:
                return files[0]
            if files:
                names = ", ".join(item.name for item in files)
                raise RecordingError(f"{candidate}: expected a metadata.yaml or a single bag file, found {names}")
    raise RecordingError(f"{folder}: expected a ROS bag (metadata.yaml, .mcap, .db3 or .bag), found none")


def _is_of_bag(name: str) -> bool:
    parts = (suffix + more for suffix in _SUFFIXES for more in ("", ".zstd", "-wal", "-journal"))
    return name == "metadata.yaml" or name.lower().endswith(tuple(parts))


def zip_members(path: Path) -> list[str]:
    """Names in a .zip.

    Raises:
        RecordingError: not a .zip, or a damaged one.
    """
    check_stored(path, "a complete .zip file", most=MOST_RECORDED)
    with reading(path, "a complete .zip file"), zipfile.ZipFile(path) as archive:
        return archive.namelist()


def _unpack(path: Path, folder: Path, most: int | None) -> None:
    with reading(path, "a complete .zip file"), zipfile.ZipFile(path) as archive:
        members = [member for member in archive.infolist() if not member.is_dir()]
        requested = [member for member in members if _is_of_bag(PurePosixPath(member.filename).name)]
        unpacked = sum(member.file_size for member in requested)
        Unpacking(most, advice=_ADVICE).check(path.stat().st_size, unpacked)
        if unpacked > shutil.disk_usage(folder).free:
            raise RecordingError(f"{path}: expected {unpacked} free bytes in {folder.parent} to unpack it, found fewer")
        for member in requested:
            name = PurePosixPath(member.filename).name
            if (folder / name).exists():
                raise RecordingError(f"{path}: expected one bag, found several files named {name}")
            with archive.open(member) as source, (folder / name).open("wb") as target:
                shutil.copyfileobj(source, target)
