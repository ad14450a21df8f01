"""Folders of Pose2Sim: 2-D keypoints of several calibrated cameras, and the triangulation to compare with."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from voodoo.errors import MeasurementError, RecordingError, naming
from voodoo.measurements import FloatArray, KeypointImage, RecordedFrame
from voodoo.recordings.camera_files import PlacedCamera, read_camera_toml, tables_of
from voodoo.recordings.keypoint_check import check_keypoints, some_of, taken_layout
from voodoo.recordings.keypoint_files import read_people, refuse_unread
from voodoo.recordings.keypoint_layouts import layout_of
from voodoo.recordings.left_out import LeftOut
from voodoo.recordings.marker_trajectories import Z_UP_FROM_Y_UP, read_trc
from voodoo.recordings.order import in_order, matched, numbers_of
from voodoo.recordings.recording import Recording, Reference, SensorInfo, Start, number_option

SITES = {
    f"{side}{joint.capitalize()}": f"{side.lower()}_{joint}"
    for side in "LR"
    for joint in ("shoulder", "elbow", "wrist", "hip", "knee", "ankle")
} | {"Neck": "skullbase", "Head": "skull_tip"}
"""Pose2Sim's marker names for BODY_25B (its neck is the upper neck) and our sites."""

FRAME = "world"
_MOST_MISSING = 1.5
"""Numbers of all cameras' keypoint files, by those of the camera with most, above which they are no common image numbers."""


class Pose2SimRecording(Recording):
    """A folder of Pose2Sim::

        Calib_*.toml                     cameras, see read_camera_toml; world Z up, meters; or in calibration/, ../calibration/
        keypoints/cam01_json/*.json      OpenPose files, one per image, numbered; or pose/cam01_json as in Pose2Sim
        *.trc                            optional: triangulated joints, Y up

    Cameras and keypoint folders are paired by name (`cam01_json` is `cam_1`), else by number, else, if there are as many of both,
    in the order of names; cameras without a folder are not used. There is one frame for each image number; it holds the
    keypoints of all cameras that have this number. Stamps are k / rate. The keypoints are checked against the calibration.
    The reference, and the start, are the .trc with the shortest name (the unfiltered one): markerless triangulation from
    the same keypoints, `reference.exact` is False.

    Args:
        path: the folder.
        layout: of the keypoints, see voodoo.sensors.keypoints.LAYOUTS; None: told by their number and the shape of the persons.
        meters_per_unit: of the calibration's translations.
        rate: images per second; not in the folder (`voodoo track --option rate=30`).
        cameras: names to use, as in the calibration file; None means all.
        bare: do not read the .trc.
        left_out: counts unreadable files, whose camera then has no detections; None: they are errors.

    Raises:
        RecordingError: a part is missing or has another format, or keypoints and calibration do not fit.
    """

    loader = "pose2sim"

    def __init__(
        self,
        path: Path,
        layout: str | None = None,
        rate: float = 60.0,
        cameras: tuple[str, ...] | None = None,
        *,
        meters_per_unit: float = 1.0,
        bare: bool = False,
        left_out: LeftOut | None = None,
    ) -> None:
        """Read calibration, the names of the keypoint files and the reference; see the class."""
        self.path, self.name, self.root_frame = path, path.name, FRAME
        self._left_out = left_out
        with naming(path, MeasurementError, error=RecordingError):
            layout_of(layout or "body25b")
        self.rate = number_option(path, "rate", rate)
        scale = number_option(path, "meters_per_unit", meters_per_unit)
        placed = read_camera_toml(calibration_of(path), meters_per_unit=scale)
        folders = keypoint_folders(path)
        chosen = cameras_of(path, placed, folders, ("a folder keypoints/*_json", "cameras"), cameras)
        self.cameras, self._folders = zip(*chosen, strict=True)
        self._files, self._notes = _rows_of(path, self._folders)
        self._stamps = np.arange(len(self._files)) / self.rate
        self._check(layout)
        self.reference = None if bare else read_triangulation(path, self._stamps)
        if self.reference is not None:
            self.start = start_of(self.reference, self._stamps)
            kind = "the same keypoints: it tests consistency, not accuracy"
            self._notes = (*self._notes, f"the reference is triangulated from {kind}")

    def __iter__(self) -> Iterator[RecordedFrame]:
        """Keypoints of all cameras, image by image; see Recording."""
        for index in range(len(self)):
            yield RecordedFrame(index / self.rate, self._images(index, self.layout, self._left_out))

    def _images(self, index: int, layout: str | None, left_out: LeftOut | None) -> tuple[KeypointImage, ...]:
        return tuple(
            KeypointImage(
                sensor=placed.name,
                stamp=index / self.rate,
                people=read_people(file, layout=layout, left_out=left_out),
                layout=layout or "",
                camera=placed.camera,
                root_from_sensor=placed.world_from_sensor,
            )
            for placed, file in zip(self.cameras, self._files[index], strict=True)
        )

    def _check(self, asked: str | None) -> None:
        """Tell the layout, and check the keypoints of some instants against the calibration."""
        unread = None if self._left_out is None else LeftOut()
        instants = some_of(
            range(len(self)),
            lambda index: self._images(index, asked, unread),
            good=lambda images: any(image.people for image in images),
        )
        people = [rows for instant in instants for image in instant for rows in image.people]
        refuse_unread(self.path, people, unread)
        self.layout, notes = taken_layout(people, asked)
        count = layout_of(self.layout).count
        instants = [
            tuple(
                replace(image, people=tuple(rows for rows in image.people if len(rows) == count)) for image in instant
            )
            for instant in instants
        ]
        self.assumed = (*notes, *check_keypoints(self.path, instants))

    def _sensors(self) -> Iterator[SensorInfo]:
        for one, folder in zip(self.cameras, self._folders, strict=True):
            detail = f"{self.layout} keypoints of {folder.relative_to(self.path)}"
            yield SensorInfo.of(one.name, "keypoints", one.name, self._stamps, detail)


