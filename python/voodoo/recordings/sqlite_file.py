"""SQLite files of ROS 2 (.db3): only plain tables are read, and what a recorder that was killed left beside the file."""

from __future__ import annotations

import shutil
import sqlite3
import tempfile
from collections.abc import Collection, Iterator
from functools import lru_cache, partial
from pathlib import Path
from typing import Any
from urllib.parse import quote

from rosbags.interfaces import Connection, ConnectionExtRosbag2, MessageDefinition, MessageDefinitionFormat
from rosbags.rosbag2.metadata import ReaderMetadata

from voodoo.errors import RecordingError, reading
from voodoo.recordings.mcap_file import Item, or_error
from voodoo.recordings.set_back import falls
from voodoo.stored import MOST_BYTES, MOST_METADATA, MOST_RECORDED, check_stored

_HOT_JOURNAL = bytes.fromhex("d9d505f920a163d7")
_MOST_TABLES = 100
_MOST_TOPICS = 10_000
_STEPS = 1_000_000
"""A query is ended after 100 million steps of SQLite's machine and 100 for each byte of the file: a bag takes a few for each
message."""
_FORMATS = {"ros2msg": MessageDefinitionFormat.MSG, "ros2idl": MessageDefinitionFormat.IDL}
DAMAGED = "in a damaged part of the file"
"""Reason of messages that are left out."""


@lru_cache(maxsize=1)
def _copied(path: Path, log: Path, _state: tuple[int, ...]) -> tempfile.TemporaryDirectory[str]:
    """A folder with a copy of a file and its log in a state, which exists as long as this object; a bag is opened several
    times."""
    folder = tempfile.TemporaryDirectory(prefix="voodoo-", ignore_cleanup_errors=True)
    shutil.copyfile(path, Path(folder.name) / "bag.db3")
    shutil.copyfile(log, Path(folder.name) / "bag.db3-wal")
    return folder


