"""Opens the files of a bag: MCAP, SQLite and ROS 1, and folders of the first two."""

from __future__ import annotations

import io
import os
from collections.abc import Collection, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path, PurePath
from typing import Any, TypeAlias, cast

from rosbags.interfaces import Connection
from rosbags.rosbag1 import Reader
from rosbags.rosbag1.reader import Header, IndexData, RecordType, decompressors, read_bytes, read_uint32
from rosbags.rosbag2.metadata import ReaderMetadata
from rosbags.rosbag2.reader import DirectoryReader

from voodoo.errors import RecordingError, reading
from voodoo.recordings.mcap_file import DAMAGED, Item, McapFile, is_plain_yaml, or_error
from voodoo.recordings.set_back import falls
from voodoo.recordings.sqlite_file import SqliteFile
from voodoo.stored import MOST_BYTES, MOST_METADATA, MOST_RECORDED, check_stored, read_stored_text
from voodoo.unpacking import Unpacking, count_zstd

_MOST_SKIPPED = 100
"""Records of connections between the place of a message in the index and the message: one is usual, and a hostile chunk has
millions before each."""


def bag_file(path: Path, unpacking: Unpacking, *, index: FolderIndex | None = None) -> BagFile:
    """The reader of a bag.

    Args:
        path: .bag, .mcap, .db3, or a folder with metadata.yaml.
        unpacking: limits compressed data.
        index: of this folder, if it was read before.

    Returns:
        A reader whose `messages` are in the order of their time, or as they were written if the clock was set back.

    Raises:
        RecordingError: another kind of file.
    """
    if path.is_dir():
        return BagFolder(path, unpacking, index)
    if path.suffix.lower() == ".mcap":
        return McapFile(path, unpacking)
    if path.suffix.lower() == ".db3":
        return SqliteFile(path)
    check_stored(path, "a complete ROS bag", most=MOST_RECORDED)
    return Ros1File(path, unpacking)


class Ros1File(Reader):
    """Reads a .bag; messages in a damaged chunk are errors, and those in other chunks are read."""

    def __init__(self, path: Path, unpacking: Unpacking) -> None:
        """Read nothing yet."""
        super().__init__(path)
        self._unpacking = unpacking
        self._last: tuple[int, bytes | RecordingError] = (-1, b"")
        self._size, self._indexed = path.stat().st_size, 0

    def read_index_data(self, pos: int, indexes: dict[int, list[IndexData]]) -> None:
        """Read the index of a connection in a chunk; a hostile file has many chunks with one index."""
        assert self.bio is not None
        before = self.bio.tell()
        super().read_index_data(pos, indexes)
        self._indexed += self.bio.tell() - before
        if self._indexed > self._size:
            raise ValueError("expected an index of its own for each chunk, found one again")

    @property
    def metadata(self) -> ReaderMetadata:
        """Times and number of messages."""
        start, end = self.start_time, self.end_time
        return ReaderMetadata(max(end - start, 0), start, end, self.message_count, None, None, None, None)

    def messages(self, connections: Collection[Connection], start: int | None = None) -> Iterator[Item]:  # type: ignore[override]
        """See bag_file."""
        first = -1 if start is None else start
        entries = [(entry, one) for one in connections for entry in self.indexes[one.id] if first <= entry.time]
        entries.sort(key=lambda item: (item[0].chunk_pos, item[0].offset))
        if not falls((one.id, entry.time) for entry, one in entries):
            entries.sort(key=lambda item: item[0].time)
        for entry, one in entries:
            sound = f"a sound chunk at byte {entry.chunk_pos}"
            yield one, entry.time, or_error(partial(self._message, entry), self.path, sound, reason=DAMAGED)

    def _message(self, entry: IndexData) -> bytes:
        if self._last[0] != entry.chunk_pos:
            read, sound = partial(self._content, entry.chunk_pos), f"a sound chunk at byte {entry.chunk_pos}"
            self._last = entry.chunk_pos, or_error(read, self.path, sound)
        content = self._last[1]
        if isinstance(content, RecordingError):  # told for each of its messages
            raise content
        chunk = io.BytesIO(content)
        chunk.seek(entry.offset)
        for _ in range(_MOST_SKIPPED):
            if (header := Header.read(chunk)).get_uint8("op") != RecordType.CONNECTION:
                break
            chunk.seek(read_uint32(chunk), os.SEEK_CUR)
        if header.get_uint8("op") != RecordType.MSGDATA or header.get_time("time") != entry.time:
            raise ValueError("expected a message, found none")
        return read_bytes(chunk, read_uint32(chunk))

    def _content(self, position: int) -> bytes:
        assert self.bio is not None
        chunk = self.chunks[position]
        if chunk.datasize > MOST_BYTES:
            raise ValueError(f"expected {MOST_BYTES} bytes at most, found {chunk.datasize}")
        self.bio.seek(chunk.datapos)
        data = read_bytes(self.bio, chunk.datasize)
        compression = next(name for name, function in decompressors.items() if function is chunk.decompressor)
        return data if compression == "none" else self._unpacking.unpack(data, compression)


