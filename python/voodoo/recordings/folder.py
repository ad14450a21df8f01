"""Folders of 16-bit depth PNGs in the layout of the TUM RGB-D benchmark."""

from __future__ import annotations

import heapq
import math
import re
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path, PurePath

import numpy as np

from voodoo.errors import RecordingError
from voodoo.measurements import ASSUMED_RATE_HZ, ByteImage, ColorImage, DepthImage, Measurement, RecordedFrame
from voodoo.recordings.camera_files import FolderCalibration, PlacedCamera, read_calibration
from voodoo.recordings.empty_scene import PICTURES
from voodoo.recordings.left_out import LeftOut, leave_out
from voodoo.recordings.order import numbers_of
from voodoo.recordings.pictures import decode_color, decode_depth_png
from voodoo.recordings.recording import Recording, SensorInfo, number_option, usable
from voodoo.recordings.set_back import SetBack, out_of_order
from voodoo.recordings.time_units import step_words, unit_of
from voodoo.recordings.together import in_turn
from voodoo.recordings.truth import read_beside
from voodoo.stored import read_stored, read_stored_text

_MOST_NUMBERED = 1_000_000
"""Larger integers are times in seconds, not image numbers: the limit is nine hours of images."""
DEPTH_SUFFIXES = (".png", ".pgm")


class FolderRecording(Recording):
    """A folder of images::

        depth/1305031102.160407.png   16-bit PNGs or PGMs named by their stamp in seconds, or numbered (00000.png,
                                      depth_0003.png, frame-000003.depth.png); or in the folder itself
        depth.txt                     optional: lines "stamp depth/name.png", # starts a comment; then names are free
        rgb/, rgb.txt                 optional: the same for color (PNG or JPEG)
        calibration.toml              the camera
        truth.csv                     optional: exact joint positions in the root frame, as beside a rendered bag
        truth_people.csv              optional: those of several persons
        init.json                     optional: pose of the person in the first frame, as read by --init

    There is one frame for each depth image, holding the color images since the previous one. A groundtruth.txt (the
    camera's path, in that benchmark) is not used. calibration.toml::

        width = 640
        height = 480
        fx = 525.0                     # pixels; integer pixel coordinates are pixel centers
        fy = 525.0
        cx = 319.5
        cy = 239.5
        # all that follows is optional
        distortion = []                # OpenCV order
        model = "plumb_bob"            # or rational_polynomial, equidistant, inverse_plumb_bob
        mirrored = false               # true: images are mirrored left to right, and are flipped back
        depth_factor = 5000.0          # units per meter
        sensor_frame = "camera_depth_optical_frame"
        root_frame = "base_link"       # default: sensor_frame, or "root" with a root_from_sensor
        root_from_sensor = [[0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 1.2], [0, 0, 0, 1]]   # default: identity
        [color]                        # needed for rgb/ to be read; same keys but depth_factor and root_frame
        width = 640
        ...

    Numbered images have the rate `rate`; stamps of 13, 16 or 19 digits are in milli-, micro- or nanoseconds.

    Args:
        path: the folder.
        calibration: another calibration file.
        rate: images per second if they are numbered; None: 30 is assumed, and reported.
        seconds_per_unit: unit of the stamps, also of numbers, e.g. 0.001; None: as above.
        bare: read neither truth.csv nor init.json.
        left_out: counts unusable images, which are then left out; None: they are errors.

    Raises:
        RecordingError: no images, no calibration, names that are not stamps, or stamps that do not increase.
    """

    loader = "folder"

    def __init__(
        self,
        path: Path,
        *,
        calibration: str | Path | None = None,
        rate: float | None = None,
        seconds_per_unit: float | None = None,
        bare: bool = False,
        left_out: LeftOut | None = None,
    ) -> None:
        """List the images; see the class."""
        if not path.is_dir():
            raise RecordingError(f"{path}: expected a folder with depth/ and calibration.toml, found no folder")
        self.path = path
        self.name = path.resolve().name
        self._left_out = left_out
        self.numbers: dict[tuple[str, float], int] = {}
        rate = None if rate is None else number_option(path, "rate", rate)
        unit = None if seconds_per_unit is None else number_option(path, "seconds_per_unit", seconds_per_unit)
        clock = FrameClock(rate, unit)
        set_back = SetBack()
        self._depth = _listing(path, "depth", DEPTH_SUFFIXES, clock, left_out, set_back)
        if not self._depth:
            raise RecordingError(f"{path}: expected depth images in depth/ or listed in depth.txt, found none")
        self._stamps = [stamp for stamp, _ in self._depth]
        file = path / "calibration.toml" if calibration is None else Path(calibration)
        self._calibration = read_calibration(file, like=self._depth[0][1])
        self.root_frame = self._calibration.root_frame
        if not bare:
            read_beside(
                self,
                lambda name: path / name if (path / name).is_file() else None,
                root=self.root_frame,
                first=self._stamps[0],
            )
        self._color: list[tuple[float, Path]] = []
        if (path / "rgb").is_dir() or (path / "rgb.txt").is_file():
            if self._calibration.color is None:
                self._unused = (("rgb", "no [color] table in the calibration file"),)
            else:
                self._color = _listing(path, "rgb", PICTURES, clock, left_out, set_back)
        self.assumed = (*clock.notes, *set_back.words)

    def __iter__(self) -> Iterator[RecordedFrame]:
        """Read the images; see Recording."""
        color = self._calibration.color
        colors: Iterator[Measurement] = (color_image(*entry, color) for entry in self._color if color is not None)
        depths: Iterator[Measurement] = (
            item for number, (stamp, file) in enumerate(self._depth) if (item := self._usable(number, stamp, file))
        )
        return in_turn(heapq.merge(colors, depths, key=lambda item: item.stamp), "depth")

    def _usable(self, number: int, stamp: float, file: Path) -> DepthImage | None:
        make = partial(depth_image, stamp, file, self._calibration)
        return usable(make, number, file, self._left_out, self.numbers)

    def _sensors(self) -> Iterator[SensorInfo]:
        yield _sensor("depth", "16-bit PNG", self._depth, self._calibration.depth)
        if self._color and self._calibration.color is not None:
            yield _sensor("color", "pictures", self._color, self._calibration.color)


