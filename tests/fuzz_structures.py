"""Damages what is inside containers, and keeps the containers readable: MCAP, ROS 1 bags, SQLite.

Mutated bytes rarely get behind checksums, compression and offsets, which are made anew here.
"""

from __future__ import annotations

import contextlib
import sqlite3
import struct
import zlib
from random import Random
from typing import Any

import lz4.frame

from mcap_writer import PACK, zstd

EDGES = (0, 1, 2, 255, 2**15, 2**16 - 1, 2**31 - 1, 2**31, 2**32 - 1, 2**62, 2**63, 2**64 - 1)
UNPACK = {"zstd": zstd.decompress, "lz4": lz4.frame.decompress, "": bytes}
MAGIC = b"\x89MCAP0\r\n"
_CHUNK, _CHUNK_INDEX, _FOOTER = 6, 8, 2


def changed(body: bytes, rng: Random) -> bytes:
    """A record with a number or bytes changed, cut or longer; most damage is near its beginning."""
    found = bytearray(body)
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        at = rng.randrange(max(min(len(found), rng.choice((16, 64, len(found) or 1))), 1))
        kind = rng.randrange(10)
        if kind < 5:
            code = rng.choice("BHIQfd")
            size = struct.calcsize(code)
            number = rng.choice((float("nan"), float("inf"), -1e300)) if code in "fd" else rng.choice(EDGES)
            if at + size <= len(found):
                value = number % 2 ** (8 * size) if isinstance(number, int) else number
                with contextlib.suppress(OverflowError):
                    struct.pack_into(f"<{code}", found, at, value)
        elif kind < 8:
            found[at : at + 1] = bytes([rng.randrange(256)])
        elif kind == 8:
            del found[at : at + rng.randrange(1, 9)]
        else:
            found[at:at] = rng.randbytes(rng.randrange(1, 9))
    return bytes(found)


def shuffled(records: list[tuple[int, int, bytes]], rng: Random) -> None:
    """Now and then leave a record out, repeat one, or exchange two."""
    if not records:
        return
    kind, one, other = rng.randrange(12), rng.randrange(len(records)), rng.randrange(len(records))
    if kind == 0:
        del records[one]
    elif kind == 1:
        records.insert(other, records[one])
    elif kind == 2:
        records[one], records[other] = records[other], records[one]


def records_of(data: bytes, at: int) -> list[tuple[int, int, bytes]]:
    """Offset, code and body of consecutive records of MCAP."""
    found = []
    while at + 9 <= len(data):
        code, length = struct.unpack_from("<BQ", data, at)
        found.append((at, code, data[at + 9 : at + 9 + length]))
        at += 9 + length
    return found


def joined(records: list[tuple[int, int, bytes]]) -> bytes:
    return b"".join(struct.pack("<BQ", code, len(body)) + body for _, code, body in records)


def chunk(body: bytes, rng: Random) -> bytes:
    """A chunk with damaged records inside; sizes and checksum are right, mostly."""
    start, end, _, checksum, words = struct.unpack_from("<QQQII", body)
    compression = body[32 : 32 + words].decode()
    inner = records_of(UNPACK[compression](body[40 + words :]), 0)
    for _ in range(rng.choice((1, 2, 5)) if inner else 0):
        one = rng.randrange(len(inner))
        at, code, content = inner[one]
        inner[one] = at, code if rng.random() < 0.97 else rng.randrange(256), changed(content, rng)
    shuffled(inner, rng)
    content = joined(inner)
    packed = PACK[compression](content)
    size = len(content) if rng.random() < 0.97 else rng.choice(EDGES)
    checksum = zlib.crc32(content) if checksum and rng.random() < 0.95 else checksum
    head = struct.pack("<QQQII", start, end, size, checksum, words)
    return head + compression.encode() + struct.pack("<Q", len(packed)) + packed


def mcap(data: bytes, rng: Random) -> bytes:
    """An MCAP file with damaged records; offsets in its summary are right, if they were."""
    records = records_of(data[: -len(MAGIC)], len(MAGIC))
    sound = list(records)
    for _ in range(rng.choice((1, 1, 3))):
        one = rng.randrange(len(records))
        at, code, body = records[one]
        is_sound_chunk = code == _CHUNK and records[one] is sound[one]
        body = chunk(body, rng) if is_sound_chunk and rng.random() < 0.9 else changed(body, rng)
        records[one] = at, code, body
    shuffled(records, rng)
    moved, place = {0: 0}, len(MAGIC)
    for at, _, body in records:
        moved.setdefault(at, place)
        place += 9 + len(body)
    fixed = []
    for at, code, body in records:
        if code == _CHUNK_INDEX and len(body) >= 36:
            begin, length, offsets = struct.unpack_from("<QQI", body, 16)
            table = bytearray(body)
            struct.pack_into("<QQ", table, 16, moved.get(begin, begin), length)
            for entry in range(36, min(36 + offsets, len(table) - 9), 10):
                (old,) = struct.unpack_from("<Q", table, entry + 2)
                struct.pack_into("<Q", table, entry + 2, moved.get(old, old))
            body = bytes(table)
        elif code == _FOOTER and len(body) == 20:
            starts = [moved.get(old, old) for old in struct.unpack_from("<QQ", body)]
            body = struct.pack("<QQI", *starts, 0)
        fixed.append((at, code, body))
    return MAGIC + joined(fixed) + MAGIC


