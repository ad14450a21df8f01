"""Completes a recording whose recorder was killed."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path

from rosbags.interfaces import Connection

from voodoo.errors import RecordingError, reading
from voodoo.export.ros2 import STORE, bag
from voodoo.recordings.mcap_file import CHANNEL, MESSAGE, SCHEMA, check_mcap, records, stored_records
from voodoo.whole import move_whole


def complete(source: Path, path: Path) -> None:
    """Give a file of `voodoo live --record` its name; one that is cut off is written anew with the messages of whole chunks,
    if there are any.

    Raises:
        RecordingError: it is of another program.
        OSError: it cannot be written.
    """
    try:
        check_mcap(source)
    except RecordingError:
        if any(code == MESSAGE for code, _ in _sound(source)):
            _write(source, path)
    else:
        move_whole(source, path)


def _write(source: Path, path: Path) -> None:
    kinds: dict[int, str] = {}
    topics: dict[int, Connection] = {}
    with bag(path) as writer:
        for code, body in _sound(source):
            one, other = struct.unpack_from("<HH", body)
            if code == SCHEMA:
                kinds[one] = _word(body, 2)
            elif code == CHANNEL:
                topics[one] = writer.add_connection(_word(body, 4), kinds[other], typestore=STORE)
            elif code == MESSAGE:
                writer.write(topics[one], struct.unpack_from("<Q", body, 6)[0], body[22:])


def _sound(source: Path) -> Iterator[tuple[int, bytes]]:
    """The records in whole chunks."""
    with reading(source, "a recording of voodoo live"):
        for content in stored_records(source):
            yield from ((code, content[begin:end]) for code, begin, end in records(content))


def _word(body: bytes, at: int) -> str:
    (length,) = struct.unpack_from("<I", body, at)
    return body[at + 4 : at + 4 + length].decode()