@dataclass(frozen=True)
class FolderIndex:
    """What metadata.yaml of a folder says: its topics, times, and the files with the format of each."""

    connections: tuple[Connection, ...]
    metadata: ReaderMetadata
    parts: tuple[tuple[str, Path], ...]


class BagFolder(DirectoryReader):
    """Reads a folder of MCAP or SQLite files in the order given by its metadata.yaml."""

    def __init__(self, path: Path, unpacking: Unpacking, index: FolderIndex | None = None) -> None:
        """Read nothing yet; with an index, metadata.yaml is not read again: its YAML takes long."""
        super().__init__(path)
        self._folder, self._unpacking, self._index = path, unpacking, index
        self.STORAGE_PLUGINS: Any = {"mcap": partial(McapFile, unpacking=unpacking), "sqlite3": SqliteFile}

    @property
    def index(self) -> FolderIndex | None:
        """For the next reader of this folder, while this one is open; None where files are unpacked for each reader."""
        if self.metadata.compression_mode == "file":
            return None
        parts = tuple(
            ("mcap" if isinstance(part, McapFile) else "sqlite3", Path(str(part.path))) for part in self._parts
        )
        return FolderIndex(tuple(self.connections), self.metadata, parts)

    @property
    def _parts(self) -> list[McapFile | SqliteFile]:
        return cast(list[McapFile | SqliteFile], self.storages)

    def open(self) -> None:
        """Read metadata.yaml, if there is no index yet, and the index of each file."""
        if self._index is None:
            self._read()
            return
        with ExitStack() as stack:
            for name, path in self._index.parts:
                part = self.STORAGE_PLUGINS[name](path)
                part.open()
                stack.callback(part.close)
                self.storages.append(part)
            self.connections, self.metadata = list(self._index.connections), self._index.metadata
            self.stack = stack.pop_all()

    def _read(self) -> None:
        """Check metadata.yaml and the size of the files, and read the index of each."""
        yaml = self._folder / "metadata.yaml"
        text = read_stored_text(yaml, "the metadata of a ROS 2 bag", most=MOST_METADATA)
        if not is_plain_yaml(text):
            raise RecordingError(f"{yaml}: expected the metadata of a ROS 2 bag, found references or deep nesting")
        for part in sorted(self._folder.iterdir()):
            if part.suffix == ".zstd":
                check_stored(part, "a complete ROS bag", most=MOST_RECORDED)
                with reading(part, "a file of zstd"):
                    count_zstd(part, self._unpacking)
        super().open()
        for item in self.connections:
            if not (isinstance(item.topic, str) and isinstance(item.msgtype, str) and isinstance(item.msgcount, int)):
                raise RecordingError(f"{yaml}: expected the index of a ROS bag, found a topic {item[1:3]!r:.100}")
        names = [PurePath(str(part.path)).name for part in self._parts]
        if len(set(names)) != len(names):
            raise RecordingError(f"{yaml}: expected every file once, found {', '.join(sorted(names))[:300]}")

    def messages(self, connections: Collection[Connection], start: int | None = None) -> Iterator[Item]:  # type: ignore[override]
        """Messages in the order of the files."""
        chosen = {(item.topic, item.msgtype): item for item in connections}
        for storage in self.storages:
            own = [item for item in storage.connections if (item.topic, item.msgtype) in chosen]
            found: Iterator[Any] = storage.messages(own, start) if own else iter(())
            for item, time, data in found:
                if self.metadata.compression_mode == "message" and isinstance(data, bytes):
                    unpack = partial(self._unpacking.unpack, data, "zstd")
                    data = or_error(unpack, f"{self._folder}, topic {item.topic}", "a message compressed by zstd")
                yield chosen[item.topic, item.msgtype], time, data


BagFile: TypeAlias = Ros1File | BagFolder | McapFile | SqliteFile
"""What bags are read by."""
