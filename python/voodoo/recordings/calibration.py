"""Reads calibration.toml, the camera of a folder of images."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from voodoo.errors import CameraError, RecordingError, naming
from voodoo.measurements import FloatArray
from voodoo.model.camera import Camera
from voodoo.model.joint import numbers_or_nan, short
from voodoo.model.toml_io import parse_toml, read_text
from voodoo.model.transforms import is_rigid
from voodoo.recordings.camera_files import PlacedCamera, camera_of, camera_tables
from voodoo.recordings.pictures import picture_size
from voodoo.stored import read_stored

T = TypeVar("T")
_CAMERA_KEYS = ("width", "height", "fx", "fy", "cx", "cy")
_OPTIONAL_KEYS = ("distortion", "model", "mirrored", "sensor_frame", "root_from_sensor")
_ROUNDING, _TYPED = 1e-9, 2e-3
"""Tolerances for the deviation of a matrix from a rotation: by rounding of doubles, and with three typed digits."""


@dataclass(frozen=True, eq=False)
class FolderCalibration:
    """Cameras of a folder, named by their frames; `depth_factor` is units per meter of the depth images."""

    root_frame: str
    depth_factor: float
    depth: PlacedCamera
    color: PlacedCamera | None


_TEMPLATE = """\
width = {width}
height = {height}
fx = 525.0              # pixels, from the maker's tools; by the field of view F across: width / (2 tan(F / 2))
fy = 525.0
cx = {cx}
cy = {cy}
depth_factor = 1000.0   # units per meter: 1000 where images are in millimeters, 5000 in the TUM RGB-D benchmark
sensor_frame = "camera_depth_optical_frame"
"""


def template(like: Path | None) -> str:
    """A template of calibration.toml with the size of an image."""
    try:
        width, height = (640, 480) if like is None else picture_size(read_stored(like, "a readable picture"), like)
    except RecordingError:
        width, height = 640, 480
    return _TEMPLATE.format(width=width, height=height, cx=(width - 1) / 2, cy=(height - 1) / 2)


def read_calibration(path: Path, *, like: Path | None = None) -> FolderCalibration:
    """Read a calibration.toml; see FolderRecording for the format.

    Args:
        path: the file.
        like: one of the images, whose size is used in the template if there is no such file.

    Raises:
        RecordingError: missing, not TOML, or a key is missing, unknown or out of range.
    """
    if not path.is_file():
        if path.parent.is_dir() and (found := _from_yaml(path.parent)):
            return found
        hint = f"Write {path} with the numbers of the camera:\n\n{template(like)}"
        raise RecordingError(f"{path}: expected a calibration file beside the images, found none", hint=hint)
    content = parse_toml(read_text(path, error=RecordingError), source=str(path), error=RecordingError)
    tables = {"depth", "color"}
    _check_keys(content, {*_CAMERA_KEYS, *_OPTIONAL_KEYS, "depth_factor", "root_frame", "color"}, str(path))
    depth = _camera({key: value for key, value in content.items() if key not in tables}, "depth", str(path))
    factor = content.get("depth_factor", 5000.0)
    if isinstance(factor, bool) or not isinstance(factor, (int, float)) or not 0.0 < factor < 1e9:
        raise RecordingError(f"{path}: depth_factor: expected units per meter > 0, found {short(factor)}")
    color = None
    if "color" in content:
        table = _entry(content, "color", dict, {}, "a table", str(path))
        _check_keys(table, {*_CAMERA_KEYS, *_OPTIONAL_KEYS}, f"{path}, [color]")
        color = _camera(table, "color", f"{path}, [color]")
    unmoved = np.array_equal(depth.world_from_sensor, np.eye(4))
    otherwise = depth.name if unmoved else "root"
    root_frame = _entry(content, "root_frame", str, otherwise, "a name", str(path))
    return FolderCalibration(root_frame, float(factor), depth, color)


def _from_yaml(folder: Path) -> FolderCalibration | None:
    """The only camera in the YAML files of a folder, with depth in millimeters; None: there is no such one."""
    files = sorted((*folder.glob("*.yaml"), *folder.glob("*.yml")))
    tables = [(f"{file}, [{name}]", table) for file in files for name, table in camera_tables(file).items()]
    if len(tables) != 1 or "size" not in tables[0][1]:
        return None
    frame = "camera_depth_optical_frame"
    return FolderCalibration(frame, 1000.0, PlacedCamera(frame, camera_of(*tables[0]), np.eye(4)), None)


def _check_keys(table: dict[str, Any], known: set[str], where: str) -> None:
    unknown = sorted(set(table) - known)
    missing = [key for key in _CAMERA_KEYS if key not in table]
    if unknown or missing:
        raise RecordingError(
            f"{where}: expected the keys {', '.join(_CAMERA_KEYS)} and optionally "
            f"{', '.join(sorted(known - set(_CAMERA_KEYS)))}; found missing {missing}, unknown {unknown}"
        )


def _entry(table: dict[str, Any], key: str, kind: type[T], otherwise: T, expected: str, where: str) -> T:
    """An entry of a kind.

    Raises:
        RecordingError: it is of another one.
    """
    value = table.get(key, otherwise)
    if not isinstance(value, kind):
        raise RecordingError(f"{where}: {key}: expected {expected}, found {short(value)}")
    return value


def _camera(table: dict[str, Any], kind: str, where: str) -> PlacedCamera:
    distortion = _entry(table, "distortion", list, [], "a list of numbers", where)
    with naming(where, CameraError, error=RecordingError):
        camera = Camera(
            **{key: table[key] for key in _CAMERA_KEYS},
            distortion=tuple(distortion),
            model=table.get("model", "plumb_bob"),
        )
    frame = _entry(table, "sensor_frame", str, f"camera_{kind}_optical_frame", "a name", where)
    mirrored = _entry(table, "mirrored", bool, False, "true or false", where)
    return PlacedCamera(frame, camera, _pose(table.get("root_from_sensor"), where), mirrored)


def _pose(rows: Any, where: str) -> FloatArray:  # noqa: ANN401 - checked here
    if rows is None:
        return np.eye(4)
    pose = numbers_or_nan(rows)
    if not is_rigid(pose, off=_TYPED):
        raise RecordingError(
            f"{where}: root_from_sensor: expected four rows of a rigid 4x4 transform, found {short(rows)}"
        )
    # A matrix typed with three or four digits is only approximately a rotation, but the tracker needs an exact one.
    if not np.allclose(pose[:3, :3] @ pose[:3, :3].T, np.eye(3), rtol=0.0, atol=_ROUNDING):
        u, _, v = np.linalg.svd(pose[:3, :3])
        pose[:3, :3] = u @ v
    return pose
