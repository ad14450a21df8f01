"""The result of a recording of several persons: a track for each of them, and its files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from voodoo.export.people_rows import PeopleRows, write_rows
from voodoo.export.result_file import check_suffix
from voodoo.export.track import BY_FRAME, Track, arrays_of, read_persons, save_result
from voodoo.model.body import Body
from voodoo.names import SEARCHING
from voodoo.people import PeopleEstimate

FloatArray: TypeAlias = npt.NDArray[np.float64]


def by_time(tracks: Mapping[int, Track]) -> tuple[npt.NDArray[np.int64], Track]:
    """Number of the person (R,) and estimates of R rows, of persons with the same joints, ordered by time and number."""
    persons = np.concatenate([np.full(len(track), one) for one, track in tracks.items()])
    rows = Track.joined(list(tracks.values()))
    order = np.lexsort((persons, rows.stamps))
    return persons[order], rows.of_frames(order)


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
        known = bodies or {}
        persons = sorted({person.id for estimate in estimates for person in estimate})
        tracks = {
            one: Track.of(
                [person.estimate for estimate in estimates for person in estimate if person.id == one],
                body=known.get(one),
            )
            for one in persons
        }
        return cls(np.array([estimate.stamp for estimate in estimates], dtype=np.float64), tracks)

    def rows(self) -> PeopleRows:
        """A row for every person present in a frame, ordered by time and number."""
        if not self.tracks:
            none = np.empty((0, 0))
            return PeopleRows(np.empty(0), np.empty(0, dtype=np.int64), (), np.empty(0), (), none[..., None], (), none)
        persons, rows = by_time(self.tracks)
        return PeopleRows(
            stamps=rows.stamps,
            persons=persons,
            status=rows.status,
            residual=rows.residual,
            joint_names=rows.joint_names,
            joints=rows.joints,
            angle_names=rows.angle_names,
            angles=rows.angles,
        )

    def unbroken(self, person: int, *, to_the_end: bool = False) -> Track:
        """The track of a person from their first to their last frame (or the recording's); `searching` while absent."""
        track = self.tracks[person]
        place = np.searchsorted(self.stamps, track.stamps)
        first, end = int(place[0]), len(self) if to_the_end else int(place[-1]) + 1

        def spread_words(words: Sequence[str], otherwise: str) -> tuple[str, ...]:
            found = [otherwise] * (end - first)
            for index, word in zip(place - first, words, strict=True):
                found[index] = word
            return tuple(found)

        def spread(values: FloatArray) -> FloatArray:
            wide = np.full((end - first, *values.shape[1:]), np.nan)
            wide[place - first] = values
            return wide

        arrays: dict[str, Any] = {name: spread(getattr(track, name)) for name in BY_FRAME}
        arrays["stamps"] = self.stamps[first:end]
        return replace(
            track,
            status=spread_words(track.status, SEARCHING),
            limb_status={limb: spread_words(words, "") for limb, words in track.limb_status.items()},
            **arrays,
        )

    def save(self, path: str | Path) -> None:
        """Write .csv (a row for every person present) or .npz (by person, exact); the file appears when it is complete.

        The .npz holds `stamps` (F,), `persons` (P,), and `person_<id>/...` with the arrays of a result of one person.

        Raises:
            VoodooError: another suffix.
            OSError: the file cannot be written.
        """
        save_result(path, lambda part: write_rows(part, [self.rows()]), self.arrays)

    def arrays(self) -> dict[str, npt.NDArray[Any]]:
        """All data as arrays, see `save`."""
        own = {one: arrays_of(track) for one, track in self.tracks.items()}
        named = {f"person_{one}/{name}": array for one, arrays in own.items() for name, array in arrays.items()}
        return {"stamps": self.stamps, "persons": np.array(sorted(self.tracks)), **named}

    @classmethod
    def joined(cls, parts: Sequence[PeopleTrack]) -> PeopleTrack:
        """Concatenate consecutive results."""
        persons = sorted({person for part in parts for person in part.tracks})
        tracks = {one: Track.joined([part.tracks[one] for part in parts if one in part.tracks]) for one in persons}
        return cls(np.concatenate([part.stamps for part in parts]), tracks)

    @classmethod
    def load(cls, path: str | Path) -> PeopleTrack:
        """Read a file that save() wrote; a .csv does not contain the frames without persons.

        Raises:
            VoodooError: another suffix, damage, or a file of another kind.
        """
        path = Path(path)
        check_suffix(path)
        return cls(*read_persons(path))
