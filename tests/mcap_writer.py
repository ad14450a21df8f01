"""MCAP files with chunks, compression and checksums as a test wants them. See the MCAP specification."""

import bz2
import io
import struct
import zlib
from collections import Counter

import lz4.frame

try:
    from compression import zstd
except ImportError:
    from backports import zstd

from bag_writer import ROS2

PACK = {"zstd": zstd.compress, "lz4": lz4.frame.compress, "bz2": bz2.compress, "": bytes}
MAGIC = b"\x89MCAP0\r\n"


def _text(value):
    value = value.encode() if isinstance(value, str) else value
    return struct.pack("<I", len(value)) + value


def _record(code, body):
    return struct.pack("<BQ", code, len(body)) + body


def write_mcap(
    path,
    chunks,
    *,
    compression="zstd",
    checksum=True,
    filler=0,
    declared=None,
    definitions=None,
    indexed=True,
    repeated=1,
    quality="",
):
    """Write a file.

    Args:
        path: where to.
        chunks: for each chunk its (topic, time [s], message).
        compression: "zstd", "lz4" or "".
        checksum: write checksums.
        filler: zeros in a record at the end of every chunk [bytes].
        declared: a false size of the unpacked chunks.
        definitions: message type -> what the file says of it.
        indexed: write a summary.
        quality: the quality of service of every channel, in YAML.
        repeated: how often every chunk is in the index.

    Returns:
        position and length of every chunk's compressed data.
    """
    out = io.BytesIO()
    out.write(MAGIC + _record(1, _text("ros2") + _text("test")))
    schemas, channels, index, places, counts = {}, {}, [], [], Counter()
    for entries in chunks:
        inner, rows = io.BytesIO(), {}
        for topic, time, message in entries:
            kind = message.__msgtype__
            schemas.setdefault(kind, len(schemas) + 1)
            one = channels.setdefault(topic, (len(channels) + 1, schemas[kind]))[0]
            stamp = round(time * 1e9)
            rows.setdefault(one, []).append((stamp, inner.tell()))
            counts[one] += 1
            inner.write(
                _record(5, struct.pack("<HIQQ", one, 0, stamp, stamp) + bytes(ROS2.serialize_cdr(message, kind)))
            )
        if filler:
            inner.write(_record(0x7F, bytes(filler)))
        content = inner.getvalue()
        packed = PACK[compression](content)
        times = [round(time * 1e9) for _, time, _ in entries]
        start = out.tell()
        size = len(content) if declared is None else declared
        head = struct.pack("<QQQI", min(times), max(times), size, zlib.crc32(content) if checksum else 0)
        head += _text(compression) + struct.pack("<Q", len(packed))
        places.append((start + 9 + len(head), len(packed)))
        out.write(_record(6, head + packed))
        length, offsets = out.tell() - start, []
        for one, found in rows.items():
            offsets.append((one, out.tell()))
            table = b"".join(struct.pack("<QQ", *row) for row in found)
            out.write(_record(7, struct.pack("<HI", one, len(table)) + table))
        table = b"".join(struct.pack("<HQ", *entry) for entry in offsets)
        indexed_chunk = struct.pack("<QQQQI", min(times), max(times), start, length, len(table)) + table
        indexed_chunk += struct.pack("<Q", out.tell() - start - length) + _text(compression)
        index.append(indexed_chunk + struct.pack("<QQ", len(packed), size))
    out.write(_record(0x0F, struct.pack("<I", 0)))
    summary = out.tell() if indexed else 0
    if indexed:
        for kind, one in schemas.items():
            text = (definitions or {}).get(kind) or ROS2.generate_msgdef(kind)[0]
            out.write(_record(3, struct.pack("<H", one) + _text(kind) + _text("ros2msg") + _text(text)))
        metadata = _text("offered_qos_profiles") + _text(quality)
        for topic, (one, schema) in channels.items():
            out.write(_record(4, struct.pack("<HH", one, schema) + _text(topic) + _text("cdr") + _text(metadata)))
        for entry in index * repeated:
            out.write(_record(8, entry))
        times = [round(time * 1e9) for entries in chunks for _, time, _ in entries]
        table = b"".join(struct.pack("<HQ", *entry) for entry in counts.items())
        head = struct.pack(
            "<QHIIIIQQ", len(times), len(schemas), len(channels), 0, 0, len(chunks), min(times), max(times)
        )
        out.write(_record(0x0B, head + struct.pack("<I", len(table)) + table))
    out.write(_record(2, struct.pack("<QQI", summary, 0, 0)) + MAGIC)
    path.write_bytes(out.getvalue())
    return places
