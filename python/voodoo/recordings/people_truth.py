"""truth_people.csv beside a recording: positions of all persons, and their visible fractions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from voodoo.errors import RecordingError
from voodoo.measurements import FloatArray
from voodoo.model.projection import transform
from voodoo.recordings.joint_table import read_positions
from voodoo.stored import MOST_BYTES

PEOPLE_TRUTH_FILE = "truth_people.csv"
_FIRST = ("stamp_s", "person", "in_view")
_LAST = np.iinfo(np.int32).max


@dataclass(frozen=True, eq=False, repr=False)
class PeopleTruth:
    """Exact joints of P persons at F stamps.

    Args:
        stamps: (F,) [s], increasing; those at which a person is in the scene.
        persons: (P,) numbers from 1, the same when a person comes back.
        in_view: (F, P) fraction of a person's pixels that is visible to the depth camera, 0..1; 0 outside the scene.
        names: J site names.
        positions: (F, P, J, 3) [m] in the recording's root frame; NaN for persons outside the scene.
    """

    stamps: FloatArray
    persons: npt.NDArray[np.int64]
    in_view: FloatArray
    names: tuple[str, ...]
    positions: FloatArray

    def __post_init__(self) -> None:
        """Check that the arrays belong together."""
        frames, persons, joints = len(self.stamps), len(self.persons), len(self.names)
        expected = {"in_view": (frames, persons), "positions": (frames, persons, joints, 3)}
        for name, shape in expected.items():
            if getattr(self, name).shape != shape:
                raise RecordingError(f"{name}: expected shape {shape}, found {getattr(self, name).shape}")

    def __repr__(self) -> str:
        """One line with the counts."""
        return f"PeopleTruth({len(self.persons)} persons, {len(self.stamps)} stamps, {len(self.names)} joints)"

    def of(self, name: str) -> FloatArray:
        """Positions (F, P, 3) [m] of a site; NaN where it is missing."""
        if name not in self.names:
            return np.full((*self.in_view.shape, 3), np.nan)
        return np.asarray(self.positions[:, :, self.names.index(name)])


def read_people_truth(path: Path, root_from_truth: Callable[[float], FloatArray]) -> PeopleTruth:
    """Read a truth_people.csv: stamp_s, person, in_view, then NAME_x,NAME_y,NAME_z [m] in base_link.

    Args:
        path: the file.
        root_from_truth: (4, 4) root_from_base_link at a stamp [s].

    Raises:
        RecordingError: another header, a short row, a cell that is not a number, or two rows of a person at one stamp.
    """
    names, table = read_positions(path, _FIRST)
    if not names:
        raise RecordingError(f"{path}: expected joints, NAME_x, NAME_y, NAME_z, found none")
    persons = table[:, 1]
    if not np.isfinite(table).all() or not ((persons >= 1) & (persons <= _LAST) & (persons % 1.0 == 0.0)).all():
        raise RecordingError(f"{path}: expected finite numbers and persons from 1, found others")
    return _by_person(path, table, names, root_from_truth)


def _by_person(
    path: Path, table: FloatArray, names: tuple[str, ...], root_from_truth: Callable[[float], FloatArray]
) -> PeopleTruth:
    """The rows (N, 3 + 3 J) as arrays of stamp and person, in the root frame."""
    stamps, frame = np.unique(table[:, 0], return_inverse=True)
    persons, column = np.unique(table[:, 1].astype(np.int64), return_inverse=True)
    if len(np.unique(frame * len(persons) + column)) != len(table):
        raise RecordingError(f"{path}: expected one row for a person and stamp, found several")
    if len(stamps) * len(persons) * len(names) * 24 > MOST_BYTES:
        raise RecordingError(
            f"{path}: expected people who are there together, found {len(persons)} at {len(stamps)} stamps"
        )
    in_view = np.zeros((len(stamps), len(persons)))
    in_view[frame, column] = table[:, 2]
    positions = np.full((len(stamps), len(persons), len(names), 3), np.nan)
    positions[frame, column] = table[:, 3:].reshape(len(table), len(names), 3)
    for index, stamp in enumerate(stamps):
        positions[index] = transform(root_from_truth(float(stamp)), positions[index])
    return PeopleTruth(stamps, persons, in_view, names, positions)
