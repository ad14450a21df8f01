"""Reads truth.csv and init.json beside a recording: exact joint positions and the initial pose."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TypeAlias

import numpy as np

from voodoo.errors import RecordingError, reading
from voodoo.measurements import FloatArray
from voodoo.model.joint import short
from voodoo.recordings.joint_table import read_positions
from voodoo.recordings.recording import Reference, Start
from voodoo.stored import MOST_METADATA, read_stored_text

OWN_ROOTS = ("base_link", "world")
"""The default root frame of a recording is the first of these in its transforms; both files are in it."""

RootFromTruth: TypeAlias = Callable[[float], FloatArray]
"""(4, 4) from the frame of truth.csv to the root frame at a stamp [s]."""
RootFromStart: TypeAlias = Callable[[str | None], FloatArray]
"""(4, 4) from the frame named in init.json, or that of truth.csv, to the root frame."""


def find_beside(bag: Path, name: str) -> Path | None:
    """`name` in the bag's folder or in the folder above, or None."""
    folder = bag if bag.is_dir() else bag.parent
    for candidate in (folder / name, folder.parent / name):
        if candidate.is_file():
            return candidate
    return None


def read_truth(path: Path, root_from_truth: RootFromTruth) -> Reference:
    """Read a truth.csv: stamp_s, then NAME_x,NAME_y,NAME_z [m] in the recording's own root frame; empty cells are missing joints.

    Raises:
        RecordingError: another header, a short row, a cell that is not a number, stamps that do not increase.
    """
    names, table = read_positions(path, ("stamp_s",))
    stamps = table[:, 0]
    if not np.isfinite(stamps).all() or (np.diff(stamps) <= 0.0).any() or np.isinf(table).any():
        raise RecordingError(f"{path}: expected rising stamps and finite positions, found others")
    positions = table[:, 1:].reshape(len(table), len(names), 3)
    for index, stamp in enumerate(stamps):
        root_from_base = root_from_truth(float(stamp))
        positions[index] = positions[index] @ root_from_base[:3, :3].T + root_from_base[:3, 3]
    return Reference(stamps, names, positions, exact=True)


def read_start(path: Path, root_from: RootFromStart) -> Start:
    """Read an init.json: {"height_m": stature, "frame": name, "joints": {name: [x, y, z]}}; height and frame are optional.

    Raises:
        RecordingError: not JSON, another format, or a frame without a transform.
    """
    with reading(path, "a JSON file"):
        content = json.loads(read_stored_text(path, "a JSON file", most=MOST_METADATA))
    if not isinstance(content, dict) or not isinstance(content.get("joints"), dict) or not content["joints"]:
        raise RecordingError(f"{path}: expected an object with the joints of the first frame, found {short(content)}")
    frame = content.get("frame")
    if frame is not None and not isinstance(frame, str):
        raise RecordingError(f"{path}: frame: expected a name, found {short(frame)}")
    root_from_base = root_from(frame)
    joints = {}
    for name, value in content["joints"].items():
        numbers = isinstance(value, list) and len(value) == 3 and all(isinstance(v, (int, float)) for v in value)
        # An integer in JSON may be larger than any float.
        if not numbers or not all(abs(v) <= sys.float_info.max for v in value):
            raise RecordingError(f"{path}: joint {name}: expected [x, y, z] in meters, found {short(value)}")
        x, y, z = (float(v) for v in root_from_base[:3, :3] @ np.array(value, dtype=np.float64) + root_from_base[:3, 3])
        joints[str(name)] = (x, y, z)
    start = Start(joints=joints)
    height = content.get("height_m")
    if height is not None:
        if not isinstance(height, (int, float)) or not 0.3 < height < 3.0:
            raise RecordingError(f"{path}: height_m: expected a stature in meters, found {short(height)}")
        start["height_m"] = float(height)
    return start