def cameras_of(
    path: Path,
    placed: Sequence[PlacedCamera],
    sources: Sequence[Path],
    words: tuple[str, str],
    chosen: str | Sequence[str] | None,
) -> list[tuple[PlacedCamera, Path]]:
    """Cameras and what each has recorded, in the order of the calibration; those that are chosen, in that order.

    Args:
        path: folder of the recording.
        placed: calibrated cameras.
        sources: a file or folder of each.
        words: what the sources are, and the name of the option `chosen`, for errors.
        chosen: names of cameras or of their sources; None: all.

    Raises:
        RecordingError: neither names nor numbers match, or a chosen one does not exist.
    """
    own = [each.name.removesuffix("_json") if each.is_dir() else each.stem for each in sources]
    found = matched([camera.name for camera in placed], own)
    if found is None:
        raise RecordingError(
            f"{path}: expected {words[0]} for each camera, by its name or as many as there are cameras "
            f"({', '.join(one.name for one in placed)}), found {', '.join(one.name for one in sources) or 'none'}"
        )
    pairs = [(placed[camera], sources[source]) for camera, source in found]
    if chosen is None:
        return pairs
    names = [chosen] if isinstance(chosen, str) else list(chosen)
    known = {
        name: pair for pair in pairs for name in (pair[1].relative_to(path).as_posix(), pair[1].stem, pair[0].name)
    }
    if (unknown := [name for name in names if name not in known]) or not names:
        some = ", ".join(camera.name for camera, _ in pairs)
        raise RecordingError(f"{path}: {words[1]}: expected some of {some}, found {', '.join(unknown) or 'none'}")
    return [known[name] for name in dict.fromkeys(names)]


def _rows_of(path: Path, folders: Sequence[Path]) -> tuple[list[tuple[Path | None, ...]], tuple[str, ...]]:
    """The files of all cameras, image by image, and what should be said about their order.

    Files with the same number belong together. They belong together in their order if names have no numbers, if each camera
    counts without gaps to the same number of images, but from different ones, or if few numbers are common (times).

    Raises:
        RecordingError: no files, or another number of them for a camera and no common numbers.
    """
    files = [in_order(list(folder.glob("*.json"))) for folder in folders]
    counts = {len(each) for each in files}
    numbered = [numbers_of(each) for each in files]
    numbers = [each for each in numbered if each is not None]
    union = sorted({number for each in numbers for number in each})
    common = len(numbers) == len(files) and len(union) <= _MOST_MISSING * max(counts, default=0)
    if counts == {0} or (len(counts) > 1 and not common):
        found = ", ".join(f"{folder.name} {len(own)}" for folder, own in zip(folders, files, strict=True))
        raise RecordingError(
            f"{path}: expected as many keypoint files for every camera, or numbers in their names, found {found} files"
        )
    gapless = all(max(each) - min(each) + 1 == len(each) for each in numbers if each)
    differ = any(each != numbers[0] for each in numbers)
    if len(numbers) < len(files) or (len(counts) == 1 and (gapless or not common or not differ)):
        note = "the cameras' keypoint files have different numbers: they are paired in their order" if differ else ""
        if len(numbers) < len(files):
            unnumbered = "the names of keypoint files have no numbers: they are taken in the order of names"
            note = "" if counts == {1} else unnumbered
        return list(zip(*files, strict=True)), (note,) if note else ()
    of = [dict(zip(each, own, strict=True)) for each, own in zip(numbers, files, strict=True)]
    lacking = ", ".join(f"{folder.name} {len(union) - len(own)}" for folder, own in zip(folders, files, strict=True))
    return [tuple(each.get(number) for each in of) for number in union], (
        f"keypoint files are paired by their numbers; of {len(union)} are missing: {lacking}",
    )