class FrameClock:
    """Stamps from the names of files and the lines of lists.

    Args:
        rate: images per second of numbered images; None: 30.
        unit: what stamps and numbers count [s]; None: told by their digits.

    Attributes:
        notes: assumptions that were made.
    """

    def __init__(self, rate: float | None, unit: float | None = None) -> None:
        """Start without assumptions."""
        self._rate, self._unit = rate, unit
        self.notes: list[str] = []

    def seconds(self, texts: Sequence[str], where: Sequence[object]) -> list[float]:
        """Stamps [s] that are written in these words, each found somewhere.

        Raises:
            RecordingError: one that is not a number.
        """
        unit = self._unit or unit_of(texts)
        return [_stamp(text, str(place), unit) for text, place in zip(texts, where, strict=True)]

    def of(self, files: Sequence[Path]) -> list[float]:
        """Stamps [s] of the names of a folder's files.

        Raises:
            RecordingError: a name that is not a number.
        """
        stems = [file.stem for file in files]
        found = [re.findall(r"\d+(?:\.\d+)?", stem) for stem in stems]
        if not all(stem.replace(".", "", 1).isdigit() for stem in stems):
            if {len(words) for words in found} == {1}:  # depth_0003
                stems = [words[0] for words in found]
            elif (last := numbers_of(files)) is not None:
                stems = [f"{number:09d}" for number in last]
        stamps = self.seconds(stems, files)
        numbered = all(stem.isdigit() for stem in stems) and unit_of(stems) == 1.0 and max(stamps) <= _MOST_NUMBERED
        return self._at_rate(files[0].parent.name, stamps) if numbered and self._unit is None else stamps

    def _at_rate(self, folder: str, numbers: Sequence[float]) -> list[float]:
        """Stamps [s] of numbered images; says what is assumed."""
        rate = self._rate or ASSUMED_RATE_HZ
        words = [f"{folder}/ is numbered, and taken for {rate:g} images/s"]
        if self._rate is None:
            step = float(np.median(np.diff(np.sort(numbers)))) if len(numbers) > 1 else math.nan
            words += ["--option rate=N says another rate", step_words(step, rate)]
        self.notes.append("; ".join(filter(None, words)))
        return [number / rate for number in numbers]


