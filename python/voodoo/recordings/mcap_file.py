"""MCAP files through rosbags, checked before and read on behind damaged chunks."""

from __future__ import annotations

import heapq
import itertools
import math
import re
import struct
import zlib
from collections import Counter
from collections.abc import Callable, Collection, Iterator
from pathlib import Path
from typing import TypeVar

from rosbags.interfaces import Connection
from rosbags.rosbag2.storage_mcap import ChunkInfo, McapReader

from voodoo.errors import RecordingError, reading
from voodoo.recordings.set_back import BACK_S, falls
from voodoo.stored import MOST_BYTES, MOST_METADATA, MOST_RECORDED, check_stored
from voodoo.unpacking import Unpacking

T = TypeVar("T")
_MAGIC = b"\x89MCAP0\r\n"
_FOOTER, SCHEMA, CHANNEL, MESSAGE, _CHUNK, _MESSAGE_INDEX, _DATA_END = 0x02, 0x03, 0x04, 0x05, 0x06, 0x07, 0x0F
_ATTACHMENT, _METADATA = 0x09, 0x0C
_MOST = {_ATTACHMENT: 2**63} | dict.fromkeys((_CHUNK, MESSAGE, _MESSAGE_INDEX, _METADATA), MOST_BYTES)
"""Largest size of a record that is more than metadata [bytes]."""
_MOST_OF_ALL = {SCHEMA: 16 * MOST_METADATA, CHANNEL: MOST_METADATA}
"""Largest size of all schemas, and of all channels [bytes]."""
_ANCHOR = re.compile(r"(?m)(?:^|[\s\[{,])[&*][^\s,\]}]")
_MOST_NESTED, _MOST_COMMAS = 50, 10_000
_MOST_LOST = 100_000
_INDEX_BYTES = 16
"""Largest number of messages that damaged chunks are taken to have had, and the size of each in the index of the file, because
that may be damaged as well."""
DAMAGED = "in a damaged chunk"
"""Reason of messages that are left out."""

Item = tuple[Connection, int, bytes | RecordingError]
"""Connection, time [ns] and bytes of a message, or why it cannot be read."""


def or_error(read: Callable[[], T], where: object, expected: str, *, reason: str = "") -> T | RecordingError:
    """What `read` returns, or the error by which it fails.

    Args:
        read: reads a part of a file.
        where, expected: see voodoo.errors.reading.
        reason: of the error; "": its own.
    """
    try:
        with reading(where, expected):
            return read()
    except RecordingError as error:
        return RecordingError(str(error), reason=reason or error.reason)


