"""Keeps poses on disk while they are tracked, and converts them to files of any format at the end, or after a crash."""

from __future__ import annotations

import json
import os
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, suppress
from functools import partial
from itertools import chain, count
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from voodoo._core import Estimate
from voodoo.errors import NoPoseError, VoodooError, a_path, reading, reason
from voodoo.export.cut_off import complete
from voodoo.export.files import FORMATS, STDOUT, is_table, on_stdout, save, written
from voodoo.export.people import PeopleTrack
from voodoo.export.table import BODIES, BODY_OF, Arrays, save_result
from voodoo.export.track import Track, arrays_of, left_out_arrays, rows_of
from voodoo.export.upright import SUFFIX as ROOT_SUFFIX
from voodoo.export.upright import UNTURNED, Turn, by_axes, by_feet, turned
from voodoo.model.body import Body
from voodoo.names import SEARCHING
from voodoo.people import ONE, PeopleEstimate, everybody
from voodoo.stored import MOST_METADATA, read_stored_text
from voodoo.unpacking import stored_arrays
from voodoo.whole import KEPT, SUFFIX, Hidden, locked, move_whole, naming, removed, write_whole

_BODIES_S = 10.0
"""Time between two copies of the bodies, which take long to write [s]."""
_SAMPLED = 3
"""Number of parts in a sample."""
_PART = "poses that were tracked"


class Spool(AbstractContextManager["Spool"]):
    """Poses of one person or several in a hidden folder next to the first output; use it in a `with` block.

    An error of this package in the block removes them; after another one, or a crash, `recover` makes the outputs.

    Args:
        paths: outputs, see `voodoo.export.files.check_target`.
        root_frame: returns the frame of the poses, when there are some.
        optical: whether that is a camera's optical frame; None: by its name.
        upright: turn every output upright.
        together: number of frames that are kept in memory.

    Attributes:
        frames: number of frames.
        states: number of poses of each status.
        bodies: person number -> last body.
        paths: see above.
    """

    def __init__(
        self,
        paths: Sequence[Path],
        *,
        root_frame: Callable[[], str],
        optical: bool | None = None,
        upright: bool = False,
        together: int,
    ) -> None:
        """Make the folder."""
        self.paths, self._root = list(paths), root_frame
        self._optical, self._upright = optical, upright
        self._turn: Turn | None = None
        self._kept_for = [path for path in paths if path != STDOUT]
        self._hidden = Hidden(self._kept_for[0] if self._kept_for else Path(tempfile.gettempdir()) / "stdout.csv")
        self._together = together
        self._numbered = False
        self._waiting: list[PeopleEstimate | Track] = []
        self.bodies: dict[int, Body] = {}
        self._bodies_at = -_BODIES_S
        self._parts: list[Path] = []
        self.frames = 0
        self.states: Counter[str] = Counter()

    def add(self, estimate: Estimate | PeopleEstimate | Track, bodies: Mapping[int, Body]) -> None:
        """Take the poses of a frame, and the bodies in it; an estimate or a track is of person ONE.

        Raises:
            OSError: they cannot be put on the disk; they are in memory then.
        """
        self._numbered = isinstance(estimate, PeopleEstimate)
        estimate = estimate if isinstance(estimate, Track) else everybody(estimate)
        self._waiting.append(estimate)
        self.bodies.update(bodies)
        self.frames += 1
        self.states.update(estimate.status if isinstance(estimate, Track) else (str(one.status) for one in estimate))
        if len(self._waiting) >= self._together:
            self._put_away()

    @property
    def found(self) -> bool:
        """Whether a frame has a pose."""
        return bool(self.states.keys() - {SEARCHING})

    def _put_away(self) -> None:
        arrays = dict(self._last())
        needed = not all(map(is_table, self.paths))
        if needed and time.monotonic() - self._bodies_at >= _BODIES_S:
            arrays[BODIES] = np.array([body.to_toml() for body in self.bodies.values()], dtype=np.str_)
            arrays[BODY_OF] = np.array(list(self.bodies), dtype=np.int64)
        path = self._hidden.folder / f"{len(self._parts):08d}.npz"
        place = path.with_suffix(".part")
        with naming(path):
            with place.open("wb") as file:
                np.savez(file, allow_pickle=False, **arrays)
            move_whole(place, path)
        if not self._parts and self._kept_for:
            self._keep(self._kept_for)
        self._bodies_at = time.monotonic() if BODIES in arrays else self._bodies_at
        self._parts.append(path)
        self._waiting.clear()

    def _keep(self, paths: Iterable[Path]) -> None:
        names = [path.name for path in paths]
        turn = None if self._turn is None else {"pose": self._turn.pose.tolist(), "words": self._turn.words}
        how: Any = {"optical": self._optical, "upright": self._upright, "turn": turn, "numbered": self._numbered}
        self._hidden.keep(paths=names, root_frame=self._root(), **how)

    def _last(self) -> dict[str, npt.NDArray[Any]]:
        """What is in memory."""
        tracks = [one for one in self._waiting if isinstance(one, Track)]
        if tracks:
            return arrays_of(Track.joined(tracks))
        estimates = [one for one in self._waiting if isinstance(one, PeopleEstimate)]
        return PeopleTrack.of(estimates, bodies=self.bodies).arrays()

    def _contents(self) -> Callable[[], Iterator[Arrays]]:
        last = [self._last()] if self._waiting else []
        return lambda: chain(_stored(self._parts), last)

    def sample(self) -> list[Track]:
        """Some of the frames of every person: all of them if there are few.

        Raises:
            VoodooError: no frames.
        """
        return _sample(self._contents()(), len(self._parts) + 1)

    def write(
        self, *, turn: Turn | None = None, left_out: Mapping[str, int] | None = None
    ) -> tuple[list[Path], list[Exception]]:
        """Write the outputs, whatever becomes of each; returns the files, and what failed.

        The folder is removed when all of them are complete. It is kept for those that failed, and for NAME.npz instead of those
        whose format cannot hold the poses.

        Args:
            turn: how outputs are turned upright; None: by the axes of the root frame if that is an optical frame.
            left_out: unusable measurements: reason -> number.

        Raises:
            VoodooError: there were no frames.
        """
        if not self.frames:
            self._hidden.remove()
            raise NoPoseError("expected at least one frame to write, found none")
        contents = self._contents()
        self._turn = turn
        turn = by_axes(self._root(), optical=self._optical) if turn is None else turn
        how: Any = {"bodies": self.bodies, "root_frame": self._root(), "turn": turn, "upright": self._upright}
        how |= {"numbered": self._numbered, "left_out": left_out or {}}
        done, errors = written(self.paths, lambda path: _write(path, contents, **how))
        failed = list(errors.values())
        failing = [_later(path, errors[path]) for path in self._kept_for if path in errors]
        if not failing:
            self._hidden.remove()
            return done, failed
        kept = self._kept
        try:
            if self._waiting:
                self._put_away()
            self._keep(failing)
        except OSError:
            kept += f", without the last {len(self._waiting)}" if self._waiting else ""
        if not self._parts:
            self._hidden.remove()
            return done, failed
        self._hidden.close()
        return done, [*failed, VoodooError(kept)]

    def __exit__(self, _: object, error: BaseException | None, __: object) -> None:
        """Remove the folder after an error of this package; keep it after another one.

        Raises:
            VoodooError: an error of the system; names the folder.
        """
        if error is None:
            return
        if isinstance(error, VoodooError) or not (self._parts and self._kept_for):
            self._hidden.remove()
            return
        with suppress(OSError):
            if self._waiting:
                self._put_away()
        self._hidden.close()
        if isinstance(error, OSError):
            raise VoodooError(f"{reason(error)}; {self._kept}") from error

    @property
    def _kept(self) -> str:
        return f"the poses are kept in {self._hidden.folder}; voodoo recover makes the files"