def ros1(data: bytes, rng: Random) -> bytes:
    """A ROS 1 bag with damaged headers, messages and indices; places in the headers are right, if they were."""
    start = data.index(b"\n") + 1
    records, moved = _ros1_records(data, start), {}
    sound = list(records)
    for _ in range(rng.choice((1, 1, 3))):
        one = rng.randrange(len(records))
        at, fields, body = records[one]
        is_sound_chunk = fields.get(b"compression") == b"none" and records[one] is sound[one]
        if is_sound_chunk and rng.random() < 0.8:
            inner = _ros1_records(body, 0)
            row = rng.randrange(len(inner))
            inner[row] = _ros1_changed(inner[row], rng)
            shuffled(inner, rng)
            body = b"".join(map(_ros1_record, inner))
            size = len(body) if rng.random() < 0.95 else rng.choice(EDGES) % 2**32
            records[one] = at, fields | {b"size": struct.pack("<I", size)}, body
        else:
            records[one] = _ros1_changed(records[one], rng)
    shuffled(records, rng)
    place = start
    for at, fields, body in records:
        moved.setdefault(at, place)
        place += len(_ros1_record((at, fields, body)))
    for _, fields, _ in records:
        for name in (b"index_pos", b"chunk_pos"):
            if len(fields.get(name, b"")) == 8:
                (old,) = struct.unpack("<Q", fields[name])
                fields[name] = struct.pack("<Q", moved.get(old, old))
    return data[:start] + b"".join(map(_ros1_record, records))


def _ros1_records(data: bytes, at: int) -> list[tuple[int, dict[bytes, bytes], bytes]]:
    found = []
    while at + 8 <= len(data):
        begin, (length,) = at, struct.unpack_from("<I", data, at)
        header, at, fields = data[at + 4 : at + 4 + length], at + 4 + length, {}
        while header:
            (size,) = struct.unpack_from("<I", header)
            name, _, value = header[4 : 4 + size].partition(b"=")
            fields[name], header = value, header[4 + size :]
        (size,) = struct.unpack_from("<I", data, at)
        found.append((begin, fields, data[at + 4 : at + 4 + size]))
        at += 4 + size
    return found


def _ros1_changed(record: tuple[int, dict[bytes, bytes], bytes], rng: Random) -> tuple[int, dict[bytes, bytes], bytes]:
    at, fields, body = record
    if rng.random() < 0.5:
        return at, fields, changed(body, rng)
    name = rng.choice(list(fields))
    if rng.random() < 0.2:
        return at, {other: value for other, value in fields.items() if other != name}, body
    return at, fields | {name: changed(fields[name], rng)}, body


def _ros1_record(record: tuple[int, dict[bytes, bytes], bytes]) -> bytes:
    _, fields, body = record
    pairs = [name + b"=" + value for name, value in fields.items()]
    header = b"".join(struct.pack("<I", len(pair)) + pair for pair in pairs)
    return struct.pack("<I", len(header)) + header + struct.pack("<I", len(body)) + body


def sqlite(data: bytes, rng: Random) -> bytes:
    """A database with other values, rows, columns and tables."""
    base: Any = sqlite3.connect(":memory:")
    base.deserialize(data)
    for _ in range(rng.choice((1, 1, 3))):
        names = [name for (name,) in base.execute("SELECT name FROM sqlite_master WHERE type = 'table'")]
        if not names:
            break
        table = rng.choice(names)
        columns = [row[1] for row in base.execute(f'PRAGMA table_info("{table}")')] or ["x"]
        column, row = rng.choice(columns), f'rowid = (SELECT rowid FROM "{table}" ORDER BY random() LIMIT 1)'
        old = base.execute(f'SELECT "{column}" FROM "{table}" LIMIT 1').fetchone()
        value = rng.choice(
            (None, -1, 0, 2**63 - 1, -(2**63), 1.5, float("inf"), "", "x" * 5000, b"", rng.randbytes(40))
        )
        if old and isinstance(old[0], bytes | str) and rng.random() < 0.8:
            content = old[0].encode() if isinstance(old[0], str) else old[0]
            value = changed(content, rng)
            value = value.decode("latin-1") if isinstance(old[0], str) else value
        changes = (
            (f'UPDATE "{table}" SET "{column}" = ? WHERE {row}', (value,)),
            (f'UPDATE "{table}" SET "{column}" = ?', (value,)),
            (f'UPDATE "{table}" SET "{column}" = ? WHERE {row}', (value,)),
            (f'DELETE FROM "{table}" WHERE {row}', ()),
            (f'INSERT INTO "{table}" SELECT * FROM "{table}"', ()),
            (f'ALTER TABLE "{table}" RENAME COLUMN "{column}" TO "other"', ()),
            (f'ALTER TABLE "{table}" ADD COLUMN "more" AS (randomblob(1000000))', ()),
            (f'CREATE TABLE "more" AS SELECT * FROM "{table}"', ()),
            (f'DROP TABLE "{table}"', ()),
            (f'CREATE VIEW "shown" AS SELECT * FROM "{table}"', ()),
        )
        with contextlib.suppress(sqlite3.Error):
            base.execute(*rng.choice(changes))
            base.commit()
    return base.serialize()