def depth_files(path: Path) -> list[Path]:
    """Images that may be depth in a folder without depth/: those named so, else all but those named as color."""
    files = [file for file in path.iterdir() if file.suffix.lower() in DEPTH_SUFFIXES]
    named = [file for file in files if "depth" in file.stem.lower()]
    return named or [file for file in files if not re.search("colou?r|rgb", file.stem.lower())]


def _listing(
    path: Path, name: str, suffixes: tuple[str, ...], clock: FrameClock, left_out: LeftOut | None, set_back: SetBack
) -> list[tuple[float, Path]]:
    """(stamp, file) pairs of NAME.txt if it exists, else of the files in NAME/."""
    table = path / f"{name}.txt"
    entries: list[tuple[float, Path]] = []
    if table.is_file():
        lines = list(_lines(table))
        stamps = clock.seconds([stamp for stamp, _, _ in lines], [where for _, _, where in lines])
        entries = [(stamp, path / file) for stamp, (_, file, _) in zip(stamps, lines, strict=True)]
    elif (path / name).is_dir() or name == "depth":
        files = depth_files(path) if not (path / name).is_dir() else list((path / name).iterdir())
        files = [file for file in files if file.suffix.lower() in suffixes]
        entries = sorted(zip(clock.of(files), files, strict=True))
    rising = entries[:1]
    for number, (written, file) in enumerate(entries):
        moved = written if left_out is None else set_back.of(name, written)
        stamp = written if moved is None else moved
        if number and (moved is None or stamp <= rising[-1][0]):
            leave_out(left_out, out_of_order(file, stamp, rising[-1][0]))
        elif number:
            rising.append((stamp, file))
    return rising


def _lines(table: Path) -> Iterator[tuple[str, str, str]]:
    """Stamp and file of each line of a list of images, and where they are."""
    for number, line in enumerate(read_stored_text(table, "a list of images").splitlines(), start=1):
        where, words = f"{table}, line {number}", line.split("#", 1)[0].split()
        if words and len(words) != 2:
            raise RecordingError(f"{where}: expected 'stamp file', found {line!r}")
        if words:
            yield words[0], _inside(words[1], where), where


def _inside(name: str, where: str) -> str:
    """The name of a file in the folder.

    Raises:
        RecordingError: it is outside the folder.
    """
    if PurePath(name).is_absolute() or ".." in PurePath(name).parts or "\0" in name:
        raise RecordingError(f"{where}: expected a file inside the folder, found {name!r:.80}")
    return name


def _stamp(text: str, where: str, unit: float) -> float:
    try:
        stamp = float(text) * unit
    except ValueError:
        stamp = math.nan
    if not math.isfinite(stamp):
        raise RecordingError(f"{where}: expected a stamp, found {text!r}")
    return stamp


def depth_image(stamp: float, file: Path, calibration: FolderCalibration) -> DepthImage:
    """The image in a file of depth/."""
    place = calibration.depth
    content = read_stored(file, "a readable picture")
    image = decode_depth_png(content, file, (place.camera.width, place.camera.height))
    image = np.ascontiguousarray(image[:, ::-1]) if place.mirrored else image
    return DepthImage("depth", stamp, image, 1.0 / calibration.depth_factor, place.camera, place.world_from_sensor)


def color_image(stamp: float, file: Path, color: PlacedCamera) -> ColorImage:
    """The image in a file of rgb/, which is read when it is decoded."""

    def load() -> ByteImage:
        image = decode_color(read_stored(file, "a readable picture"), file, (color.camera.width, color.camera.height))
        return np.ascontiguousarray(image[:, :: -1 if color.mirrored else 1])

    return ColorImage("rgb", stamp, load, color.camera, color.world_from_sensor)


def _sensor(kind: str, words: str, entries: list[tuple[float, Path]], calibration: PlacedCamera) -> SensorInfo:
    detail = f"{calibration.camera.width}x{calibration.camera.height} {words}"
    name = "rgb" if kind == "color" else kind
    return SensorInfo.of(name, kind, calibration.name, [stamp for stamp, _ in entries], detail)
