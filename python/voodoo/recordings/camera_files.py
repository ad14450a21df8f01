"""Calibrated cameras from the TOML files of Pose2Sim (OpenCV conventions)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from voodoo.errors import CameraError, RecordingError
from voodoo.measurements import FloatArray
from voodoo.model.camera import Camera
from voodoo.model.joint import short
from voodoo.model.toml_io import parse_toml, read_text

_KEYS = ("size", "matrix", "distortions", "rotation", "translation")


@dataclass(frozen=True, eq=False)
class PlacedCamera:
    """A camera with its name and its pose (4, 4) in the world."""

    name: str
    camera: Camera
    world_from_sensor: FloatArray


def read_camera_toml(path: str | Path) -> tuple[PlacedCamera, ...]:
    """Cameras of a Pose2Sim calibration file, in the order of the file.

    Each table holds `size` [px], `matrix` (3x3), `distortions` (OpenCV's order), `rotation` (Rodrigues vector [rad])
    and `translation` [m] of camera_from_world, and optionally `name` and `fisheye`. Tables without a `matrix`
    (metadata) are ignored.

    Raises:
        RecordingError: not TOML, no camera, or a missing or invalid key; names the camera.
    """
    path = Path(path)
    if not path.is_file():
        raise RecordingError(f"{path}: expected a calibration file, found none")
    content = parse_toml(read_text(path, error=RecordingError), source=str(path), error=RecordingError)
    tables = {key: value for key, value in content.items() if isinstance(value, dict) and "matrix" in value}
    if not tables:
        raise RecordingError(f"{path}: expected a table with a matrix for each camera, found {', '.join(content)}")
    return tuple(_camera(f"{path}, [{key}]", key, table) for key, table in tables.items())


def _camera(where: str, key: str, table: dict[str, Any]) -> PlacedCamera:
    missing = [name for name in _KEYS if name not in table]
    if missing:
        raise RecordingError(f"{where}: expected the keys {', '.join(_KEYS)}, found no {', '.join(missing)}")
    size, matrix = _numbers(where, table, "size", (2,)), _numbers(where, table, "matrix", (3, 3))
    if matrix[0, 1] != 0.0 or (matrix[2] != (0.0, 0.0, 1.0)).any():
        raise RecordingError(f"{where}, matrix: expected no skew and a last row 0 0 1, found {matrix.tolist()}")
    coefficients = tuple(float(value) for value in _numbers(where, table, "distortions", None))
    fisheye = table.get("fisheye", False)
    try:
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
    except CameraError as error:
        raise RecordingError(f"{where}: {error}") from error
    turn, _ = cv2.Rodrigues(_numbers(where, table, "rotation", (3,)))
    pose = np.eye(4)
    pose[:3, :3] = turn.T
    pose[:3, 3] = -turn.T @ _numbers(where, table, "translation", (3,))
    name = table.get("name", key)
    return PlacedCamera(str(name), camera, pose)


def _numbers(where: str, table: dict[str, Any], key: str, shape: tuple[int, ...] | None) -> FloatArray:
    try:
        values = np.array(table[key], dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        values = np.array([np.nan])
    if not np.isfinite(values).all() or (shape is not None and values.shape != shape) or values.ndim == 0:
        expected = "a list of" if shape is None else "x".join(map(str, shape))
        raise RecordingError(f"{where}, {key}: expected {expected} finite numbers, found {short(table[key])}")
    return values
