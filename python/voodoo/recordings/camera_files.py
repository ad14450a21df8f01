"""Calibrated cameras from files: the TOML of Pose2Sim, anipose, FreeMoCap and Caliscope, YAML (OpenCV conventions), and
calibration.toml, the camera of a folder of images."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field, StrictBool
from ruamel.yaml import YAML

from voodoo.errors import CameraError, RecordingError, naming, reading
from voodoo.measurements import FloatArray
from voodoo.model.camera import LENS_NAMES, Camera
from voodoo.model.joint import Strict, numbers_or_nan, short, valid
from voodoo.model.rotations import matrix_of_turn, nearest_rotations
from voodoo.model.toml_io import parse_toml, read_text
from voodoo.model.transforms import is_rigid, pose_of
from voodoo.recordings.mcap_file import is_plain_yaml
from voodoo.recordings.pictures import picture_size
from voodoo.stored import read_stored

_TURNS = ("rotation", "R", "rvec", "rotation_vector", "rotation_matrix")
_SHIFTS = ("translation", "T", "t", "tvec", "translation_vector")
_KEYS = ("size", "matrix", "distortions", "rotation", "translation")


@dataclass(frozen=True, eq=False)
class PlacedCamera:
    """A camera with its name and its pose (4, 4) in the world or root frame; whether its images are mirrored left to right."""

    name: str
    camera: Camera
    world_from_sensor: FloatArray
    mirrored: bool = False


def read_camera_toml(path: str | Path, *, meters_per_unit: float = 1.0) -> tuple[PlacedCamera, ...]:
    """Cameras of a calibration file, in the order of the file: of Pose2Sim, anipose, FreeMoCap, Caliscope; or YAML of OpenCV,
    ROS (`camera_info`) or Kalibr, whose world is the optical frame of the first camera.

    Each table holds `size` [px], `matrix` (3x3), `distortions` (OpenCV's order), `rotation` (Rodrigues vector [rad],
    or 3x3) and `translation` [m] of camera_from_world, and optionally `name` and `fisheye`. Tables without a `matrix`
    (metadata) are ignored.

    Args:
        path: the file.
        meters_per_unit: of the translations.

    Raises:
        RecordingError: not TOML or YAML, no camera, or a missing or invalid key; names the camera.
    """
    tables = tables_of(Path(path))
    if not tables:
        raise RecordingError(f"{path}: expected a table with a matrix for each camera, found none")
    return tuple(_placed(f"{path}, [{key}]", key, table, meters_per_unit) for key, table in tables.items())


def tables_of(path: Path) -> dict[str, dict[str, Any]]:
    """The tables of the cameras in a calibration file; {} if there is none.

    Raises:
        RecordingError: neither TOML nor YAML.
    """
    if path.suffix.lower() in (".yaml", ".yml"):
        return camera_tables(path)
    content = parse_toml(read_text(path, error=RecordingError), source=str(path), error=RecordingError)
    return {key: value for key, value in content.items() if isinstance(value, dict) and "matrix" in value}


def camera_of(where: str, table: dict[str, Any]) -> Camera:
    """The camera of a table, by its `size`, `matrix`, `distortions`, and `fisheye` or `distortion_model`.

    Raises:
        RecordingError: invalid numbers; `where` begins the message.
    """
    size, matrix = _numbers(where, table, "size", (2,)), _numbers(where, table, "matrix", (3, 3))
    if matrix[0, 1] != 0.0 or (matrix[2] != (0.0, 0.0, 1.0)).any():
        raise RecordingError(f"{where}, matrix: expected no skew and a last row 0 0 1, found {matrix.tolist()}")
    width, height = (round(float(value)) for value in size)
    lens = tuple(_numbers(where, table, "distortions", None).tolist())
    named = "fisheye" if table.get("fisheye", False) is True else str(table.get("distortion_model") or "")
    model: Any = LENS_NAMES.get(named, named)
    if model in ("plumb_bob", "rational_polynomial"):
        model = "plumb_bob" if len(lens) < 8 else "rational_polynomial"
    with naming(where, CameraError, error=RecordingError):
        return Camera(width, height, matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2], lens, model)


def _placed(where: str, key: str, table: dict[str, Any], meters_per_unit: float) -> PlacedCamera:
    missing = [name for name in _KEYS if name not in table]
    if missing:
        raise RecordingError(f"{where}: expected the keys {', '.join(_KEYS)}, found no {', '.join(missing)}")
    camera = camera_of(where, table)
    turn = _numbers(where, table, "rotation", None)
    if turn.shape != (3, 3):
        turn = matrix_of_turn(_numbers(where, table, "rotation", (3,)))
    elif not is_rigid(pose_of(turn), off=1e-3):
        raise RecordingError(f"{where}, rotation: expected a rotation, found {short(table['rotation'])}")
    pose = pose_of(turn.T, -turn.T @ _numbers(where, table, "translation", (3,)) * meters_per_unit)
    return PlacedCamera(str(table.get("name", key)), camera, pose)


def _numbers(where: str, table: dict[str, Any], key: str, shape: tuple[int, ...] | None) -> FloatArray:
    values = numbers_or_nan(table[key])
    if not np.isfinite(values).all() or (shape is not None and values.shape != shape) or values.ndim == 0:
        expected = "a list of" if shape is None else "x".join(map(str, shape))
        raise RecordingError(f"{where}, {key}: expected {expected} finite numbers, found {short(table[key])}")
    return values


def camera_tables(path: Path) -> dict[str, dict[str, Any]]:
    """Name -> table of every camera in the file; {} if there is none.

    Raises:
        RecordingError: not YAML, or numbers that are none; names the file.
    """
    text = read_text(path, error=RecordingError)
    # OpenCV writes a directive and a tag that are no YAML.
    text = re.sub(r"^%YAML[: ].*\n", "", text).replace("!!opencv-matrix", "")
    if not is_plain_yaml(text):
        raise RecordingError(f"{path}: expected YAML without references, and of some hundred numbers, found another")
    with reading(path, "a calibration in YAML"):
        content = YAML(typ="safe", pure=True).load(text)
        if not isinstance(content, Mapping):
            return {}
        rows = {str(key): value for key, value in content.items() if isinstance(value, Mapping)}
        if chain := {key: row for key, row in rows.items() if "intrinsics" in row and "resolution" in row}:
            return _chain(chain)
        cameras = {key: row for key, row in rows.items() if _matrix_key(row)}
        if _matrix_key(content):
            cameras = {str(content.get("camera_name", path.stem)): content}
        return {name: _table(name, row) for name, row in cameras.items()}


def _matrix_key(row: Mapping[str, Any]) -> str:
    return next((key for key in ("camera_matrix", "K") if key in row), "")


def _array(value: object) -> list[Any]:
    """The numbers of a list, or of a matrix with rows, cols and data."""
    if isinstance(value, Mapping):
        shape = (int(value["rows"]), int(value["cols"]))
        value = np.array(value["data"], dtype=np.float64).reshape(shape)
        value = value.ravel() if 1 in shape else value
    return np.array(value, dtype=np.float64).tolist()


def _table(name: str, row: Mapping[str, Any]) -> dict[str, Any]:
    matrix = np.array(_array(row[_matrix_key(row)])).reshape(3, 3)
    lens: object = next((row[key] for key in ("distortion_coefficients", "D") if key in row), [])
    width, height = (row.get(f"image_{key}", row.get(key)) for key in ("width", "height"))
    table: dict[str, Any] = {"name": name, "matrix": matrix.tolist(), "distortions": _array(lens)}
    table["distortion_model"] = row.get("distortion_model")
    if width is not None and height is not None:
        table["size"] = [width, height]
    for key, names in (("rotation", _TURNS), ("translation", _SHIFTS)):
        found = next((row[name] for name in names if name in row), None)
        if found is not None:
            table[key] = _array(found)
    return table


def _chain(rows: Mapping[str, Mapping[str, Any]]) -> dict[str, dict[str, Any]]:
    """Kalibr's cameras; the world is the first one's optical frame."""
    pose = np.eye(4)
    tables: dict[str, dict[str, Any]] = {}
    for name, row in rows.items():
        if row.get("camera_model", "pinhole") != "pinhole":
            raise ValueError(f"{name}: expected the camera_model pinhole, found {row['camera_model']}")
        if tables:
            pose = np.array(row["T_cn_cnm1"], dtype=np.float64).reshape(4, 4) @ pose
        fx, fy, cx, cy = (float(value) for value in row["intrinsics"])
        tables[name] = {
            "name": name,
            "size": list(row["resolution"]),
            "matrix": [[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]],
            "distortions": _array(row.get("distortion_coeffs", [])),
            "distortion_model": row.get("distortion_model"),
            "rotation": pose[:3, :3].tolist(),
            "translation": pose[:3, 3].tolist(),
        }
    return tables


_ROUNDING, _TYPED = 1e-9, 2e-3
"""Tolerances for the deviation of a matrix from a rotation: by rounding of doubles, and with three typed digits."""


class _Placed(Strict):
    """The entries for a camera in a calibration.toml."""

    width: Any
    height: Any
    fx: Any
    fy: Any
    cx: Any
    cy: Any
    distortion: tuple[Any, ...] = ()
    model: Any = "plumb_bob"
    mirrored: StrictBool = False
    sensor_frame: str | None = None
    root_from_sensor: Any = None

    def placed(self, kind: str, where: str) -> PlacedCamera:
        """The camera, checked.

        Raises:
            RecordingError: invalid numbers; `where` begins the message.
        """
        with naming(where, CameraError, error=RecordingError):
            size, focal, middle = (self.width, self.height), (self.fx, self.fy), (self.cx, self.cy)
            camera = Camera(*size, *focal, *middle, self.distortion, self.model)
        name = self.sensor_frame or f"camera_{kind}_optical_frame"
        return PlacedCamera(name, camera, _pose(self.root_from_sensor, where), self.mirrored)


class _Calibration(_Placed):
    """A calibration.toml: the camera of the depth images, and what else it says."""

    depth_factor: Annotated[float, Field(strict=True, gt=0.0, lt=1e9)] = 5000.0
    root_frame: str | None = None
    color: _Placed | None = None


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
        if path.parent.is_dir() and (only := _from_yaml(path.parent)):
            return only
        hint = f"Write {path} with the numbers of the camera:\n\n{template(like)}"
        raise RecordingError(f"{path}: expected a calibration file beside the images, found none", hint=hint)
    content = parse_toml(read_text(path, error=RecordingError), source=str(path), error=RecordingError)
    known = (*_Placed.model_fields, "outside [color] depth_factor", "root_frame", "color")
    with valid(path, RecordingError, known=known):
        found = _Calibration.model_validate(content)
    depth = found.placed("depth", str(path))
    color = None if found.color is None else found.color.placed("color", f"{path}, [color]")
    unmoved = np.array_equal(depth.world_from_sensor, np.eye(4))
    root_frame = found.root_frame or (depth.name if unmoved else "root")
    return FolderCalibration(root_frame, found.depth_factor, depth, color)


def _from_yaml(folder: Path) -> FolderCalibration | None:
    """The only camera in the YAML files of a folder, with depth in millimeters; None: there is no such one."""
    files = sorted((*folder.glob("*.yaml"), *folder.glob("*.yml")))
    tables = [(f"{file}, [{name}]", table) for file in files for name, table in camera_tables(file).items()]
    if len(tables) != 1 or "size" not in tables[0][1]:
        return None
    frame = "camera_depth_optical_frame"
    return FolderCalibration(frame, 1000.0, PlacedCamera(frame, camera_of(*tables[0]), np.eye(4)), None)


def _pose(rows: Any, where: str) -> FloatArray:  # noqa: ANN401 - checked here
    if rows is None:
        return np.eye(4)
    pose = numbers_or_nan(rows)
    if not is_rigid(pose, off=_TYPED):
        raise RecordingError(
            f"{where}: root_from_sensor: expected four rows of a rigid 4x4 transform, found {short(rows)}"
        )
    # A matrix typed with three or four digits is only approximately a rotation, but the tracker needs an exact one.
    return pose if is_rigid(pose, off=_ROUNDING) else pose_of(nearest_rotations(pose[:3, :3]), pose[:3, 3])