def _later(path: Path, error: Exception) -> Path:
    """What `recover` makes of poses for an output that failed: of those that its format cannot hold, arrays."""
    return path if isinstance(error, OSError) or is_table(path) else path.with_name(f"{path.name}.npz")


def _stored(paths: Sequence[Path]) -> Iterator[Arrays]:
    for path in paths:
        with stored_arrays(path, _PART) as content:
            yield content


def _write(
    path: Path,
    contents: Callable[[], Iterator[Arrays]],
    *,
    numbered: bool,
    bodies: Mapping[int, Body],
    root_frame: str,
    turn: Turn,
    upright: bool,
    left_out: Mapping[str, int],
) -> list[Path]:
    """Write one output. A part is in memory at a time, in formats other than .csv and .npz all."""
    if upright and turn.words:
        contents = partial(_turned, contents, turn)
        root_frame, turn = f"{root_frame}{ROOT_SUFFIX}", UNTURNED
    if is_table(path):
        with on_stdout(path) as file:
            save_result(file, contents, left_out_arrays(left_out))
        return [path]
    result = PeopleTrack.joined(list(map(PeopleTrack.of_arrays, contents())))
    return save(result if numbered else result.tracks[ONE], path, body=bodies, root_frame=root_frame, turn=turn)


def _turned(contents: Callable[[], Iterator[Arrays]], turn: Turn) -> Iterator[Arrays]:
    """The parts in the upright frame."""
    for part in contents():
        yield arrays_of(turned(rows_of(part), turn), part["person"], part["frame_stamps"])


