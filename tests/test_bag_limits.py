"""Bags of a stranger: what they say of themselves is checked, what they unpack to is limited, and damage costs its part only."""

import os
import shutil
import sqlite3
import subprocess
import sys
import time
import zipfile

import numpy as np
import pytest
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag1.reader import IndexData

import voodoo
from bag_writer import ROS1, Messages, write_bag
from commands import refused, run
from mcap_writer import PACK, write_mcap
from voodoo.errors import RecordingError, VoodooError
from voodoo.export.people import PeopleTrack
from voodoo.export.track import Track
from voodoo.recordings import open_recording
from voodoo.recordings.bag_files import Ros1File
from voodoo.recordings.left_out import LeftOut
from voodoo.unpacking import Unpacking

M, M1 = Messages(), Messages(ros=1)
DEPTH = np.full((3, 4), 1500, np.uint16)
LARGE = 5_000_000
"""A size that the tests do not allow [bytes]."""
TOPICS = ("/d/depth/image", "/d/depth/camera_info")


@pytest.fixture(autouse=True)
def small_limits(monkeypatch):
    monkeypatch.setattr("voodoo.unpacking._LITTLE", 2**18)


def entries(count, *, start=10.0, messages=M):
    """Pairs of calibration and image, ten a second."""
    stamps = [start + number / 10 for number in range(count)]
    return [
        item
        for stamp in stamps
        for item in ((TOPICS[1], stamp, messages.camera_info(stamp)), (TOPICS[0], stamp, messages.image(stamp, DEPTH, "16UC1")))
    ]  # fmt: skip


def chunks(count=5, size=4):
    return [entries(size, start=10.0 + number) for number in range(count)]


def frames_of(path, **options):
    left_out = LeftOut()
    frames = list(open_recording(path, use=("depth",), left_out=left_out, **options))
    return [round(frame.stamp, 1) for frame in frames], left_out


def flip(path, position):
    with path.open("r+b") as file:
        file.seek(position)
        byte = file.read(1)
        file.seek(position)
        file.write(bytes([byte[0] ^ 0xFF]))


# Damage


