"""Calibrations of cameras in YAML (OpenCV, `camera_info` of ROS, Kalibr), as the tables of a Pose2Sim calibration."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from ruamel.yaml import YAML

from voodoo.errors import RecordingError, reading
from voodoo.model.toml_io import read_text
from voodoo.recordings.mcap_file import is_plain_yaml

_TURNS = ("rotation", "R", "rvec", "rotation_vector", "rotation_matrix")
_SHIFTS = ("translation", "T", "t", "tvec", "translation_vector")


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
    table["fisheye"] = row.get("distortion_model") in ("equidistant", "fisheye")
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
            "fisheye": row.get("distortion_model") == "equidistant",
            "rotation": pose[:3, :3].tolist(),
            "translation": pose[:3, 3].tolist(),
        }
    return tables
