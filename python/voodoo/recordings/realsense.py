"""Special features of the .bag of librealsense's recorder (2.55): see docs/how-to/cameras.md.

After every image four bytes follow (float32, meters of a unit of depth); calibration lies on `.../Depth_0/info/camera_info`;
frame ids are numbers, and the pose of a stream is on `.../Depth_0/tf/N`, where N numbers what the poses are relative to.
The .db3 of later recorders is an ordinary bag, except that the names of the lens models are only in string messages.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import replace

from voodoo.model.camera import Camera
from voodoo.recordings.ros_messages import Message

EXTRA_BYTES = 4
_STREAM = re.compile(r"^(/device_(\d+)/sensor_\d+)/(\w+_\d+)/image/data(?:/\w+)?$")
UNITS, LENS = r"\1/option/Depth_Units/value", r"\1/\3/camera_info"
"""Topics with the depth unit [m], and in a .db3 with the name of the lens model, by the groups of _STREAM."""
_TRANSFORM = re.compile(r"^(/device_\d+/sensor_\d+/\w+_\d+)/tf/(\d+)$")


def is_recorders(topics: Iterable[str]) -> bool:
    """Whether the topics are those of a .bag written by librealsense's recorder."""
    names = set(topics)
    return "/file_version" in names and any(_TRANSFORM.match(name) for name in names)


def frame_name(topic: str) -> str:
    """A name for the frame of an image topic, e.g. "Depth_0"; with its device if that is not the first."""
    found = _STREAM.match(topic)
    if found is None:
        return topic.strip("/")
    return found[3] if found[2] == "0" else f"device_{found[2]}/{found[3]}"


def info_topic(topic: str) -> str:
    """Topic of the calibration of an image topic."""
    return f"{topic.removesuffix('/image/data')}/info/camera_info"


def beside(topic: str, place: str) -> str | None:
    """A topic of the stream of an image topic, UNITS or LENS; None for other topics."""
    found = _STREAM.match(topic)
    return None if found is None else found.expand(place)


def transform_of(topic: str) -> tuple[str, str] | None:
    """(stream's frame, reference's frame) of a topic with a transform stream_from_reference; None of another topic."""
    found = _TRANSFORM.match(topic)
    if found is None:
        return None
    return frame_name(f"{found[1]}/image/data"), f"reference_{found[2]}"


def with_lens(camera: Camera, words: Message) -> Camera:
    """The camera with the lens model given in the recorder's strings: its CameraInfo calls every model plumb_bob."""
    inverse = "model=inverse brown conrady" in str(getattr(words, "data", "")).lower()
    return replace(camera, model="inverse_plumb_bob") if inverse and camera.model == "plumb_bob" else camera