class McapFile(McapReader):
    """Reads an MCAP file; messages in a damaged chunk are errors, and those in other chunks are read.

    Args:
        path: the file.
        unpacking: limits chunks.
    """

    def __init__(self, path: Path, unpacking: Unpacking) -> None:
        """Read nothing yet."""
        super().__init__(path)
        self._file, self._unpacking = path, unpacking
        self._chunks: frozenset[int] = frozenset()
        self._last: tuple[int, bytes] = (-1, b"")

    def open(self) -> None:
        """Check the file, and read its summary."""
        check_stored(self._file, "a complete ROS bag", most=MOST_RECORDED)
        self._chunks = check_mcap(self._file)
        super().open()

    def meta_scan(self) -> None:
        """Read messages that are in no chunk, for a summary."""
        self._refuse_unindexed()
        super().meta_scan()

    def _refuse_unindexed(self) -> None:
        if self._chunks:
            raise RecordingError(
                f"{self._file}: expected an index of the chunks, found none (`mcap recover {self._file} --output "
                "FILE.mcap` makes one)"
            )

    def messages(self, connections: Collection[Connection], start: int | None = None) -> Iterator[Item]:  # type: ignore[override]
        """Messages in the order of their time, or as they were written if the clock was set back."""
        if not self.chunks:
            self._refuse_unindexed()
            yield from super().messages(connections, start)
            return
        if len({chunk.chunk_start_offset for chunk in self.chunks}) != len(self.chunks):
            raise RecordingError(f"{self._file}: expected every chunk once in the index, found one again")
        chosen = {item.id: item for item in connections}
        first = -1 if start is None else start
        # The first item of every chunk is its start, so that a chunk is unpacked only when its time has come.
        is_back = self._is_back(chosen)
        plausible = iter(range(min(_MOST_LOST, self._file.stat().st_size // _INDEX_BYTES)))
        sources = [
            self._of_chunk(chunk, chosen, first, plausible, as_written=is_back)
            for chunk in self._in_file()
            if first <= chunk.message_end_time
            and (not chunk.message_index_offsets or any(chunk.channel_count.get(one, 0) for one in chosen))
        ]
        in_turn = is_back or self._longest_step_back() <= 0
        for _, _, item in itertools.chain(*sources) if in_turn else heapq.merge(*sources, key=lambda entry: entry[:2]):
            if item is not None:
                yield item

    def _in_file(self) -> list[ChunkInfo]:
        """The chunks in the order of the file."""
        return sorted(self.chunks, key=lambda chunk: chunk.chunk_start_offset)

    def _longest_step_back(self) -> float:
        """From the end of a chunk to the beginning of the next one in the file [ns]; infinite for a single chunk."""
        pairs = itertools.pairwise(self._in_file())
        return max((before.message_end_time - chunk.message_start_time for before, chunk in pairs), default=math.inf)

    def _is_back(self, chosen: Collection[int]) -> bool:
        """Whether the clock of the recorder was set back; chunks are unpacked only where times of two are apart."""
        if self._longest_step_back() < BACK_S * 1e9:
            return False
        try:
            read = (entry for chunk in self._in_file() for entry in _messages(self._content(chunk)))
            return falls((one, time) for one, time, _, _ in read if one in chosen)
        except Exception:
            return False  # the damage is told where the messages are read

    def _of_chunk(
        self, chunk: ChunkInfo, chosen: dict[int, Connection], first: int, plausible: Iterator[int], *, as_written: bool
    ) -> Iterator[tuple[int, int, Item | None]]:
        yield chunk.message_start_time, 0, None
        content, found = b"", []
        lost: RecordingError | None = None
        try:
            with reading(self._file, f"a sound chunk at byte {chunk.chunk_start_offset}"):
                content = self._content(chunk)
                for one, time, begin, end in _messages(content):
                    if one in chosen and first <= time:
                        found.append((time, one, begin, end))
        except RecordingError as error:
            lost = RecordingError(str(error), reason=DAMAGED)
        if not as_written:
            found.sort(key=lambda entry: entry[0])
        for time, one, begin, end in found:
            yield time, chunk.chunk_start_offset, (chosen[one], time, content[begin:end])
        if lost is None:
            return
        for one, connection in chosen.items():
            count = chunk.channel_count.get(one, 0) - sum(entry[1] == one for entry in found)
            for _ in itertools.islice(plausible, max(count, 0)):
                yield chunk.message_end_time, chunk.chunk_start_offset, (connection, chunk.message_end_time, lost)

    def _content(self, chunk: ChunkInfo) -> bytes:
        """The records in a chunk; the last one is kept, because several topics are looked for in it."""
        if self._last[0] == chunk.chunk_start_offset:
            return self._last[1]
        if chunk.chunk_start_offset not in self._chunks:
            raise ValueError("found no chunk there")
        assert self.bio is not None
        self.bio.seek(chunk.chunk_start_offset + 9)
        # See the MCAP specification, "Chunk".
        _, _, size, checksum, words = struct.unpack("<QQQII", self.bio.read(32))
        compression = self.bio.read(min(words, 16)).decode()
        (packed,) = struct.unpack("<Q", self.bio.read(8))
        if packed > chunk.chunk_length or packed > MOST_BYTES:
            raise ValueError(f"expected at most {min(chunk.chunk_length, MOST_BYTES)} bytes, found {packed}")
        content = self.bio.read(packed)
        if compression:
            content = self._unpacking.unpack(content, compression, declared=size)
        if len(content) != size:
            raise ValueError(f"expected {size} bytes, found {len(content)}")
        if checksum and zlib.crc32(content) != checksum:
            raise RecordingError(
                f"{self._file}: expected a sound chunk at byte {chunk.chunk_start_offset}, found a wrong checksum"
            )
        self._last = chunk.chunk_start_offset, content
        return content


def records(content: bytes) -> Iterator[tuple[int, int, int]]:
    """Code, begin and end of the records in a chunk."""
    at = 0
    while at < len(content):
        code, length = struct.unpack_from("<BQ", content, at)
        at += 9
        if at + length > len(content):
            raise ValueError(f"expected {len(content) - at} bytes at most in a record, found {length}")
        yield code, at, at + length
        at += length


def _messages(content: bytes) -> Iterator[tuple[int, int, int, int]]:
    """Channel and time [ns] of the messages in a chunk, and begin and end of each."""
    for code, begin, end in records(content):
        if code == MESSAGE:
            if end - begin < 22:
                raise ValueError(f"expected a message of 22 bytes or more, found {end - begin}")
            channel, _, time, _ = struct.unpack_from("<HIQQ", content, begin)
            yield channel, time, begin + 22, end


def stored_records(path: Path) -> Iterator[bytes]:
    """The content of the chunks without compression up to where a file is cut off.

    Raises:
        ValueError: no MCAP file.
    """
    check_stored(path, "an MCAP file", most=MOST_RECORDED)
    with path.open("rb") as file:
        if file.read(8) != _MAGIC:
            raise ValueError("found other bytes at its start")
        while len(head := file.read(9)) == 9:
            code, length = struct.unpack("<BQ", head)
            if length > MOST_BYTES or len(body := file.read(length)) < length:
                return
            if code == _CHUNK and body[28:32] == bytes(4):
                yield body[40:]


def is_plain_yaml(text: str) -> bool:
    """Whether a parser is safe with a text: a few lines that refer to each other describe billions of entries, and it takes
    minutes for long lists in brackets."""
    steps = (1 if letter in "[{" else -1 for letter in re.findall(r"[\[\]{}]", text))
    nested = max(itertools.accumulate(steps), default=0)
    return not _ANCHOR.search(text) and nested <= _MOST_NESTED and text.count(",") <= _MOST_COMMAS


def check_mcap(path: Path) -> frozenset[int]:
    """Check that the records of an MCAP file are consecutive up to its footer, of plausible size, and the summary is valid.

    A reader that skips records by their length would silently skip a damaged length, and one that reads them as a whole
    would fill the memory. See the MCAP specification, "Records" and "Footer".

    Returns:
        where the chunks begin.

    Raises:
        RecordingError: names the offset.
    """
    size = path.stat().st_size
    chunks, ends, described = set[int](), {0}, Counter[int]()
    with reading(path, "a readable file"), path.open("rb") as file:
        if file.read(8) != _MAGIC:
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
            if code == _FOOTER:
                break
            if length > (most := _MOST.get(code, MOST_METADATA)):
                raise RecordingError(
                    f"{path}: expected a record of {most} bytes at most, found {length} bytes at byte {position}"
                )
            if code == _CHUNK:
                chunks.add(position)
            elif code == _DATA_END:
                ends.add(position + 9 + length)
            described[code] += length
            if described[code] > _MOST_OF_ALL.get(code, described[code]):
                raise RecordingError(
                    f"{path}: expected {_MOST_OF_ALL[code]} bytes of schemas or channels at most, found more"
                )
            quality = file.read(length).partition(b"offered_qos_profiles")[2] if code == CHANNEL else b""
            if not is_plain_yaml(quality[4:].decode("latin-1")):
                raise RecordingError(f"{path}: expected a channel at byte {position}, found nested metadata")
            position += 9 + length
            file.seek(position)
        footer = file.read(length)
        if length != 20 or file.read() != _MAGIC:
            raise RecordingError(f"{path}: expected an MCAP footer at byte {position}, found damage")
        summary_start, _, summary_crc = struct.unpack("<QQI", footer)
        if summary_start not in ends:
            raise RecordingError(f"{path}: expected the summary behind the data, found it at byte {summary_start}")
        if summary_crc:
            file.seek(summary_start)
            checksum = 0
            while part := file.read(min(position + 25 - file.tell(), 2**20)):
                checksum = zlib.crc32(part, checksum)
            if checksum != summary_crc:
                raise RecordingError(f"{path}: expected a sound MCAP summary, found a wrong checksum")
    return frozenset(chunks)
