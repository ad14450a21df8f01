"""Bags with one kind of damage each, made from a sound one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import StoragePlugin, Writer

from bag_writer import ROS2
from voodoo.recordings import sample_path

Entry = tuple[str, str, int, bytes]
"""Topic, message type, time of recording [ns], message."""

DEPTH = "/camera/depth/image_rect_raw"
INFO = "/camera/depth/camera_info"


def entries_of(path: Path) -> list[Entry]:
    with AnyReader([path], default_typestore=ROS2) as reader:
        return [(c.topic, c.msgtype, time, bytes(raw)) for c, time, raw in reader.messages()]


def write(path: Path, entries: list[Entry]) -> Path:
    connections = {}
    path.parent.mkdir(parents=True, exist_ok=True)
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        for topic, kind, time, raw in entries:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=ROS2)
            writer.write(connections[topic], time, raw)
    return path


def sound() -> list[Entry]:
    """The messages of the bundled recording: 90 frames of depth and color."""
    return entries_of(sample_path() / "bag")


def beginning(folder: Path, frames: int) -> Path:
    """The first frames of the bundled recording as a recording of its own."""
    entries = sound()
    write(folder / "bag", entries[: depth_rows(entries)[frames]])
    for name in ("init.json", "truth.csv"):
        (folder / name).write_bytes((sample_path() / name).read_bytes())
    return folder


def depth_rows(entries: list[Entry]) -> list[int]:
    return [row for row, entry in enumerate(entries) if entry[0] == DEPTH]


def changed(entry: Entry, **fields: object) -> Entry:
    """A message with other fields."""
    topic, kind, time, raw = entry
    message = replace(ROS2.deserialize_cdr(raw, kind), **fields)
    return topic, kind, time, bytes(ROS2.serialize_cdr(message, kind))


def _stamped(entry: Entry, sec: int, nanosec: int) -> Entry:
    message = ROS2.deserialize_cdr(entry[3], entry[1])
    return changed(entry, header=replace(message.header, stamp=replace(message.header.stamp, sec=sec, nanosec=nanosec)))


def _cut(entries: list[Entry], at: int = 30) -> list[Entry]:
    gone = set(depth_rows(entries)[at : at + 3])
    return [entry for row, entry in enumerate(entries) if row not in gone]


def _repeated(entries: list[Entry], at: int = 30) -> list[Entry]:
    row = depth_rows(entries)[at]
    return entries[: row + 1] + [entries[row]] + entries[row + 1 :]


def _reordered(entries: list[Entry], at: int = 30) -> list[Entry]:
    """The messages come one after the other in time, but one has the stamp of before."""
    first, second = depth_rows(entries)[at : at + 2]
    found = list(entries)
    (topic, kind, a, raw), (_, _, b, later) = found[first], found[second]
    found[first], found[second] = (topic, kind, a, later), (topic, kind, b, raw)
    return found


def _one(change: Callable[[Entry], Entry]) -> Callable[..., list[Entry]]:
    def damage(entries: list[Entry], at: int = 30) -> list[Entry]:
        found = list(entries)
        row = depth_rows(entries)[at]
        found[row] = change(found[row])
        return found

    return damage


def _blank(entry: Entry) -> Entry:
    return changed(entry, data=np.zeros_like(ROS2.deserialize_cdr(entry[3], entry[1]).data))


def _uncalibrated(entries: list[Entry]) -> list[Entry]:
    """The calibration that comes with every image is empty for a while."""
    rows = [row for row, entry in enumerate(entries) if entry[0] == INFO]
    found = list(entries)
    for row in rows[:10] + rows[20:30]:
        found[row] = changed(found[row], k=np.zeros(9), p=np.zeros(12))
    return found


DAMAGES: dict[str, tuple[Callable[..., list[Entry]], str, tuple[int, ...]]] = {
    "cut": (_cut, "", (30, 31, 32)),
    "repeated": (_repeated, "1 with a repeated stamp", ()),
    "reordered": (_reordered, "1 with a stamp before the last one", (30,)),
    "unstamped": (_one(lambda entry: _stamped(entry, 0, 0)), "1 without a stamp", (30,)),
    "blank": (_one(_blank), "1 that are blank", (30,)),
    "shortened": (_one(lambda entry: changed(entry, data=np.zeros(7, np.uint8))), "1 that cannot be read", (30,)),
    "garbled": (_one(lambda entry: (*entry[:3], entry[3][:40])), "1 that cannot be read", (30,)),
    "resized": (_one(lambda entry: changed(entry, width=160, height=62)), "1 of another size than calibrated", (30,)),
    "uncalibrated": (_uncalibrated, "20 calibrations that cannot be used", ()),
}
"""Name -> damage, what is said of it, and which frames have no row where it befalls the thirtieth."""


def several(entries: list[Entry]) -> list[Entry]:
    """Half a second from one to the next; frames 25, 40, 55 and 70 have no row."""
    for name, at in (("blank", 25), ("garbled", 40), ("resized", 55), ("reordered", 70)):
        entries = DAMAGES[name][0](entries, at)
    return DAMAGES["repeated"][0](entries, 10)


def set_back(entries: list[Entry], seconds: float, at: int = 45, *, recorder: bool = False) -> list[Entry]:
    """The clock is set back before a depth image: what comes then has earlier stamps, and times if it is the recorder's."""

    def moved(entry: Entry) -> Entry:
        message = ROS2.deserialize_cdr(entry[3], entry[1])
        if entry[1] == "tf2_msgs/msg/TFMessage":
            return changed(
                entry, transforms=[replace(one, header=_earlier(one.header, seconds)) for one in message.transforms]
            )
        return changed(entry, header=_earlier(message.header, seconds))

    row = depth_rows(entries)[at]
    earlier = round(seconds * 1e9) if recorder else 0
    return [
        *entries[:row],
        *((topic, kind, time - earlier, raw) for topic, kind, time, raw in map(moved, entries[row:])),
    ]


def _earlier(header: object, seconds: float) -> object:
    nanoseconds = header.stamp.sec * 10**9 + header.stamp.nanosec - round(seconds * 1e9)
    sec, nanosec = divmod(nanoseconds, 10**9)
    return replace(header, stamp=replace(header.stamp, sec=sec, nanosec=nanosec))