class SqliteFile:
    """Reads a .db3, with the interface of the storages of rosbags.

    Args:
        path: the file.

    Attributes:
        connections: the topics.
        metadata: times and number of messages.
    """

    def __init__(self, path: Path) -> None:
        """Read nothing yet."""
        self.path = path
        self.connections: list[Connection] = []
        self.metadata = ReaderMetadata(0, 2**63 - 1, 0, 0, None, None, None, None)
        self._base: sqlite3.Connection | None = None
        self._copy: tempfile.TemporaryDirectory[str] | None = None

    def open(self) -> None:
        """Check the schema, and read topics and times.

        Raises:
            RecordingError: not a bag, a schema with more than tables, or an unfinished transaction.
        """
        try:
            with reading(self.path, "a ROS 2 bag in SQLite"):
                self._base = self._connected()
                self._check_schema()
                self._read_topics()
        except RecordingError:
            self.close()
            raise

    def close(self) -> None:
        """Close the file."""
        if self._base is not None:
            self._base.close()
        self._base = self._copy = None

    def _connected(self) -> sqlite3.Connection:
        """The open database: the file itself, or a copy with the log in it."""
        check_stored(self.path, "a ROS 2 bag in SQLite", most=MOST_RECORDED)
        journal, log = (self.path.with_name(self.path.name + suffix) for suffix in ("-journal", "-wal"))
        if journal.exists():
            check_stored(journal, "a journal of SQLite", most=MOST_RECORDED)
            with journal.open("rb") as file:
                if file.read(8) == _HOT_JOURNAL:
                    raise RecordingError(
                        f"{self.path}: expected a finished bag, found an unfinished transaction in {journal.name} "
                        f"(`sqlite3 {self.path} .schema` undoes it)"
                    )
        path, options = self.path, "immutable=1"
        if log.exists():
            check_stored(log, "a log of SQLite", most=MOST_RECORDED)
            if log.stat().st_size:
                states = [part.stat() for part in (path, log)]
                state = tuple(number for found in states for number in (found.st_ino, found.st_size, found.st_mtime_ns))
                self._copy = _copied(path, log, state)
                path, options = Path(self._copy.name) / "bag.db3", "mode=rw"
        base = sqlite3.connect(f"file:{quote(str(path.absolute()))}?{options}", uri=True, check_same_thread=False)
        base.execute("PRAGMA trusted_schema=OFF")
        base.execute("PRAGMA query_only=ON")
        return base

    def _rows(self, query: str, values: Collection[Any] = ()) -> sqlite3.Cursor:
        """The rows of a query that ends."""
        assert self._base is not None
        left = iter(range(100 + 100 * self.path.stat().st_size // _STEPS))
        self._base.set_progress_handler(lambda: next(left, None) is None, _STEPS)
        return self._base.execute(query, tuple(values))

    def _check_schema(self) -> None:
        """Refuse whatever computes: views, triggers, virtual tables, generated columns, indexes of expressions."""
        found = list(
            self._rows(
                "SELECT type, name, substr(sql, 1, 30) FROM sqlite_master WHERE length(coalesce(sql, '')) < ? LIMIT ?",
                (MOST_METADATA, _MOST_TABLES + 1),
            )
        )
        ((count,),) = self._rows("SELECT count(*) FROM sqlite_master")
        if count > _MOST_TABLES or len(found) != count:
            raise ValueError(f"expected {_MOST_TABLES} tables at most, found {count}")
        tables = set()
        for kind, name, text in found:
            plain = str(text or "").upper().startswith("CREATE TABLE") if kind == "table" else kind == "index"
            if not plain:
                raise ValueError(f"expected tables only, found {kind} {str(name)!r:.60}")
            if kind == "table":
                tables.add(name)
            pragma, flag = ("table_xinfo", 6) if kind == "table" else ("index_xinfo", 1)
            for row in self._rows(f"SELECT * FROM pragma_{pragma}(?)", (name,)):
                if row[flag] != 0 if kind == "table" else row[flag] == -2:
                    raise ValueError(f"expected plain columns, found one that is computed in {str(name)!r:.60}")
        if not {"messages", "topics"} <= tables:
            raise ValueError("expected the tables messages and topics, found none")
        self._tables = tables

    def _read_topics(self) -> None:
        definitions: dict[str, MessageDefinition] = {}
        if "message_definitions" in self._tables:
            for kind, encoding, text in self._rows(
                "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions "
                "WHERE length(encoded_message_definition) <= ? LIMIT ?",
                (MOST_METADATA, _MOST_TOPICS),
            ):
                if encoding in _FORMATS:
                    definitions.setdefault(str(kind), MessageDefinition(_FORMATS[encoding], str(text)))
        counts = dict(self._rows("SELECT topic_id, count(*) FROM messages GROUP BY topic_id"))
        nothing = MessageDefinition(MessageDefinitionFormat.NONE, "")
        topics = list(
            self._rows(
                "SELECT id, name, type, serialization_format FROM topics WHERE length(name) + length(type) < ? "
                "ORDER BY id LIMIT ?",
                (MOST_METADATA, _MOST_TOPICS + 1),
            )
        )
        if len(topics) > _MOST_TOPICS:
            raise ValueError(f"expected {_MOST_TOPICS} topics at most, found more")
        self.connections = [
            Connection(
                id=one,
                topic=str(name),
                msgtype=str(kind),
                msgdef=definitions.get(kind, nothing),
                digest="",
                msgcount=counts.get(one, 0),
                ext=ConnectionExtRosbag2(str(encoding), []),
                owner=self,
            )
            for one, name, kind, encoding in topics
        ]
        ((first, last, count),) = self._rows("SELECT min(timestamp), max(timestamp), count(*) FROM messages")
        if count:
            self.metadata = self.metadata._replace(
                duration=last + 1 - first, start_time=first, end_time=last + 1, message_count=count
            )

    def messages(self, connections: Collection[Connection], start: int | None = None) -> Iterator[Item]:
        """See bag_file; those in a damaged part of the file are errors."""
        chosen = {item.id: item for item in connections}
        places = ",".join("?" * len(chosen))
        rows = self._rows(
            f"SELECT rowid, topic_id, timestamp FROM messages WHERE topic_id IN ({places}) AND timestamp >= ?",
            (*chosen, -(2**63) if start is None else start),
        )
        order = sorted(rows)
        if not falls((topic, time) for _, topic, time in order):
            order.sort(key=lambda row: row[2])
        for row, topic, time in order:
            yield chosen[topic], time, or_error(partial(self._data, row), self.path, f"message {row}", reason=DAMAGED)

    def _data(self, row: int) -> bytes:
        assert self._base is not None
        query = "SELECT CASE WHEN length(data) <= ? THEN data END FROM messages WHERE rowid = ?"
        (data,) = self._base.execute(query, (MOST_BYTES, row)).fetchone()
        if not isinstance(data, bytes):
            raise ValueError(f"expected {MOST_BYTES} bytes at most, found more or none")
        return data
