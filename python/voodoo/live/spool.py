"""Collects results on disk instead of in memory, and converts them to files of any format at the end."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from voodoo.errors import VoodooError, reason
from voodoo.export.files import check_target, save, written
from voodoo.export.people import PeopleTrack
from voodoo.export.people_files import save_people
from voodoo.export.track import Track
from voodoo.live.follow import ONE, Step
from voodoo.live.session import Output
from voodoo.model.body import Body

_TOGETHER = 30


class Files(Output):
    """Writes poses to files when the session ends; until then they are in a temporary folder next to the first file.

    Args:
        paths: see `voodoo.export.files.FORMATS`.
        root_frame: returns the frame of the poses, at the end.
        several: whether several persons are tracked.

    Attributes:
        written: files that exist after `close`.
        frames: number of received frames.

    Raises:
        VoodooError: a path that cannot be written to.
    """

    name = "files"
    waiting = 256

    def __init__(self, paths: Sequence[Path], *, root_frame: Callable[[], str], several: bool = False) -> None:
        """Check the paths, and make the folder."""
        for path in paths:
            check_target(path)
        self._paths, self._root, self._several = list(paths), root_frame, several
        paths[0].parent.mkdir(parents=True, exist_ok=True)
        self._folder = Path(tempfile.mkdtemp(dir=paths[0].parent, prefix=f".{paths[0].name}-"))
        self._steps: list[Step] = []
        self._parts = 0
        self._bodies: dict[int, Body] = {}
        self.written: list[Path] = []
        self.frames = 0

    def publish(self, step: Step) -> None:
        """See Output."""
        self._steps.append(step)
        self._bodies.update(step.bodies)
        self.frames += 1
        if len(self._steps) >= _TOGETHER:
            self._put_away()

    def _put_away(self) -> None:
        self._part().save(self._folder / f"{self._parts:08d}.npz")
        self._parts += 1
        self._steps.clear()

    def _part(self) -> Track | PeopleTrack:
        """The steps that are in memory."""
        if self._several:
            return PeopleTrack.of([step.people for step in self._steps], bodies=self._bodies)
        return Track.of([step.estimates[ONE] for step in self._steps], body=self._bodies[ONE])

    def close(self) -> None:
        """Write the files. The temporary folder goes only when all of them are written.

        Raises:
            VoodooError: there were no frames, or a file cannot be written; names the folder that is kept then.
        """
        kind = PeopleTrack if self._several else Track
        parts = [kind.load(part) for part in sorted(self._folder.glob("*.npz"))]
        parts += [self._part()] if self._steps else []
        if not parts:
            shutil.rmtree(self._folder, ignore_errors=True)
            raise VoodooError("expected at least one frame to write, found none")
        if self._several:
            everybody = _joined_people([part for part in parts if isinstance(part, PeopleTrack)])

            def write(path: Path) -> list[Path]:
                return save_people(everybody, path, bodies=self._bodies, root_frame=self._root())
        else:
            track = Track.joined([part for part in parts if isinstance(part, Track)])

            def write(path: Path) -> list[Path]:
                save(track, path, body=self._bodies[ONE], root_frame=self._root())
                return [path]

        self.written, failed = written(self._paths, write)
        if failed:
            kept = f"the poses are kept in {self._folder}"
            try:
                if self._steps:
                    self._put_away()
            except OSError:
                kept += f", without the last {len(self._steps)}"
            raise VoodooError(f"{'; '.join(map(reason, failed))}; {kept}") from failed[0]
        shutil.rmtree(self._folder, ignore_errors=True)


def _joined_people(parts: Sequence[PeopleTrack]) -> PeopleTrack:
    persons = sorted({person for part in parts for person in part.tracks})
    tracks = {one: Track.joined([part.tracks[one] for part in parts if one in part.tracks]) for one in persons}
    return PeopleTrack(np.concatenate([part.stamps for part in parts]), tracks)
