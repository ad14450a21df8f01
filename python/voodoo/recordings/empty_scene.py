"""Images of the empty scene beside a recording, assigned to cameras by file name."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from voodoo.errors import RecordingError
from voodoo.model.camera import Camera
from voodoo.recordings.left_out import LeftOut, leaving_out
from voodoo.recordings.order import in_order
from voodoo.recordings.pictures import decode_color
from voodoo.stored import read_stored

FOLDER = "background"
PICTURES = (".png", ".jpg", ".jpeg")
MOST = 100
"""Maximum number of images read per camera, spread over all available ones."""


def find_background(place: Path) -> Path | None:
    """The folder `background/` beside `place`, in it, or one folder up."""
    folder = place if place.is_dir() else place.parent
    for candidate in (folder / FOLDER, folder.parent / FOLDER):
        if candidate.is_dir():
            return candidate
    return None


def pictures_of(folder: Path, cameras: Mapping[str, Sequence[str]]) -> dict[str, tuple[Path, ...]]:
    """The files of each camera are NAME.jpg, NAME_0.jpg, NAME-7.png, ... or all in a folder NAME/.

    Args:
        folder: folder of the images.
        cameras: sensor -> names that its images may have; names shared by two cameras are ignored.

    Returns:
        Sensor -> its files in the order of their names; a sensor without any is missing.
    """
    names = [name for own in cameras.values() for name in set(own)]
    owner = {name: sensor for sensor, own in cameras.items() for name in own if name and names.count(name) == 1}
    found: dict[str, list[Path]] = {}
    for file in in_order([item for item in folder.rglob("*") if item.suffix.lower() in PICTURES]):
        place = file.relative_to(folder)
        word = place.parts[0] if len(place.parts) > 1 else file.stem
        fit = [name for name in owner if re.fullmatch(rf"{re.escape(name)}([_.-].*)?", word)]
        if fit:
            found.setdefault(owner[max(fit, key=len)], []).append(file)
    return {sensor: tuple(files) for sensor, files in found.items()}


def read_pictures(
    files: Mapping[str, Sequence[Path]], cameras: Mapping[str, Camera], *, left_out: LeftOut | None
) -> dict[str, tuple[npt.NDArray[np.uint8], ...]]:
    """Decode the images, at most MOST per camera.

    Args:
        files: of each sensor.
        cameras: of each sensor; an image of another size is an error.
        left_out: counts unreadable images, which are then left out; None: they are errors.

    Raises:
        RecordingError: it names the file.
    """
    read = {}
    for sensor, paths in files.items():
        camera, pictures = cameras[sensor], []
        for path in paths[:: -(-len(paths) // MOST)]:
            with leaving_out(left_out, "pictures of the empty scene"):
                pictures.append(decode_color(read_stored(path, "a picture"), path, (camera.width, camera.height)))
        if pictures:
            read[sensor] = tuple(pictures)
    return read


def no_pictures(folder: str | Path, cameras: Mapping[str, Sequence[str]]) -> RecordingError:
    """The error for a folder set by the user that has no camera's images."""
    listed = "; ".join(f"{sensor}: {', '.join(dict.fromkeys(own))}" for sensor, own in cameras.items()) or "no camera"
    return RecordingError(
        f"{folder}: expected pictures NAME.png or NAME_0.png, ... by a camera's name ({listed}), found none"
    )


def scene_words(folder: Path | None, files: Mapping[str, Sequence[Path]]) -> tuple[str, ...]:
    """Description of the available images of the empty scene; () without a folder of images."""
    if folder is None:
        return ()
    listed = ", ".join(f"{sensor} {len(paths)}" for sensor, paths in files.items()) or "none that belongs to a camera"
    return (f"pictures of the empty scene in {folder}: {listed}",)
