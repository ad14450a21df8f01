"""Image sequences of one camera: a video, or a folder of image files."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TypeAlias

import cv2
import numpy as np
import numpy.typing as npt

from voodoo.errors import RecordingError, reading, utf8_name
from voodoo.measurements import ColorImage
from voodoo.model.camera import Camera
from voodoo.recordings.camera_files import PlacedCamera
from voodoo.recordings.empty_scene import PICTURES
from voodoo.recordings.folder import FrameClock
from voodoo.recordings.order import in_order
from voodoo.recordings.pictures import decode_color, picture_size
from voodoo.stored import check_stored, read_stored

ByteImage: TypeAlias = npt.NDArray[np.uint8]

VIDEOS = (".mp4", ".avi", ".mov", ".mkv", ".webm", ".m4v")
_MOST_BYTES = 2**40
_PADDING_PX = 16
"""Video codecs crop or pad images at the right and bottom to a multiple of 16 pixels, or leave that to the player."""


class Pictures:
    """The images of one calibrated camera.

    Args:
        sensor: name of the video or folder.
        placed: the camera, as calibrated.
        size: (width, height) of the images [px].
        stamps: of the images [s].
        reader: makes a function that returns the image with a number; sequential access is fastest. It raises a RecordingError
            for a damaged one.

    Attributes:
        camera: calibration for the size of the images.

    Raises:
        RecordingError: the size of the images differs from the calibration.
    """

    def __init__(
        self,
        sensor: str,
        placed: PlacedCamera,
        size: tuple[int, int],
        stamps: Sequence[float],
        reader: Callable[[], Callable[[int], ByteImage]],
    ) -> None:
        """Check the size."""
        calibrated = (placed.camera.width, placed.camera.height)
        if max(abs(a - b) for a, b in zip(size, calibrated, strict=True)) >= _PADDING_PX:
            raise RecordingError(
                f"{sensor}: expected {calibrated[0]}x{calibrated[1]} px, as {placed.name} is calibrated, found "
                f"{size[0]}x{size[1]}",
                reason="of another size than calibrated",
            )
        self.sensor, self.placed, self.stamps, self._reader = sensor, placed, stamps, reader
        self.camera: Camera = replace(placed.camera, width=size[0], height=size[1])

    def __iter__(self) -> Iterator[ColorImage]:
        """The images, each decoded on access."""
        picture = self._reader()
        for index, stamp in enumerate(self.stamps):
            yield ColorImage(
                self.sensor, stamp, partial(picture, index), self.camera, np.array(self.placed.world_from_sensor)
            )


def of_video(path: Path, sensor: str, placed: PlacedCamera, rate: float | None) -> Pictures:
    """The images of a video.

    Args:
        path: the file.
        sensor: its name.
        placed: the camera, as calibrated.
        rate: images per second; None: the rate in the file.

    Raises:
        RecordingError: not a video, or of another size than calibrated.
    """
    film = _opened(path)
    count = int(film.get(cv2.CAP_PROP_FRAME_COUNT))
    size = (int(film.get(cv2.CAP_PROP_FRAME_WIDTH)), int(film.get(cv2.CAP_PROP_FRAME_HEIGHT)))
    rate = float(film.get(cv2.CAP_PROP_FPS)) if rate is None else rate
    film.release()
    # An image takes at least one byte: a damaged header may announce billions of images.
    if not (0 < count <= path.stat().st_size and np.isfinite(rate) and 0.0 < rate < 1e5):
        raise RecordingError(f"{path}: expected pictures at a rate above zero, found {count} at {rate} a second")
    stamps = (np.arange(count) / rate).tolist()
    return Pictures(sensor, placed, size, stamps, lambda: _VideoReader(path, count, size).picture)


def of_folder(files: Sequence[Path], sensor: str, placed: PlacedCamera, clock: FrameClock) -> Pictures:
    """The images in PNG or JPEG files, named by stamps or numbered.

    Args:
        files: the images.
        sensor: name of the folder.
        placed: the camera, as calibrated.
        clock: converts names to stamps.

    Raises:
        RecordingError: the first image cannot be read or has another size than calibrated, or two have the same stamp.
    """
    size = picture_size(read_stored(min(files), "a readable picture"), min(files))
    stamps, ordered = zip(
        *sorted(zip(clock.of([Path(_number(file)) for file in files]), files, strict=True)), strict=True
    )
    if len(set(stamps)) < len(stamps):
        raise RecordingError(f"{sensor}: expected a number or stamp for each picture, found one twice")

    def picture(index: int) -> ByteImage:
        return decode_color(read_stored(ordered[index], "a picture"), ordered[index], size)

    return Pictures(sensor, placed, size, stamps, lambda: picture)


def pictures_in(folder: Path) -> list[Path]:
    """The image files in a folder, in the order of their numbers."""
    return in_order([item for item in folder.iterdir() if item.suffix.lower() in PICTURES])


def _number(file: Path) -> str:
    """The path with only the stamp as its name: the last number in the name."""
    try:
        float(file.stem)
    except ValueError:
        found = re.findall(r"\d+", file.stem)
        return str(file.with_name(f"{found[-1]}{file.suffix}")) if found else str(file)
    return str(file)


def _opened(path: Path) -> cv2.VideoCapture:
    check_stored(path, "a video", most=_MOST_BYTES)
    film = cv2.VideoCapture(utf8_name(path.absolute(), error=RecordingError), cv2.CAP_FFMPEG)  # no URL
    if not film.isOpened():
        raise RecordingError(f"{path}: expected a video that FFmpeg reads, found none")
    return film


class _VideoReader:
    """Decodes a video sequentially; going back reopens it."""

    def __init__(self, path: Path, count: int, size: tuple[int, int]) -> None:
        self._path, self._count, self._size = path, count, size
        self._film: cv2.VideoCapture | None = None
        self._next = 0

    def picture(self, index: int) -> ByteImage:
        """An image (H, W, 3) BGR uint8 by its number."""
        with reading(self._path, "a readable video"):
            if self._film is None or index < self._next:
                self._film, self._next = _opened(self._path), 0
            while self._next < index and self._film.grab():
                self._next += 1
            read, image = self._film.read() if self._next == index else (False, None)
        if not read or image is None:
            raise RecordingError(
                f"{self._path}: expected {self._count} pictures, found damage or an end at {self._next}"
            )
        self._next += 1
        if (image.shape[1], image.shape[0]) != self._size:
            raise RecordingError(
                f"{self._path}: expected pictures of {self._size[0]}x{self._size[1]} px, found "
                f"{image.shape[1]}x{image.shape[0]}",
                reason="of another size than calibrated",
            )
        return np.asarray(image, dtype=np.uint8)
