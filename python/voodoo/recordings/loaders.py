"""Selects the loader of a recording."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from voodoo.errors import RecordingError, a_path
from voodoo.names import ROS1_SUFFIXES, ROS2_SUFFIXES
from voodoo.stored import MOST_RECORDED, check_stored

if TYPE_CHECKING:
    from voodoo.recordings.left_out import LeftOut
    from voodoo.recordings.recording import Recording


@dataclass(frozen=True)
class Loader:
    """Opener and file layout of one kind of recording.

    Args:
        module: module of this package; it is imported when it is needed, because it needs libraries that others do not.
        name: name of the opener in it.
        expects: description of the files.
        suffixes: ends of their names, in lower case; () for folders.
        elsewhere: option of other loaders -> what says the same of these recordings.
    """

    module: str
    name: str
    expects: str
    suffixes: tuple[str, ...] = ()
    elsewhere: Mapping[str, str] = field(default_factory=dict)

    @property
    def open(self) -> Callable[..., Recording]:
        """Called with the path and the loader's options."""
        opener: Callable[..., Recording] = getattr(import_module(f"voodoo.recordings.{self.module}"), self.name)
        return opener


LOADERS: dict[str, Loader] = {
    "ros2": Loader(
        "ros",
        "RosRecording",
        "a ROS 2 bag: folder with metadata.yaml or bag/, .mcap or .db3, or a .zip of it",
        ROS2_SUFFIXES,
    ),
    "ros1": Loader("ros", "RosRecording", "a ROS 1 .bag, or a .zip of it", ROS1_SUFFIXES),
    "utd-mhad": Loader("utd_mhad", "UtdMhadRecording", "a *_depth.mat of UTD-MHAD", ("_depth.mat",)),
    "folder": Loader(
        "folder",
        "FolderRecording",
        "a folder with depth images (depth/*.png in the TUM RGB-D layout, or *.png) and calibration.toml",
        elsewhere={
            "root_frame": "root_frame in calibration.toml",
            "meters_per_unit": "depth_factor in calibration.toml",
        },
    ),
    "pose2sim": Loader("pose2sim", "Pose2SimRecording", "a folder of Pose2Sim: Calib*.toml and keypoints/*_json"),
    "videos": Loader(
        "videos", "VideosRecording", "a folder with Calib*.toml and videos/* or images/*/ of several cameras"
    ),
    "azure-kinect": Loader(
        "azure_kinect", "AzureKinectRecording", "a .mkv of an Azure Kinect or Femto Bolt", (".mkv",)
    ),
    "markers": Loader("marker_files", "MarkerRecording", "a .trc or .c3d file of markers", (".trc", ".c3d")),
}
SUFFIXES = (".zip", *(suffix for loader in LOADERS.values() for suffix in loader.suffixes))
"""Ends of the names of files that are recordings, in lower case."""


NUMBERS = ("rate", "meters_per_unit", "tf_max_age", "unpacked_gb", "seconds_per_unit")
"""Options of loaders that are numbers."""
_COMMAND_LINE = {"root_frame": "--frame NAME", "layout": "--layout NAME", "background": "--background DIR"} | {
    name: f"--option {name}=NUMBER" for name in NUMBERS
}
"""Options of loaders, but for topics, as they are on the command line."""

_FILM = ("a film", "depth, or a folder with the films of several cameras and their calibration, Calib*.toml")
_ADVICE = {
    ".oni": ("a recording of OpenNI", "its depth images as PNG files in a folder"),
    ".svo": ("a recording of a ZED", "its depth images as PNG files in a folder, or a ROS bag"),
    ".svo2": ("a recording of a ZED", "its depth images as PNG files in a folder, or a ROS bag"),
} | dict.fromkeys((".mp4", ".avi", ".mov", ".webm", ".m4v"), _FILM)
"""Suffix of an unsupported file -> what is needed instead."""


def open_recording(
    path: str | Path,
    *,
    loader: str | None = None,
    bare: bool = False,
    left_out: LeftOut | None = None,
    **options: Any,  # noqa: ANN401
) -> Recording:
    """Open a recording.

    Args:
        path: file or folder; of a folder with one .mkv and neither folders nor calibration, the .mkv.
        loader: name in LOADERS; guessed from the path when None.
        bare: leave out first pose, truth and reference, and read none of the files beside the recording that hold them.
        left_out: counts unusable measurements (repeated, late or undecodable images), which are left out; None: they are errors.
        **options: of the loader, e.g. `use=("depth", "scan")`, `root_frame="odom"` for bags; see RosRecording,
            UtdMhadRecording and FolderRecording.

    Raises:
        RecordingError: the path does not exist, no loader for it, an unknown loader or option, or damage.
    """
    path = a_path(path, error=RecordingError)
    if loader is not None and loader not in LOADERS:
        raise RecordingError(f"loader {loader!r}: expected one of {', '.join(LOADERS)}")
    if not path.exists():
        raise RecordingError(f"{path}: expected a recording, found no such file or folder")
    if loader is None and path.is_dir() and len(films := list(path.glob("*.mkv"))) == 1:
        beside = any(part.is_dir() or part.suffix == ".toml" for part in path.iterdir())
        path = path if beside else films[0]
    name = guess_loader(path) if loader is None else loader
    known = options_of(name)
    if bare and "bare" in known:
        options["bare"] = True
    if left_out is not None and "left_out" in known:
        options["left_out"] = left_out
    unknown = sorted(set(options) - set(known))
    if unknown:
        raise RecordingError(_unknown_words(path, name, unknown[0]))
    recording = LOADERS[name].open(path, **options)
    if recording.loader != name:  # the bag determines which of the two kinds it is
        raise RecordingError(
            f"{path}: expected {LOADERS[name].expects}, found a bag for the loader {recording.loader!r}"
        )
    return recording


