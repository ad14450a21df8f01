"""Parses the name of a source: a camera, ros2:TOPIC, grow:FOLDER, or a recording."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

from voodoo.errors import VoodooError, a_path
from voodoo.live.source import Source
from voodoo.recordings.left_out import LeftOut
from voodoo.recordings.loaders import open_recording

CAMERAS = {"realsense": "RealSenseSource", "oak": "OakSource", "orbbec": "OrbbecSource"}
"""Kind, which is also the name of its module -> class."""
ROS2, GROW = "ros2", "grow"
_OF_TOPICS = ("frame", "meters_per_unit", "tf_max_age")


def source_of(
    word: str | Path,
    *,
    rate: float = 1.0,
    loop: bool = False,
    root_frame: str | None = None,
    options: Mapping[str, Any] | None = None,
    calibration: Path | None = None,
) -> Source:
    """The source with a given name.

    Args:
        word: "realsense", "oak" or "orbbec", with ":SERIAL" for one of several, "orbbec:FILE.bag", "ros2:TOPIC[,TOPIC...]",
            "grow:FOLDER", or the path of a recording.
        rate: for a recording: playback speed relative to real time.
        loop: for a recording: start again at its end.
        root_frame: for a recording or ROS 2: root frame to use instead of its own.
        options: of the recording's loader; ROS 2 topics take meters_per_unit and tf_max_age.
        calibration: a calibration.toml. For a camera or a topic, only the pose in it (`root_frame` and `root_from_sensor`) is
            used; for a folder, all of it.

    Raises:
        VoodooError: no such recording, or an option out of range.
    """
    kind, colon, rest = str(word).partition(":")
    options = dict(options or {})
    refuse_unused([str(word)], options)
    if kind in CAMERAS:
        camera: type[Source] = getattr(import_module(f"voodoo.live.sources.{kind}"), CAMERAS[kind])
        return camera(serial=rest or None, calibration=calibration)  # type: ignore[call-arg]
    if kind == ROS2 and colon:
        from voodoo.live.sources.ros2 import Ros2Source

        topics = [topic for topic in rest.split(",") if topic]
        return Ros2Source(topics, root_frame=root_frame, calibration=calibration, **options)
    if kind == GROW and colon:
        from voodoo.live.sources.growing import GrowingSource

        return GrowingSource(Path(rest), calibration=calibration)
    from voodoo.live.sources.played import PlayedSource

    if calibration is not None:
        raise VoodooError(f"{word}: expected no calibration, a recording brings its own, found {calibration}")
    if not 0.0 < rate < 1e6:
        raise VoodooError(f"rate: expected a number above 0, found {rate}")
    if root_frame is not None:
        options["root_frame"] = root_frame
    if not a_path(word, error=VoodooError).exists():
        raise VoodooError(
            f"{word}: expected a recording, {', '.join(CAMERAS)}, {ROS2}:TOPIC or {GROW}:FOLDER, found no such file or folder"
        )
    left_out = LeftOut()
    recording = open_recording(word, bare=True, left_out=left_out, **options)
    return PlayedSource(recording, rate=rate, loop=loop, left_out=left_out)


def options_for(word: str, options: Mapping[str, Any]) -> dict[str, Any]:
    """Those of several sources' options that one of them uses; those of recordings are checked by their loaders.

    Args:
        word: see source_of.
        options: `frame`, `rate`, `loop` and the ones of loaders.
    """
    kind = word.partition(":")[0]
    known = _OF_TOPICS if kind == ROS2 else () if kind in (*CAMERAS, GROW) else options
    return {name: value for name, value in options.items() if name in known}


def refuse_unused(words: Sequence[str], options: Mapping[str, Any]) -> None:
    """Reject options that none of the sources uses, see options_for.

    Raises:
        VoodooError: names them.
    """
    used = {name for word in words for name in options_for(word, options)}
    if unknown := sorted(set(options) - used):
        known = ", ".join(_OF_TOPICS) if any(word.partition(":")[0] == ROS2 for word in words) else "none"
        raise VoodooError(f"{', '.join(words)}: expected no {', '.join(unknown)}, found some; options: {known}")