@pytest.mark.parametrize("compression", ["zstd", "lz4", ""])
def test_a_damaged_chunk_costs_its_messages_and_no_others(tmp_path, compression):
    path = tmp_path / "x.mcap"
    places = write_mcap(path, chunks(), compression=compression)
    assert len(frames_of(path)[0]) == 20
    at, length = places[2]
    flip(path, at + length // 2)
    stamps, left_out = frames_of(path)
    assert stamps == [10.0 + a + b / 10 for a in (0, 1, 3, 4) for b in range(4)]
    assert left_out.counts == {"in a damaged chunk": 8}
    with pytest.raises(RecordingError, match=r"x\.mcap: expected a sound chunk at byte \d+, found"):
        list(open_recording(path, use=("depth",)))


def test_a_damaged_index_does_not_multiply_what_is_lost(tmp_path):
    """It announces 2**27 messages in gigabytes, for a chunk that is damaged as well."""
    path = tmp_path / "x.mcap"
    places = write_mcap(path, chunks(2))
    flip(path, places[1][0] + 20)
    content = bytearray(path.read_bytes())
    index = content.rindex(b"\x04\0\0\0zstd")  # the length of the chunk's index is before it, its size behind
    for at in (index - 8, index + 16):
        content[at : at + 8] = (2**31).to_bytes(8, "little")
    path.write_bytes(content)
    stamps, left_out = frames_of(path)
    assert len(stamps) == 4 and 4 <= left_out.counts["in a damaged chunk"] < len(content) / 16


@pytest.mark.parametrize("number", [2**63, -1])
def test_numbers_of_messages_that_cannot_be_are_refused(tmp_path, number):
    path = tmp_path / "x.mcap"
    write_mcap(path, chunks(1))
    content = bytearray(path.read_bytes())
    statistics = content.rindex(b"\x0b" + (66).to_bytes(8, "little"))
    if number > 0:
        content[statistics + 67 : statistics + 75] = number.to_bytes(8, "little")
    else:  # they follow from the length of the index of the chunk
        content[statistics], index = 0x7F, content.rindex(b"\x04\0\0\0zstd")
        content[index - 8 : index] = bytes(8)
    path.write_bytes(content)
    refused(run("info", path), "x.mcap: expected the number of messages on /d/depth/", "in the index, found")


def test_a_wrong_checksum_is_the_reason_told(tmp_path):
    path = tmp_path / "x.mcap"
    ((at, length),) = write_mcap(path, chunks(1), compression="")
    flip(path, at + length // 2)
    refused(run("info", path), "wrong checksum")
    assert "found none" not in run("info", path).stderr


def test_what_channels_say_of_themselves_is_limited(tmp_path):
    path = tmp_path / "x.mcap"
    write_mcap(path, chunks(1), quality="[" * 30_000)
    refused(run("info", path), "x.mcap: expected a channel at byte", "found nested metadata")
    write_mcap(path, chunks(1), quality="- a\n" * 200_000)
    refused(run("info", path), "1048576 bytes of schemas or channels at most")


def test_a_file_without_an_index_and_one_that_names_chunks_twice_are_refused(tmp_path):
    path = tmp_path / "x.mcap"
    write_mcap(path, chunks(2), indexed=False)
    refused(run("info", path), "x.mcap: expected an index of the chunks, found none (`mcap recover")
    write_mcap(path, chunks(2), repeated=1000)
    refused(run("info", path), "x.mcap: expected every chunk once in the index, found one again")


@pytest.mark.parametrize("compression", [None, Writer1.CompressionFormat.BZ2, Writer1.CompressionFormat.LZ4])
def test_a_damaged_chunk_of_ros1_costs_its_messages(tmp_path, compression):
    path = tmp_path / "x.bag"
    noise = np.random.default_rng(1).integers(400, 4000, (3, 3, 200, 300)).astype(np.uint16)
    writer = Writer1(path)
    if compression is not None:
        writer.set_compression(compression)
    with writer:
        connections = {}
        for number in range(18):
            stamp = 10.0 + number / 10
            image = M1.image(stamp, noise[number % 3, 0], "16UC1")
            for topic, message in ((TOPICS[1], M1.camera_info(stamp, width=300, height=200)), (TOPICS[0], image)):
                kind = message.__msgtype__
                if topic not in connections:
                    connections[topic] = writer.add_connection(topic, kind, typestore=ROS1)
                writer.write(connections[topic], round(stamp * 1e9), ROS1.serialize_ros1(message, kind))
    before = frames_of(path)[0]
    data = bytearray(path.read_bytes())
    magic = {None: b"time=", Writer1.CompressionFormat.BZ2: b"BZh9", Writer1.CompressionFormat.LZ4: b"\x04\x22\x4d\x18"}
    at = data.find(magic[compression], 5000 if compression is None else 0)
    data[at : at + 4] = b"\xff" * 4
    path.write_bytes(data)
    stamps, left_out = frames_of(path)
    assert len(before) == 18 and set(stamps) <= set(before) and stamps[-1] == before[-1]
    assert set(left_out.counts) == {"in a damaged chunk"}
    if compression is None:
        assert left_out.counts == {"in a damaged chunk": 1}
    else:
        assert left_out.counts == {"in a damaged chunk": 2 * (18 - len(stamps))}


def test_a_message_of_ros1_is_close_to_its_place_in_the_index(tmp_path):
    """Millions of records that are skipped before each message would take hours."""
    (tmp_path / "x.bag").write_bytes(b"")
    reader = Ros1File(tmp_path / "x.bag", Unpacking())
    reader._last = 0, 1_000_000 * b"\x08\0\0\0\x04\0\0\0op=\x07\0\0\0\0"
    began = time.process_time()
    with pytest.raises(ValueError, match="expected a message, found none"):
        reader._message(IndexData(0, 0, 0))
    assert time.process_time() - began < 0.5


def sqlite_bag(folder, count=30, **how):
    return write_bag(folder, entries(count), storage="sqlite3", **how) / f"{folder.name}.db3"


def test_a_damaged_part_of_a_sqlite_file_costs_its_messages(tmp_path):
    large = np.random.default_rng(1).integers(400, 4000, (100, 200)).astype(np.uint16)
    found = [(TOPICS[1], 10.0, M.camera_info(10.0, width=200, height=100))]
    found += [(TOPICS[0], 10.0 + k / 10, M.image(10.0 + k / 10, large, "16UC1")) for k in range(20)]
    path = write_bag(tmp_path / "b", found, storage="sqlite3") / "b.db3"
    base = sqlite3.connect(path)
    (size,) = base.execute("PRAGMA page_size").fetchone()
    base.close()
    data = bytearray(path.read_bytes())
    page = len(data) // size // 2
    data[page * size : page * size + 4] = b"\xff\xff\xff\xff"  # where the message goes on
    path.write_bytes(data)
    stamps, left_out = frames_of(path)
    assert len(stamps) == 19 and left_out.counts == {"in a damaged part of the file": 1}


# SQLite


def with_log(path, statements):
    """Run statements in a process that dies: what they did is only in the log, or in the journal."""
    code = f"import sqlite3, os\nc = sqlite3.connect({str(path)!r})\n{statements}\nos._exit(9)"
    subprocess.run([sys.executable, "-c", code], check=False)


def test_rows_in_the_log_of_a_recorder_that_was_killed_are_read(tmp_path):
    path = sqlite_bag(tmp_path / "b", 4)
    with_log(
        path,
        "c.execute('PRAGMA journal_mode=WAL')\n"
        "c.execute('INSERT INTO messages SELECT id + 1000, topic_id, timestamp + 5000000000, data FROM messages')\n"
        "c.commit()",
    )
    log = path.with_name(path.name + "-wal")
    before = {part.name: part.read_bytes() for part in path.parent.iterdir()}
    assert log.stat().st_size
    info = open_recording(path, use=("depth",)).info()
    assert {sensor.messages for sensor in info.sensors if sensor.kind == "depth"} == {8}
    assert {part.name: part.read_bytes() for part in path.parent.iterdir()} == before
    with zipfile.ZipFile(tmp_path / "b.zip", "w") as archive:
        for part in (path, log):
            archive.write(part, part.name)
    assert len(open_recording(tmp_path / "b.zip", use=("depth",))) == 8


def test_an_unfinished_transaction_is_refused_by_name(tmp_path):
    path = sqlite_bag(tmp_path / "b", 4)
    with_log(
        path,
        "c.execute('PRAGMA cache_size=1')\nc.execute('PRAGMA cache_spill=1')\nc.execute('BEGIN')\n"
        "c.execute('UPDATE messages SET data = zeroblob(100000)')\n"
        "c.execute('INSERT INTO messages SELECT id + 1000, topic_id, timestamp, data FROM messages')",
    )
    assert path.with_name(path.name + "-journal").stat().st_size
    refused(run("info", path), "b.db3: expected a finished bag, found an unfinished transaction in b.db3-journal")


HOSTILE = {
    "view": "ALTER TABLE messages RENAME TO m; CREATE VIEW messages AS SELECT * FROM m",
    "endless": "DROP TABLE messages; CREATE VIEW messages AS WITH RECURSIVE r(x) AS (SELECT 1 UNION ALL SELECT x + 1 FROM r) "
    "SELECT x AS id, 1 AS topic_id, x AS timestamp, zeroblob(1000000000) AS data FROM r",
    "generated": "ALTER TABLE topics ADD COLUMN more TEXT GENERATED ALWAYS AS (hex(zeroblob(100000000))) VIRTUAL",
    "expression": "CREATE INDEX i ON messages(hex(data))",
    "trigger": "CREATE TRIGGER t AFTER INSERT ON messages BEGIN SELECT 1; END",
    "virtual": "CREATE VIRTUAL TABLE v USING fts5(x)",
    "tables": "BEGIN;" + ";".join(f"CREATE TABLE t{number}(x)" for number in range(200)) + ";COMMIT",
}


@pytest.mark.parametrize("name", HOSTILE)
def test_a_schema_of_more_than_tables_is_refused(tmp_path, name):
    path = sqlite_bag(tmp_path / "b", 2)
    base = sqlite3.connect(path)
    try:
        base.executescript(HOSTILE[name])
    except sqlite3.OperationalError as error:
        pytest.skip(f"this SQLite cannot: {error}")
    base.close()
    refused(run("info", path), "b.db3: expected a ROS 2 bag in SQLite, found", "expected")


@pytest.mark.parametrize("name", ["50%25", "a#b", "a?mode=rwc", "a%2fb", "a&b;c"])
@pytest.mark.parametrize("storage", ["sqlite3", "mcap"])
def test_paths_may_have_any_letters(tmp_path, name, storage):
    folder = tmp_path / name
    made = write_bag(tmp_path / "b", entries(3), storage=storage)
    shutil.copytree(made, folder)
    assert len(frames_of(folder)[0]) == 3
    (part,) = [part for part in folder.iterdir() if part.suffix in (".db3", ".mcap")]
    part = part.rename(part.with_name(name + part.suffix))
    assert len(frames_of(part)[0]) == 3
    assert {path.name for path in tmp_path.iterdir()} == {name, "b"}


# Message definitions


def test_definitions_of_messages_are_compared_and_not_executed(tmp_path):
    kind = "sensor_msgs/msg/Image"
    for number, text in enumerate(
        ("uint8[4000000000] data", "Nothing[4000000000] data\n" + "=" * 80 + "\nMSG: x/Nothing\n")
    ):
        path = tmp_path / f"{number}.mcap"
        write_mcap(path, chunks(1), definitions={kind: text})
        refused(run("info", path), f"topic {TOPICS[0]}: expected", "sensor_msgs/msg/Image")
    write_mcap(tmp_path / "long.mcap", chunks(1), definitions={kind: "uint8 a\n" * 20_000})
    refused(run("info", tmp_path / "long.mcap"), "expected a definition of 65536 bytes at most")


def test_definitions_of_messages_that_are_not_read_do_no_harm(tmp_path):
    more = [("/other", 10.0, M.new("std_msgs/msg/Bool", data=True))]
    for number, text in enumerate(("%&$ no definition", "Bool again")):
        path = tmp_path / f"{number}.mcap"
        write_mcap(path, [entries(3) + more], definitions={"std_msgs/msg/Bool": text})
        assert len(frames_of(path)[0]) == 3


# Unpacking


@pytest.mark.parametrize("kind", ["zstd", "lz4", "bz2", "zlib"])
def test_unpacking_is_limited_while_it_happens(kind):
    import zlib

    pack = {**PACK, "zlib": zlib.compress}[kind]
    small, large = os.urandom(300_000), bytes(LARGE)
    assert Unpacking().unpack(pack(small), kind) == small
    with pytest.raises(ValueError, match=r"unpack to at most \d+, found more"):
        Unpacking().unpack(pack(large), kind)
    with pytest.raises(ValueError, match="found more"):
        Unpacking().unpack(pack(large), kind, declared=1000)
    with pytest.raises(ValueError, match="as declared, found 300000"):
        Unpacking().unpack(pack(small), kind, declared=300_001)
    with pytest.raises(ValueError, match="cut off"):
        Unpacking().unpack(pack(small)[:-10], kind)
    assert Unpacking(10**9).unpack(pack(large), kind) == large
    if kind != "zlib":
        assert Unpacking().unpack(pack(small) + pack(small), kind) == small + small


def test_the_limit_is_for_all_pieces_together():
    piece = PACK["zstd"](bytes(100_000))
    whole = Unpacking(kept=False)
    whole.unpack(piece, "zstd")
    whole.unpack(piece, "zstd")
    with pytest.raises(ValueError, match="unpack to at most"):
        whole.unpack(piece, "zstd")


@pytest.mark.parametrize("compression", ["zstd", "lz4"])
@pytest.mark.parametrize("declared", [None, 5000])
def test_chunks_that_unpack_to_gigabytes_are_refused(tmp_path, compression, declared):
    path = tmp_path / "x.mcap"
    write_mcap(path, chunks(1), compression=compression, filler=LARGE, declared=declared)
    wanted = "--option unpacked_gb=N" if declared is None else "found more"
    refused(run("info", path), "x.mcap: expected a sound chunk at byte", wanted)
    if declared is None:
        assert frames_of(path, unpacked_gb=1)[0]


@pytest.mark.parametrize("compression", [Writer1.CompressionFormat.BZ2, Writer1.CompressionFormat.LZ4])
def test_chunks_of_ros1_that_unpack_to_gigabytes_are_refused(tmp_path, compression):
    path = tmp_path / "x.bag"
    image = M1.image(10.0, np.zeros((1000, 2500), np.uint16), "16UC1")
    writer = Writer1(path)
    writer.set_compression(compression)
    with writer:
        for topic, message in ((TOPICS[1], M1.camera_info(10.0)), (TOPICS[0], image)):
            one = writer.add_connection(topic, message.__msgtype__, typestore=ROS1)
            writer.write(one, 10**10, ROS1.serialize_ros1(message, message.__msgtype__))
    refused(run("info", path), "x.bag: expected a sound chunk", "--option unpacked_gb=N")


def test_files_and_messages_compressed_by_zstd_are_limited(tmp_path):
    folder = sqlite_bag(tmp_path / "b", 3).parent
    yaml, part = folder / "metadata.yaml", folder / "b.db3"
    plain = yaml.read_text()
    base = sqlite3.connect(part)
    base.create_function("pack", 1, PACK["zstd"])
    base.execute("UPDATE messages SET data = pack(data)")
    base.commit()
    plain = plain.replace("compression_format: ''", "compression_format: zstd")
    yaml.write_text(plain.replace("compression_mode: ''", "compression_mode: message"))
    assert len(frames_of(folder)[0]) == 3
    base.execute("UPDATE messages SET data = ? WHERE id = 1", (PACK["zstd"](bytes(LARGE)),))
    base.commit()
    base.close()
    assert frames_of(folder)[1].counts
    whole = sqlite_bag(tmp_path / "c", 3)
    yaml = whole.parent / "metadata.yaml"
    yaml.write_text(
        yaml.read_text().replace("compression_format: ''", "compression_format: zstd")
        .replace("compression_mode: ''", "compression_mode: file").replace("c.db3", "c.db3.zstd")
    )  # fmt: skip
    packed = whole.with_name("c.db3.zstd")
    packed.write_bytes(PACK["zstd"](whole.read_bytes()))
    data = whole.read_bytes()
    whole.unlink()
    assert len(frames_of(whole.parent)[0]) == 3
    packed.write_bytes(PACK["zstd"](data + bytes(LARGE)))
    refused(run("info", whole.parent), "c.db3.zstd", "unpack to at most")


def test_arrays_of_results_are_limited(tmp_path):
    with zipfile.ZipFile(tmp_path / "x.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("stamps.npy", bytes(LARGE))
    for read in (Track.load, PeopleTrack.load):
        with pytest.raises(VoodooError, match=r"x\.npz: .* unpack to at most"):
            read(tmp_path / "x.npz")


def test_a_long_result_is_read_whatever_its_size(tmp_path, monkeypatch):
    monkeypatch.setattr("voodoo.unpacking.MOST_UNPACKED", 1000)
    numbers = np.random.default_rng(1).normal(size=(50, 4, 3))
    names = tuple("abcd")
    track = Track(np.arange(50.0), 50 * ("tracking",), np.zeros(50), names, numbers, (), np.empty((50, 0, 4, 4)))
    track.save(tmp_path / "x.npz")
    assert len(Track.load(tmp_path / "x.npz")) == 50


# Files that are none, and what they say of themselves


@pytest.mark.parametrize("make", [os.mkfifo, lambda path: path.symlink_to("/dev/zero"), lambda path: path.mkdir()])
def test_only_regular_files_are_read(tmp_path, make):
    found = "found (no regular file|no such file|.*directory)"
    of_results = [("x.csv", Track.load), ("x.npz", Track.load), ("x.csv", PeopleTrack.load)]
    of_recordings = [(name, open_recording) for name in ("x.mcap", "x.db3", "x.bag", "x.zip", "x.c3d")]
    for name, load in [("x.toml", voodoo.Config.load), ("x.toml", voodoo.Body.load), *of_results, *of_recordings]:
        path = tmp_path / name
        make(path)
        if path.is_dir() and load is open_recording:
            path.rmdir()
            continue
        with pytest.raises(VoodooError, match=found):
            load(path)
        path.rmdir() if path.is_dir() else path.unlink()
    bag = write_bag(tmp_path / "b", entries(2))
    (bag / "metadata.yaml").unlink()
    make(bag / "metadata.yaml")
    assert run("info", bag).exit_code == 0  # its only file is enough
    for storage in ("mcap", "sqlite3"):
        bag = write_bag(tmp_path / storage, entries(2), storage=storage)
        (part,) = [part for part in bag.iterdir() if part.suffix != ".yaml"]
        part.unlink()
        make(part)
        refused(run("info", bag), part.name)


def test_metadata_has_a_greatest_size_and_no_references(tmp_path):
    bag = write_bag(tmp_path / "b", entries(2))
    yaml = bag / "metadata.yaml"
    plain = yaml.read_text()
    yaml.write_text(plain + "# " + "x" * 1_100_000)
    refused(run("info", bag), "metadata.yaml: expected", "1048576 bytes at most")
    yaml.write_text(plain + "  more: &a [x]\n  again: [*a, *a, *a]\n")
    refused(run("info", bag), "metadata.yaml: expected", "references")
    yaml.write_text(plain + "  more: " + "[" * 900_000)
    refused(run("info", bag), "metadata.yaml: expected", "deep nesting")
    yaml.write_text(plain + "  more: [" + "a," * 300_000 + "]")
    refused(run("info", bag), "metadata.yaml: expected", "deep nesting")
    yaml.write_text(plain + "  more:\n    " + "- " * 2_000 + "a\n")
    refused(run("info", bag), "expected")
