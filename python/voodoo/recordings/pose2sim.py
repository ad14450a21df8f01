"""Folders of Pose2Sim: 2-D keypoints of several calibrated cameras, and the triangulation to compare with."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from voodoo.errors import MeasurementError, RecordingError
from voodoo.measurements import FloatArray, KeypointImage, RecordedFrame
from voodoo.recordings.camera_files import read_camera_toml
from voodoo.recordings.keypoint_files import read_openpose_json
from voodoo.recordings.keypoint_layouts import layout_of
from voodoo.recordings.left_out import LeftOut
from voodoo.recordings.marker_trajectories import Z_UP_FROM_Y_UP, read_trc
from voodoo.recordings.recording import (
    Recording,
    RecordingInfo,
    Reference,
    SensorInfo,
    Start,
    mean_rate,
    number_option,
)

SITES = {
    f"{side}{joint}": f"{side.lower()}_{site}"
    for side in "LR"
    for joint, site in {
        "Shoulder": "shoulder", "Elbow": "elbow", "Wrist": "wrist", "Hip": "hip", "Knee": "knee", "Ankle": "ankle",
    }.items()
} | {"Neck": "skullbase", "Head": "skull_tip"}  # fmt: skip
"""Pose2Sim's marker names for BODY_25B (its neck is the upper neck) and our sites."""

FRAME = "world"


class Pose2SimRecording(Recording):
    """A folder of Pose2Sim::

        Calib_*.toml                     cameras, see read_camera_toml; world Z up, meters; or in calibration/, ../calibration/
        keypoints/cam01_json/*.json      OpenPose files, one per image, sorted by name; or pose/cam01_json as in Pose2Sim
        *.trc                            optional: triangulated joints, Y up

    Cameras and keypoint folders belong together in the order of their names. There is one frame for each image
    number; it holds the keypoints of all cameras. Stamps are k / rate. The reference, and the start, are the .trc
    with the shortest name (the unfiltered one): markerless triangulation from the same keypoints, `reference.exact`
    is False.

    Args:
        path: the folder.
        layout: of the keypoints, see voodoo.sensors.keypoints.LAYOUTS.
        rate: images per second; not in the folder (`voodoo track --option rate=30`).
        cameras: names to use, as in the calibration file; None means all.
        bare: do not read the .trc.
        left_out: counts unreadable files, whose camera then has no detections; None: they are errors.

    Raises:
        RecordingError: a part is missing or has another format.
    """

    def __init__(
        self,
        path: Path,
        layout: str = "body25b",
        rate: float = 60.0,
        cameras: tuple[str, ...] | None = None,
        *,
        bare: bool = False,
        left_out: LeftOut | None = None,
    ) -> None:
        """Read calibration, the names of the keypoint files and the reference; see the class."""
        self.path = path
        self.name = path.name
        self.root_frame = FRAME
        self._left_out = left_out
        try:
            layout_of(layout)
        except MeasurementError as error:
            raise RecordingError(f"{path}: {error}") from error
        self.layout = layout
        self.rate = number_option(path, "rate", rate, "images per second > 0", most=1e4)
        placed = read_camera_toml(calibration_of(path))
        folders = keypoint_folders(path)
        if len(folders) != len(placed):
            raise RecordingError(
                f"{path}: expected a folder keypoints/*_json for each of {len(placed)} cameras, found {len(folders)}"
            )
        names = [camera.name for camera in placed]
        unknown = sorted(set(cameras or ()) - set(names))
        if unknown or cameras == ():
            raise RecordingError(f"{path}: cameras: expected some of {', '.join(names)}, found {cameras}")
        chosen = [pair for pair in zip(placed, folders, strict=True) if cameras is None or pair[0].name in cameras]
        self.cameras = tuple(camera for camera, _ in chosen)
        self._files = [sorted(folder.glob("*.json")) for _, folder in chosen]
        counts = {len(files) for files in self._files}
        if len(counts) != 1 or counts == {0}:
            raise RecordingError(f"{path}: expected as many keypoint files for every camera, found {sorted(counts)}")
        self.reference = None if bare else read_triangulation(path, self.rate)
        self.start = None if self.reference is None else start_of(self.reference)

    def __len__(self) -> int:
        """Number of images of each camera."""
        return len(self._files[0])

    def __iter__(self) -> Iterator[RecordedFrame]:
        """Keypoints of all cameras, image by image; see Recording."""
        for index in range(len(self)):
            stamp = index / self.rate
            yield RecordedFrame(
                stamp,
                tuple(
                    KeypointImage(
                        sensor=placed.name,
                        stamp=stamp,
                        people=self._people(files[index]),
                        layout=self.layout,
                        camera=placed.camera,
                        root_from_sensor=placed.world_from_sensor,
                    )
                    for placed, files in zip(self.cameras, self._files, strict=True)
                ),
            )

    def _people(self, file: Path) -> tuple[FloatArray, ...]:
        try:
            return tuple(read_openpose_json(file, layout=self.layout))
        except RecordingError as error:
            if self._left_out is None:
                raise
            self._left_out.add_error(error)
            return ()

    def info(self) -> RecordingInfo:
        """Summarize."""
        duration = (len(self) - 1) / self.rate
        rate = mean_rate(len(self), duration)
        words, notes = (
            f"{self.layout} keypoints",
            "triangulated from the same keypoints: it tests consistency, not accuracy",
        )
        sensors = (SensorInfo(one.name, "keypoints", one.name, len(self), rate, words) for one in self.cameras)
        return self._described("pose2sim", sensors, duration=duration, notes=(f"the reference is {notes}",))


def keypoint_folders(path: Path) -> list[Path]:
    """The folders of keypoint files in a Pose2Sim folder, one per camera."""
    return next((found for part in ("keypoints", "pose") if (found := sorted((path / part).glob("*_json")))), [])


def calibrations(path: Path) -> list[Path]:
    """The calibration files of a Pose2Sim folder: in it, or in `calibration/` of it or of its parent folder."""
    places = (path, *(folder / name for folder in (path, path.parent) for name in ("calibration", "Calibration")))
    return next((found for place in places if (found := sorted(place.glob("Calib*.toml")))), [])


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


def read_triangulation(path: Path, rate: float) -> Reference | None:
    """The triangulated joints of a Pose2Sim folder, at stamps k / rate; None without any.

    Raises:
        RecordingError: a .trc that cannot be read.
    """
    files = sorted(path.glob("*.trc"), key=lambda file: (len(file.name), file.name))
    if not files:
        return None
    names, positions = read_trc(files[0], world_from_file=Z_UP_FROM_Y_UP).of(SITES)
    # Rows are images; the file's own time starts at 1 / rate for image 0.
    return Reference(np.arange(len(positions)) / rate, names, positions, exact=False)


def start_of(reference: Reference) -> Start:
    """The first row of a reference as a start."""
    joints = {}
    for name, position in zip(reference.names, reference.positions[0], strict=True):
        if np.isfinite(position).all():
            x, y, z = (float(value) for value in position)
            joints[name] = (x, y, z)
    return Start(joints=joints)
