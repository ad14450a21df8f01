"""Reads truth.csv and init.json beside a recording: exact joint positions and the initial pose."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, TypeAlias

import numpy as np
from pydantic import BaseModel, Field, FiniteFloat

from voodoo.errors import RecordingError
from voodoo.measurements import FloatArray
from voodoo.model.joint import valid
from voodoo.model.projection import transform
from voodoo.recordings.joint_table import read_positions
from voodoo.recordings.recording import Reference, Start
from voodoo.stored import MOST_METADATA, read_stored_text

OWN_ROOTS = ("base_link", "world")
"""The default root frame of a recording is the first of these in its transforms; both files are in it."""

RootFromTruth: TypeAlias = Callable[[float], FloatArray]
"""(4, 4) from the frame of truth.csv to the root frame at a stamp [s]."""
RootFromStart: TypeAlias = Callable[[str | None], FloatArray]
"""(4, 4) from the frame named in init.json, or that of truth.csv, to the root frame."""


class FirstPose(BaseModel):
    """The entries of init.json that pose and size a body, see `voodoo.pipeline.start.Init`."""

    height_m: Annotated[FiniteFloat, Field(gt=0.3, lt=3.0)] | None = None
    frame: str | None = None
    joints: Annotated[dict[str, tuple[FiniteFloat, FiniteFloat, FiniteFloat]], Field(min_length=1)]

    def moved(self, pose: FloatArray) -> dict[str, tuple[float, float, float]]:
        """The joints in another frame, by the transform (4, 4) to it."""
        places = {name: (pose[:3, :3] @ place + pose[:3, 3]).tolist() for name, place in self.joints.items()}
        return {name: (x, y, z) for name, (x, y, z) in places.items()}


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
        positions[index] = transform(root_from_truth(float(stamp)), positions[index])
    return Reference(stamps, names, positions, exact=True)


def read_start(path: Path, root_from: RootFromStart) -> Start:
    """Read an init.json: {"height_m": stature, "frame": name, "joints": {name: [x, y, z]}}; height and frame are optional.

    Raises:
        RecordingError: not JSON, another format, or a frame without a transform.
    """
    content = read_stored_text(path, "a JSON file", most=MOST_METADATA)
    with valid(path, RecordingError, most=1):
        written = FirstPose.model_validate_json(content, strict=True)
    start = Start(joints=written.moved(root_from(written.frame)))
    if written.height_m is not None:
        start["height_m"] = written.height_m
    return start
