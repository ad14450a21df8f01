"""The result of a recording: a track for every person, and its files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from voodoo._core import Estimate
from voodoo.errors import VoodooError
from voodoo.export.table import BY_FRAME, Arrays, opened_result, save_result
from voodoo.export.track import Track, arrays_of, tracks_of
from voodoo.measurements import FloatArray
from voodoo.model.body import Body
from voodoo.names import SEARCHING
from voodoo.people import PeopleEstimate

_NOBODY = Track(np.empty(0), (), np.empty(0), (), np.empty((0, 0, 3)), (), np.empty((0, 0, 4, 4)))


@dataclass(frozen=True, eq=False, repr=False)
class PeopleTrack:
    """All persons in F frames.

    Args:
        stamps: (F,) [s] of all frames, with and without persons.
        tracks: person number, from 1 -> track of the frames in which the person was present; all have the same joints.
    """

    stamps: FloatArray
    tracks: Mapping[int, Track]

    def __len__(self) -> int:
        """Number of frames."""
        return len(self.stamps)

    def __repr__(self) -> str:
        """One line with the counts."""
        return f"PeopleTrack({len(self)} frames, {len(self.tracks)} persons)"

    @classmethod
    def of(cls, estimates: Sequence[PeopleEstimate], *, bodies: Mapping[int, Body] | None = None) -> PeopleTrack:
        """Collect the estimates of a recording.

        Args:
            estimates: of all frames.
            bodies: bodies of the persons, with their last sizes; required for the joint angles.
        """
        found: dict[int, list[Estimate]] = {}
        for person in (person for estimate in estimates for person in estimate):
            found.setdefault(person.id, []).append(person.estimate)
        tracks = {one: Track.of(found[one], body=(bodies or {}).get(one)) for one in sorted(found)}
        return cls(np.array([estimate.stamp for estimate in estimates], dtype=np.float64), tracks)

    def unbroken(self, person: int, *, to_the_end: bool = False) -> Track:
        """The track of a person from their first to their last frame (or the recording's); `searching` while absent.

        Raises:
            VoodooError: the person has two rows with one stamp, or one with a stamp of no frame.
        """
        track = self.tracks[person]
        if len(track) == len(self):
            return track
        number_at = dict(zip(self.stamps[::-1].tolist(), range(len(self) - 1, -1, -1), strict=True))
        place = np.array([number_at.get(stamp, -1) for stamp in track.stamps.tolist()])
        if place.min() < 0 or len(np.unique(place)) < len(place):
            raise VoodooError(
                f"person {person}: expected one row for a frame, found stamps of no frame, or twice the same"
            )
        first, end = int(place.min()), len(self) if to_the_end else int(place.max()) + 1
        rows = np.full(end - first, -1)
        rows[place - first] = np.arange(len(track))
        away, wide = rows < 0, track.of_frames(rows)
        for name in BY_FRAME:
            getattr(wide, name)[away] = np.nan
        return replace(
            wide,
            stamps=self.stamps[first:end],
            status=tuple(np.where(away, SEARCHING, wide.status).tolist()),
            limb_status={limb: tuple(np.where(away, "", words).tolist()) for limb, words in wide.limb_status.items()},
        )

    def save(self, path: str | Path) -> None:
        """Write .csv (a row for every person present) or .npz (exact); the file appears when it is complete.

        Raises:
            VoodooError: another suffix.
            OSError: the file cannot be written.
        """
        save_result(path, lambda: iter([self.arrays()]))

    def arrays(self) -> dict[str, npt.NDArray[Any]]:
        """All data as arrays, see docs/reference/files.md; the rows of several persons by time and number."""
        rows = Track.joined(list(self.tracks.values())) if self.tracks else _NOBODY
        persons = np.array([one for one, track in self.tracks.items() for _ in range(len(track))], dtype=np.int64)
        if len(self.tracks) > 1:  # the frames of one are in order, also where time jumps back
            order = np.lexsort((persons, rows.stamps))
            persons, rows = persons[order], rows.of_frames(order)
        return arrays_of(rows, persons, self.stamps)

    @classmethod
    def of_arrays(cls, content: Arrays) -> PeopleTrack:
        """The result in such arrays.

        Raises:
            VoodooError: one is missing, or they do not belong together.
        """
        tracks = tracks_of(content)
        return cls(content["frame_stamps" if "frame_stamps" in content else "stamps"], tracks)

    @classmethod
    def joined(cls, parts: Sequence[PeopleTrack]) -> PeopleTrack:
        """Concatenate consecutive results.

        Raises:
            VoodooError: no results.
        """
        if not parts:
            raise VoodooError("parts: expected at least one, found none")
        persons = sorted({person for part in parts for person in part.tracks})
        tracks = {one: Track.joined([part.tracks[one] for part in parts if one in part.tracks]) for one in persons}
        return cls(np.concatenate([part.stamps for part in parts]), tracks)

    @classmethod
    def load(cls, path: str | Path) -> PeopleTrack:
        """Read the result of one person or several; a .csv does not contain the frames without a row.

        Raises:
            VoodooError: another suffix, damage, or a file of another kind.
        """
        with opened_result(path) as content:
            return cls.of_arrays(content)