def keypoint_folders(path: Path) -> list[Path]:
    """The folders of keypoint files in a Pose2Sim folder, one per camera."""
    return next(
        (found for part in ("keypoints", "pose") if (found := in_order(list((path / part).glob("*_json"))))), []
    )


def calibrations(path: Path) -> list[Path]:
    """The calibration files of a Pose2Sim folder: in it, or in `calibration/` of it or of its parent folder.

    Where there is no Calib*.toml, files of other programs with cameras in them.
    """
    places = (path, *(folder / name for folder in (path, path.parent) for name in ("calibration", "Calibration")))
    own = next((found for place in places if (found := sorted(place.glob("Calib*.toml")))), [])
    return own or next(
        (found for place in places if (found := [one for one in _others(place) if _has_cameras(one)])), []
    )


def _others(place: Path) -> list[Path]:
    names = ("*calib*.toml", "camera_array*.toml", "config.toml", "*.yaml", "*.yml")
    return sorted(
        {file for name in names for file in place.glob(name) if file.name != "metadata.yaml" and file.is_file()}
    )


def _has_cameras(file: Path) -> bool:
    try:
        return bool(tables_of(file))
    except RecordingError:
        return False


_TEMPLATE = """\
[{name}]
name = "{name}"
size = [1920.0, 1080.0]                     # pixels
matrix = [[1500.0, 0.0, 959.5], [0.0, 1500.0, 539.5], [0.0, 0.0, 1.0]]
distortions = [0.0, 0.0, 0.0, 0.0]          # as OpenCV has them
rotation = [1.57, 0.0, 0.0]                 # camera from world, Rodrigues vector in radians
translation = [0.0, 1.0, 3.0]               # camera from world, meters
"""


def calibration_of(path: Path, names: Sequence[str] = ()) -> Path:
    """The only calibration file of a Pose2Sim folder.

    Raises:
        RecordingError: none, or several; the hint has a template for cameras with these names.
    """
    found = calibrations(path)
    if len(found) != 1:
        tables = "\n".join(_TEMPLATE.format(name=name) for name in names)
        hint = (
            f"Write {path / 'Calib.toml'} with the numbers of the cameras:\n\n{tables}" if names and not found else ""
        )
        calibration = "one Calib*.toml, the calibration of the cameras"
        raise RecordingError(f"{path}: expected {calibration}, found {len(found) or 'none'}", hint=hint)
    return found[0]


def start_of(reference: Reference, stamps: Sequence[float] | FloatArray) -> Start | None:
    """The first row of a reference, if it is of the first image."""
    return reference.as_start() if reference.stamps[0] == stamps[0] else None


def read_triangulation(path: Path, stamps: Sequence[float] | FloatArray) -> Reference | None:
    """The triangulated joints of a Pose2Sim folder, whose images have these stamps [s]; None without any.

    Raises:
        RecordingError: a .trc that cannot be read.
    """
    files = sorted(path.glob("*.trc"), key=lambda file: (len(file.name), file.name))
    if not files:
        return None
    content = read_trc(files[0])
    names, positions = content.of(SITES)
    # Rows are images, from that one on at which the triangulation began; earlier versions' time starts at 1 / rate for it.
    own = np.array(stamps[content.first :][: len(positions)], dtype=np.float64)
    if not len(own):
        return None
    return Reference(own, names, positions[: len(own)] @ Z_UP_FROM_Y_UP.T, exact=False)