def options_of(name: str) -> tuple[str, ...]:
    """Names of the options that a loader takes."""
    return tuple(inspect.signature(LOADERS[name].open).parameters)[1:]


def _unknown_words(path: Path, loader: str, option: str) -> str:
    """Why a loader does not take an option: what the option is for, and what says the same of this recording."""
    takers = [name for name in LOADERS if option in options_of(name)]
    own = ", ".join(name for name in options_of(loader) if name not in ("bare", "left_out")) or "none"
    if not takers:
        return f"{path}: expected an option of the loader {loader} ({own}), found {option}"
    topic = f"--topic {option.removesuffix('_topic')}=NAME" if option.endswith("_topic") else ""
    words = f"{option} ({topic or _COMMAND_LINE.get(option, 'Python only')}): expected a recording it is for"
    instead = LOADERS[loader].elsewhere.get(option)
    advice = f"use {instead}" if instead else f"its options: {own}"
    return f"{path}: {words} (loader {', '.join(takers)}), found one of the loader {loader}; {advice}"


def guess_loader(path: Path) -> str:
    """Name of the loader for a path.

    Raises:
        RecordingError: no loader matches; the message lists the loaders.
    """
    from voodoo.recordings.ros_bag import find_bag, zip_members

    if path.exists() and not path.is_dir():
        check_stored(path, "a recording", most=MOST_RECORDED)
    if path.is_file():
        zipped = path.suffix.lower() == ".zip"
        names = zip_members(path) if zipped else [path.name]
        for kind in ("ros1", "ros2") if zipped else LOADERS:
            if any(name.lower().endswith(LOADERS[kind].suffixes) for name in names):
                return kind
    else:
        if any(path.glob("Calib*.toml")):
            return _of_cameras(path) or "pose2sim"
        if (path / "depth").is_dir() or (path / "depth.txt").is_file():
            return "folder"
        if (path / "rgb").is_dir() or (path / "rgb.txt").is_file():
            raise RecordingError(
                f"{path}: expected depth images in depth/, found color alone; depth of the same camera is needed, or several "
                "calibrated cameras (a folder with their videos and Calib*.toml); docs/how-to/color.md says how"
            )
        cameras = _of_cameras(path)
        if cameras is not None:
            return cameras
        if any(path.glob("*.png")) or any(path.glob("*.pgm")):
            return "folder"
        try:
            return "ros1" if find_bag(path).suffix.lower() in ROS1_SUFFIXES else "ros2"
        except RecordingError as error:
            _refuse_keypoints_alone(path)
            if not any(path.iterdir()):
                raise RecordingError(f"{path}: expected a recording, found an empty folder; {_listing()}") from error
            raise RecordingError(f"{error}; {_listing()}") from error
    advice = _ADVICE.get(path.suffix.lower())
    if advice is not None:
        raise RecordingError(f"{path}: expected {advice[1]}, found {advice[0]}; docs/how-to/cameras.md says how")
    raise RecordingError(f"{path}: found no loader for it; {_listing()}")


def _of_cameras(path: Path) -> str | None:
    """The loader of a folder of several cameras, for their keypoints if there are any, else for their images; None: not such a
    folder.

    Raises:
        RecordingError: videos without a calibration.
    """
    from voodoo.recordings.pose2sim import calibration_of, calibrations, keypoint_folders
    from voodoo.recordings.videos import picture_sources

    known = bool(calibrations(path))
    if known and keypoint_folders(path):
        return "pose2sim"
    sources = picture_sources(path, anywhere=known)
    if sources:
        calibration_of(path, [source.stem for source in sources])
    return "videos" if sources else None


def _refuse_keypoints_alone(path: Path) -> None:
    """Raise an error if a folder has keypoint files and nothing that says what they are of.

    Raises:
        RecordingError: it names what a folder of keypoints needs.
    """
    from voodoo.recordings.pose2sim import calibration_of, keypoint_folders

    folders = keypoint_folders(path)
    if folders:
        calibration_of(path, [folder.name.removesuffix("_json") for folder in folders])
    if any(path.glob("*_json")) or any(path.glob("*_keypoints.json")) or path.resolve().name.endswith("_json"):
        raise RecordingError(
            f"{path}: expected a recording, found keypoint files alone; several calibrated cameras need a folder of "
            "Calib*.toml and keypoints/CAMERA_json/*.json, and one camera with depth is a recording of its own: "
            "voodoo track RECORDING --keypoints SENSOR=DIR"
        )


def _listing() -> str:
    return "loaders: " + "; ".join(f"{name}: {loader.expects}" for name, loader in LOADERS.items())


def sample_path() -> Path:
    """Folder of the bundled recording: 90 frames of a rendered person who bends over, scoops and reaches up.

    It opens like any other: `open_recording(sample_path())`. Source and license are in its README.md.
    """
    return Path(__file__).resolve().parent.parent / "data" / "bend_scoop"