def _sample(contents: Iterator[Arrays], count: int) -> list[Track]:
    """Tracks of some of the parts, of `count`."""
    every = -(-count // _SAMPLED)
    parts = (part for number, part in enumerate(contents) if number % every == 0)  # converted while its file is open
    return list(PeopleTrack.joined(list(map(PeopleTrack.of_arrays, parts))).tracks.values())


def recover(folder: str | Path, *, taken: Iterable[Path] = ()) -> tuple[list[Path], list[Exception]]:
    """Make the outputs of sessions that were killed, from what they left in a folder; returns the files, and what failed.

    They are written into that folder, under another name if there is one in the place: NAME.recovered.csv. What cannot be
    recovered stays.

    Args:
        folder: of the outputs.
        taken: names that are not used, because they will be written.
    """
    done: list[Path] = []
    failed: list[Exception] = []
    others = {path.resolve() for path in taken}
    for hidden in sorted(a_path(folder, error=VoodooError).glob(f".*{SUFFIX}")):
        try:
            if not hidden.exists():  # one without poses, which the writing of others has removed
                continue
            if hidden.stat().st_uid != getattr(os, "geteuid", lambda: 0)() or not (hidden / KEPT).is_file():
                continue
            if (lock := locked(hidden)) is None:
                continue
            whole = False
            try:
                whole = _recover_one(hidden, others, done, failed)
            finally:
                if whole:
                    removed(hidden, lock)
                else:
                    os.close(lock)
        except (VoodooError, OSError) as error:
            failed.append(error)
        except Exception as error:  # damage, or a note of another version
            failed.append(VoodooError(f"{hidden}: expected what a session left, found {reason(error)}"))
    return done, failed


def _recover_one(hidden: Path, taken: set[Path], done: list[Path], failed: list[Exception]) -> bool:
    """Make the outputs of a session; returns whether nothing of it is left to be made."""
    with reading(hidden / KEPT, "what a session left", error=VoodooError):
        note = json.loads(read_stored_text(hidden / KEPT, "what a session left", most=MOST_METADATA))
        free = {Path(str(name)).name: _free(hidden.parent / Path(str(name)).name, taken) for name in note["paths"]}
    if "root_frame" not in note:  # a recording, or a folder that was being replaced
        for name, path in free.items():
            left = hidden / name
            if path.suffix == ".mcap" and left.is_dir():
                for bag in left.glob("*.mcap"):
                    complete(bag, path)
            elif left.exists():
                move_whole(left, path)
            done += [path] if path.exists() else []
        return True
    bodies: dict[int, Body] = {}
    parts: list[Path] = []
    for path in sorted(hidden.glob("*.npz")):
        try:
            with stored_arrays(path, _PART) as part:
                content = dict(part)
                texts = content.get(BODIES, np.empty(0)).tolist()
                bodies.update(zip(content[BODY_OF].tolist() if texts else [], map(Body.from_toml, texts), strict=True))
            parts.append(path)
        except VoodooError as error:
            failed.append(error)  # the others can be used
    if not parts:
        raise VoodooError(f"{hidden}: expected {_PART}, found none that can be read")
    root, optical, upright = str(note["root_frame"]), note.get("optical"), bool(note.get("upright"))
    if note.get("turn") is not None:
        turn = Turn(np.array(note["turn"]["pose"]), str(note["turn"]["words"]))
    elif upright:  # the floor is not known here
        turn = by_feet(_sample(_stored(parts), len(parts)), root, optical=optical)
    else:
        turn = by_axes(root, optical=optical)
    how: Any = {"numbered": bool(note.get("numbered")), "root_frame": root, "turn": turn, "upright": upright}
    how |= {"bodies": bodies, "left_out": {}}
    some, errors = written(free.values(), lambda path: _write(path, lambda: _stored(parts), **how))
    done += some
    failed += errors.values()
    if errors:
        note["paths"] = [
            _later(hidden.parent / name, errors[path]).name for name, path in free.items() if path in errors
        ]
        write_whole(hidden / KEPT, json.dumps(note))
    return not errors


def _free(path: Path, taken: set[Path]) -> Path:
    """A name that is not in use."""
    start, end = (f"{path.stem}.recovered", path.suffix) if path.suffix in FORMATS else (f"{path.name}-recovered", "")
    others = (path.with_name(f"{start}{again}{end}") for again in chain([""], (f"-{number}" for number in count(2))))
    return next(one for one in chain([path], others) if not (one.exists() or one.resolve() in taken))
