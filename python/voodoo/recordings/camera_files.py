"""Calibrated cameras from the TOML files of Pose2Sim, anipose, FreeMoCap and Caliscope, or YAML (OpenCV conventions)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from voodoo.errors import CameraError, RecordingError, naming
from voodoo.measurements import FloatArray
from voodoo.model.camera import Camera
from voodoo.model.joint import numbers_or_nan, short
from voodoo.model.toml_io import parse_toml, read_text
from voodoo.model.transforms import is_rigid, pose_of
from voodoo.recordings.camera_yaml import camera_tables

_KEYS = ("size", "matrix", "distortions", "rotation", "translation")


@dataclass(frozen=True, eq=False)
class PlacedCamera:
    """A camera with its name and its pose (4, 4) in the world."""

    name: str
    camera: Camera
    world_from_sensor: FloatArray


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
    path = Path(path)
    if not path.is_file():
        raise RecordingError(f"{path}: expected a calibration file, found none")
    tables = tables_of(path)
    if not tables:
        raise RecordingError(f"{path}: expected a table with a matrix for each camera, found none")
    return tuple(_camera(f"{path}, [{key}]", key, table, meters_per_unit) for key, table in tables.items())


def tables_of(path: Path) -> dict[str, dict[str, Any]]:
    """The tables of the cameras in a calibration file; {} if there is none.

    Raises:
        RecordingError: neither TOML nor YAML.
    """
    if path.suffix.lower() in (".yaml", ".yml"):
        return camera_tables(path)
    content = parse_toml(read_text(path, error=RecordingError), source=str(path), error=RecordingError)
    return {key: value for key, value in content.items() if isinstance(value, dict) and "matrix" in value}


def _camera(where: str, key: str, table: dict[str, Any], meters_per_unit: float) -> PlacedCamera:
    missing = [name for name in _KEYS if name not in table]
    if missing:
        raise RecordingError(f"{where}: expected the keys {', '.join(_KEYS)}, found no {', '.join(missing)}")
    size, matrix = _numbers(where, table, "size", (2,)), _numbers(where, table, "matrix", (3, 3))
    if matrix[0, 1] != 0.0 or (matrix[2] != (0.0, 0.0, 1.0)).any():
        raise RecordingError(f"{where}, matrix: expected no skew and a last row 0 0 1, found {matrix.tolist()}")
    coefficients = tuple(float(value) for value in _numbers(where, table, "distortions", None))
    fisheye = table.get("fisheye", False)
    with naming(where, CameraError, error=RecordingError):
        camera = Camera(
            width=round(float(size[0])),
            height=round(float(size[1])),
            fx=float(matrix[0, 0]),
            fy=float(matrix[1, 1]),
            cx=float(matrix[0, 2]),
            cy=float(matrix[1, 2]),
            distortion=coefficients,
            model="equidistant" if fisheye is True else "plumb_bob" if len(coefficients) < 8 else "rational_polynomial",
        )
    turn = _numbers(where, table, "rotation", None)
    if turn.shape != (3, 3):
        turn = np.asarray(cv2.Rodrigues(_numbers(where, table, "rotation", (3,)))[0], dtype=np.float64)
    elif not is_rigid(pose_of(turn), off=1e-3):
        raise RecordingError(f"{where}, rotation: expected a rotation, found {short(table['rotation'])}")
    pose = pose_of(turn.T, -turn.T @ _numbers(where, table, "translation", (3,)) * meters_per_unit)
    name = table.get("name", key)
    return PlacedCamera(str(name), camera, pose)


def _numbers(where: str, table: dict[str, Any], key: str, shape: tuple[int, ...] | None) -> FloatArray:
    values = numbers_or_nan(table[key])
    if not np.isfinite(values).all() or (shape is not None and values.shape != shape) or values.ndim == 0:
        expected = "a list of" if shape is None else "x".join(map(str, shape))
        raise RecordingError(f"{where}, {key}: expected {expected} finite numbers, found {short(table[key])}")
    return values
