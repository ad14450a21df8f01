"""Images of the empty scene beside a recording, assigned to cameras by file name."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from voodoo.errors import RecordingError
from voodoo.measurements import ByteImage
from voodoo.model.camera import Camera
from voodoo.recordings.left_out import LeftOut, leaving_out
from voodoo.recordings.order import in_order
from voodoo.recordings.pictures import decode_color
from voodoo.stored import read_stored

FOLDER = "background"
PICTURES = (".png", ".jpg", ".jpeg")
MOST = 100
"""Maximum number of images read per camera, spread over all available ones."""


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


class EmptyScene:
    """The images of the empty scene that belong to a recording: in a folder set by the user, else in `background/` beside it."""

    def __init__(
        self, place: Path, given: str | Path | None, cameras: Mapping[str, tuple[Camera, Sequence[str]]]
    ) -> None:
        """List the files.

        Args:
            place: the recording; `background/` is beside it, in it, or one folder up.
            given: the folder set by the user.
            cameras: sensor -> its camera, and the names that its images may have, see `pictures_of`.

        Raises:
            RecordingError: the folder set by the user has no camera's images.
        """
        beside = place if place.is_dir() else place.parent
        folders = (beside / FOLDER, beside.parent / FOLDER)
        self._folder = next((one for one in folders if one.is_dir()), None) if given is None else Path(given)
        self._cameras, folders_of = cameras, {sensor: own for sensor, (_, own) in cameras.items()}
        self._files = {} if self._folder is None else pictures_of(self._folder, folders_of)
        if given is not None and not self._files:
            names = [f"{sensor}: {', '.join(dict.fromkeys(own))}" for sensor, own in folders_of.items()]
            listed = "; ".join(names) or "no camera"
            raise RecordingError(
                f"{given}: expected pictures NAME.png or NAME_0.png, ... by a camera's name ({listed}), found none"
            )

    @property
    def words(self) -> tuple[str, ...]:
        """Description of the available images; () without a folder of images."""
        if self._folder is None:
            return ()
        counts = [f"{sensor} {len(paths)}" for sensor, paths in self._files.items()]
        return (
            f"pictures of the empty scene in {self._folder}: {', '.join(counts) or 'none that belongs to a camera'}",
        )

    def read(self, *, left_out: LeftOut | None) -> dict[str, tuple[ByteImage, ...]]:
        """Decode the images, at most MOST per camera.

        Args:
            left_out: counts unreadable images, which are then left out; None: they are errors.

        Returns:
            Sensor -> images (H, W, 3) BGR.

        Raises:
            RecordingError: an image is unreadable, or of another size than calibrated.
        """
        read = {}
        for sensor, paths in self._files.items():
            (camera, _), pictures = self._cameras[sensor], []
            for path in paths[:: -(-len(paths) // MOST)]:
                with leaving_out(left_out, "pictures of the empty scene"):
                    pictures.append(decode_color(read_stored(path, "a picture"), path, (camera.width, camera.height)))
            if pictures:
                read[sensor] = tuple(pictures)
        return read
