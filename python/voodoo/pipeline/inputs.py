"""Inputs of `voodoo track`: a recording, and further data joined to it on the command line."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from voodoo.errors import RecordingError, VoodooError
from voodoo.measurements import RecordedFrame
from voodoo.recordings.joined import Around, Joined, WithKeypoints
from voodoo.recordings.keypoint_layouts import layout_of
from voodoo.recordings.left_out import LeftOut
from voodoo.recordings.loaders import LOADERS, guess_loader, open_recording, options_of
from voodoo.recordings.marker_files import MarkerMap
from voodoo.recordings.recording import Recording, RecordingInfo
from voodoo.recordings.videos import picture_sources
from voodoo.sensors.keypoints.networks import KeypointNetwork, network_of


class Detected(Around):
    """A recording with the keypoints that a network finds in its color images.

    Args:
        recording: with color images.
        network: run on each of them that has no keypoints yet.
        left_out: counts damaged color images, which are left out; None: they are errors.

    Raises:
        RecordingError: no color images.
    """

    def __init__(self, recording: Recording, network: KeypointNetwork, *, left_out: LeftOut | None = None) -> None:
        """Check that there are color images."""
        super().__init__(recording)
        self._network, self._refused = network, None if left_out is None else left_out.add_error
        sensors = recording.info().sensors
        names = {sensor.name for sensor in sensors}
        colors = [sensor.name for sensor in sensors if sensor.kind == "color"]
        if not colors:
            found = ", ".join(f"{sensor.name} ({sensor.kind})" for sensor in sensors) or "none"
            raise RecordingError(f"{recording.path}: expected color images for {network.name}, found {found}")
        self._cameras = {name for name in colors if f"{name}/keypoints" not in names}

    def __iter__(self) -> Iterator[RecordedFrame]:
        """The frames, with a KeypointImage before each color image."""
        for recorded in self._recording:
            yield RecordedFrame(recorded.stamp, self._network.added_to(recorded, refused=self._refused))

    def info(self) -> RecordingInfo:
        """The summary of the recording, with the keypoints."""
        return self._info(self._cameras, f"{self._network.layout} by {self._network.name}")


def keypoint_words(words: Sequence[str], layout: str | None) -> tuple[dict[str, Path], KeypointNetwork | None]:
    """Folders by sensor, and the network to run on all other color images.

    Args:
        words: "SENSOR=FOLDER", and at most one network (see network_of).
        layout: of the keypoints; None: told by them, or by the network.

    Raises:
        VoodooError: an argument of another form, a folder that does not exist, several networks, or one that cannot be loaded.
    """
    folders, networks = {}, []
    for word in words:
        sensor, of_sensor, folder = word.partition("=")
        if not of_sensor:
            networks.append(word)
        elif not (sensor and folder):
            raise VoodooError(f"keypoints: expected SENSOR=FOLDER, found {word!r}")
        elif not Path(folder).is_dir():
            raise VoodooError(f"{folder}: expected a folder of OpenPose JSON files, found none")
        else:
            folders[sensor] = Path(folder)
    if len(networks) > 1:
        raise VoodooError(f"keypoints: expected one network, found {', '.join(networks)}")
    return folders, network_of(networks[0], layout=layout) if networks else None


def join(
    recording: Recording,
    *,
    keypoints: Mapping[str, Path] | None = None,
    network: KeypointNetwork | None = None,
    layout: str | None = None,
    others: Sequence[Path] = (),
    offset: float = 0.0,
    markers: MarkerMap | None = None,
    numbers: Mapping[str, float] | None = None,
    bare: bool = False,
    left_out: LeftOut | None = None,
) -> Recording:
    """The recording joined with all further data.

    Args:
        recording: provides the frames.
        keypoints: sensor -> folder of OpenPose JSON files, one file for each image of the sensor.
        network: finds keypoints in the other color images, also of `others`.
        layout: layout of those keypoints; None: told by their number and the shape of the persons.
        others: further recordings of the scene, marker files among them.
        offset: [s] added to their stamps.
        markers: meaning of the markers in marker files.
        numbers: numeric options, passed to the loaders that have them.
        bare, left_out: see `open_recording`.

    Raises:
        VoodooError: an input cannot be read, or the inputs do not belong together.
    """
    layout_of(layout or "body25b")
    if not math.isfinite(offset):
        raise VoodooError(f"offset: expected a finite number of seconds, found {offset}")
    if keypoints:
        recording = WithKeypoints(recording, keypoints, layout=layout, left_out=left_out)
    if others:
        opened = []
        for path in others:
            options = loader_options(path, None, markers=markers, layout=layout, numbers=numbers)
            if path.exists() and guess_loader(path) in ("ros1", "ros2"):
                options["root_frame"] = recording.root_frame
            opened.append(open_recording(path, bare=bare, left_out=left_out, **options))
        recording = Joined(recording, opened, offset=offset)
    return recording if network is None else Detected(recording, network, left_out=left_out)


def loader_options(
    path: Path,
    loader: str | None,
    *,
    markers: MarkerMap | None,
    layout: str | None,
    numbers: Mapping[str, float] | None = None,
    use: Sequence[str] | None = None,
) -> dict[str, Any]:
    """The options of `voodoo track` that the loader of a recording accepts.

    If only images are to be used, they define the frames, even of a bag that has depth or a folder that has keypoints.

    Raises:
        VoodooError: no loader reads this recording.
    """
    if loader is None and not path.exists():
        return {}  # opening the recording reports the error
    alone = pictures_alone(path, loader, use)
    name = alone.get("loader") or loader or guess_loader(path)
    options: dict[str, dict[str, Any]] = {"markers": {"markers": markers}, "pose2sim": {"layout": layout}}
    known = options_of(name) if name in LOADERS else ()
    return options.get(name, {}) | {key: value for key, value in (numbers or {}).items() if key in known} | alone


def pictures_alone(path: Path, loader: str | None, use: Sequence[str] | None) -> dict[str, Any]:
    """Options of `open_recording` by which images define the frames, if `use` names only inputs extracted from images."""
    if use is None or "color" not in use or not set(use) <= {"color", "skin"} or not path.exists():
        return {}
    name = loader or guess_loader(path)
    if name in ("ros1", "ros2"):
        return {"use": ("color",)}
    return {"loader": "videos"} if loader is None and name == "pose2sim" and picture_sources(path) else {}
