"""Folders with the videos, or image folders, of several calibrated cameras."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path

import cv2
import numpy as np

from voodoo.errors import RecordingError, reading, utf8_name
from voodoo.measurements import ByteImage, ColorImage, RecordedFrame
from voodoo.model.camera import Camera
from voodoo.recordings.camera_files import PlacedCamera, read_camera_toml
from voodoo.recordings.empty_scene import FOLDER, PICTURES, EmptyScene
from voodoo.recordings.folder import FrameClock
from voodoo.recordings.left_out import LeftOut
from voodoo.recordings.order import in_order
from voodoo.recordings.pictures import decode_color, picture_size
from voodoo.recordings.pose2sim import FRAME, calibration_of, cameras_of, read_triangulation, start_of
from voodoo.recordings.recording import Recording, SensorInfo, number_option
from voodoo.recordings.together import together
from voodoo.recordings.truth import find_beside, read_beside
from voodoo.stored import MOST_RECORDED, check_stored, read_stored

VIDEOS = (".mp4", ".avi", ".mov", ".mkv", ".webm", ".m4v")
_PADDING_PX = 16
"""Video codecs crop or pad images at the right and bottom to a multiple of 16 pixels, or leave that to the player."""


@dataclass(frozen=True, eq=False)
class Pictures:
    """The images of one calibrated camera.

    Args:
        sensor: name of the video or folder.
        placed: the camera, as calibrated.
        size: (width, height) of the images [px].
        stamps: of the images [s].
        reader: makes a function that returns the image with a number; sequential access is fastest. It raises a RecordingError
            for a damaged one.

    Raises:
        RecordingError: the size of the images differs from the calibration.
    """

    sensor: str
    placed: PlacedCamera
    size: tuple[int, int]
    stamps: Sequence[float]
    reader: Callable[[], Callable[[int], ByteImage]]

    def __post_init__(self) -> None:
        """Check the size."""
        (width, height), (wide, high) = self.size, (self.placed.camera.width, self.placed.camera.height)
        if max(abs(width - wide), abs(height - high)) >= _PADDING_PX:
            raise RecordingError(
                f"{self.sensor}: expected {wide}x{high} px, as {self.placed.name} is calibrated, found {width}x{height}",
                reason="of another size than calibrated",
            )

    @cached_property
    def camera(self) -> Camera:
        """Calibration for the size of the images."""
        return replace(self.placed.camera, width=self.size[0], height=self.size[1])

    def __iter__(self) -> Iterator[ColorImage]:
        """The images, each decoded on access."""
        picture = self.reader()
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
    film = opened_video(path)
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
    stamps, ordered = zip(*sorted(zip(clock.of(files), files, strict=True)), strict=True)
    if len(set(stamps)) < len(stamps):
        raise RecordingError(f"{sensor}: expected a number or stamp for each picture, found one twice")

    def picture(index: int) -> ByteImage:
        return decode_color(read_stored(ordered[index], "a picture"), ordered[index], size)

    return Pictures(sensor, placed, size, stamps, lambda: picture)


def pictures_in(folder: Path) -> list[Path]:
    """The image files in a folder, in the order of their numbers."""
    return in_order([item for item in folder.iterdir() if item.suffix.lower() in PICTURES])


def opened_video(path: Path) -> cv2.VideoCapture:
    """A video file, opened at its first image.

    Raises:
        RecordingError: no regular file, a name that is not UTF-8, or no video that FFmpeg reads.
    """
    check_stored(path, "a video", most=MOST_RECORDED)
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
                self._film, self._next = opened_video(self._path), 0
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


_ROOMS = ("videos", "images", ".")
"""Folders that are searched for videos or image folders; the first one with any is used."""
_OTHERS = (FOLDER, "keypoints", "pose", "calibration", "Calibration", "pose-3d", "kinematics")


class VideosRecording(Recording):
    """A folder with the images of several calibrated cameras::

        Calib_*.toml                 cameras, see read_camera_toml; world Z up, meters; or in calibration/, or ../calibration/
        videos/cam01.mp4             one video per camera; or folders of PNG or JPEG files: videos/cam01/, images/cam01/, cam01/
        background/cam01_0.png       optional: images of the empty scene
        init.json, truth.csv, *.trc  optional: first pose, truth, triangulated joints to compare with; truth_people.csv

    Videos and cameras are paired by name (`cam01` is `cam_1`), else by number, else, if there are as many of both, in the order
    of names.
    There is one frame for each image of the first camera; images of the others within half an interval belong to it.
    All videos start at the same time: stamps of a video are k / rate.

    Args:
        path: the folder.
        rate: images per second; None: the rate of each video, 30 for numbered images.
        seconds_per_unit: unit of the stamps by which images are named, see FolderRecording.
        meters_per_unit: of the calibration's translations.
        color_topic: names of the cameras to use (`voodoo track --topic color=NAME`); None: all with images.
        background: folder of images of the empty scene, instead of `background/` in the folder or its parent.
        bare: do not read init.json, truth.csv and *.trc.
        left_out: counts unreadable images, which are then left out; None: they are errors.

    Raises:
        RecordingError: a part is missing or has another format; names it.
    """

    complete = True
    loader = "videos"

    def __init__(
        self,
        path: Path,
        *,
        rate: float | None = None,
        seconds_per_unit: float | None = None,
        meters_per_unit: float = 1.0,
        color_topic: str | Sequence[str] | None = None,
        background: str | Path | None = None,
        bare: bool = False,
        left_out: LeftOut | None = None,
    ) -> None:
        """Read calibration and the headers of the videos; see the class."""
        self.path, self.name, self.root_frame = path, path.resolve().name, FRAME
        self._left_out = left_out
        rate = None if rate is None else number_option(path, "rate", rate)
        unit = None if seconds_per_unit is None else number_option(path, "seconds_per_unit", seconds_per_unit)
        sources = picture_sources(path)
        if not sources:
            raise RecordingError(f"{path}: expected videos in videos/, or folders of pictures in images/, found none")
        placed = read_camera_toml(
            calibration_of(path, [source.stem for source in sources]),
            meters_per_unit=number_option(path, "meters_per_unit", meters_per_unit),
        )
        clock = FrameClock(rate, unit)
        self._cameras: list[Pictures] = []
        for camera, source in cameras_of(path, placed, sources, ("a video", "color_topic"), color_topic):
            sensor = source.relative_to(path).as_posix()
            if source.is_dir():
                self._cameras.append(of_folder(pictures_in(source), sensor, camera, clock))
            else:
                self._cameras.append(of_video(source, sensor, camera, rate))
        self._stamps = self._cameras[0].stamps
        self.numbers = {(one.sensor, stamp): index for one in self._cameras for index, stamp in enumerate(one.stamps)}
        self.assumed = tuple(dict.fromkeys(clock.notes))
        names = {one.sensor: (one.camera, (one.placed.name, Path(one.sensor).stem)) for one in self._cameras}
        self._scene = EmptyScene(path, background, names)
        if bare:
            return
        read_beside(self, partial(find_beside, path), root=FRAME, first=self._stamps[0])
        if self.reference is None:
            self.reference = read_triangulation(path, self._stamps)
        if self.reference is not None and not self.reference.exact:
            self._notes = ("the reference is triangulated from keypoints: another tracker's opinion",)
            self.start = self.start or start_of(self.reference, self._stamps)

    def __iter__(self) -> Iterator[RecordedFrame]:
        """Images of all cameras; see Recording."""
        pictures = heapq.merge(*self._cameras, key=lambda item: item.stamp)
        return together(pictures, self._cameras[0].sensor)

    def _sensors(self) -> Iterator[SensorInfo]:
        for one in self._cameras:
            detail = f"{one.camera.width}x{one.camera.height} pictures"
            yield SensorInfo.of(one.sensor, "color", one.placed.name, one.stamps, detail)


def picture_sources(path: Path, *, anywhere: bool = True) -> list[Path]:
    """Videos or image folders, one per camera, sorted by name.

    Args:
        path: folder to search, with its videos/ and images/.
        anywhere: also use folders beside videos/ and images/.
    """
    for room in _ROOMS:
        folder = path / room
        found = [item for item in folder.iterdir() if _is_source(item)] if folder.is_dir() else []
        if room == "." and not anywhere:
            found = [item for item in found if not item.is_dir()]
        if found:
            return in_order(found)
    return []


def _is_source(item: Path) -> bool:
    if item.is_dir():
        return item.name not in (*_OTHERS, *_ROOMS) and bool(pictures_in(item))
    return item.suffix.lower() in VIDEOS
