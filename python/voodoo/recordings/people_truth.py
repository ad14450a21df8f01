"""Exact positions of all persons of a recording, and their visible fractions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from voodoo.errors import RecordingError
from voodoo.measurements import FloatArray


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
