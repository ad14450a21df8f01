"""Writes a result in any format, selected by the suffix."""

from __future__ import annotations

import shutil
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from voodoo.errors import VoodooError, reason
from voodoo.export.foxglove import SUFFIX as FOXGLOVE
from voodoo.export.foxglove import write_foxglove
from voodoo.export.glb import write_glb
from voodoo.export.motion import write_bvh, write_c3d, write_mot, write_sto, write_trc
from voodoo.export.people import PeopleTrack
from voodoo.export.ros2 import person_id, write_people_bag
from voodoo.export.table import SUFFIXES
from voodoo.export.track import Track
from voodoo.export.upright import Turn, upright
from voodoo.model.body import Body
from voodoo.whole import check_place

ONE_PERSON: Mapping[str, Callable[[Path, Track, Body], None]] = {
    ".bvh": write_bvh,
    ".trc": lambda path, track, _: write_trc(path, track),
    ".c3d": lambda path, track, _: write_c3d(path, track),
    ".mot": write_mot,
    ".sto": write_sto,
}
"""Writers of formats that hold one person with z up, by suffix."""
FORMATS = (*SUFFIXES, *ONE_PERSON, ".glb", ".mcap")
"""Suffixes; a path without one is a ROS 2 bag folder, and one in .foxglove.mcap has Foxglove's schemas."""
STDOUT = Path("-")
"""The target that is CSV on standard output."""


def check_target(path: Path) -> None:
    """Reject a path that cannot be written to, before the work starts.

    Args:
        path: see FORMATS.

    Raises:
        VoodooError: another suffix, a bag folder that exists, or a place where nothing can be written.
    """
    if path == STDOUT:
        return
    if path.suffix not in FORMATS and not is_folder(path):
        raise VoodooError(
            f"{path}: expected a name that ends in {', '.join(FORMATS)}, or a new folder for a ROS 2 bag, found "
            f"{path.suffix!r}"
        )
    if is_folder(path) and path.exists():
        raise VoodooError(f"{path}: expected a new folder for a ROS 2 bag, found one that exists")
    if path.is_dir():
        raise VoodooError(f"{path}: expected a file, found a folder")
    check_place(path)


def is_folder(path: Path) -> bool:
    """Whether a name is that of a bag folder: the part after its last dot, if any, is not a file suffix (run.2026-05-01)."""
    return path.suffix not in FORMATS and not path.suffix[1:].isalpha()


def is_table(path: Path) -> bool:
    """Whether a name is that of arrays or rows in the root frame: .csv, .npz, or STDOUT."""
    return path == STDOUT or path.suffix in SUFFIXES


def upright_words(paths: Sequence[Path], turn: Turn, *, every: bool = False) -> str:
    """Which of the files, or `every` one, is turned upright, in one line; "" if none."""
    if every and not turn.words:
        return "--upright turned nothing: z = 0 of the root frame is the floor already"
    turned = [str(path) for path in paths if every or not is_table(path)]
    return f"{', '.join(turned)}: turned upright {turn.words}" if turned and turn.words else ""


def written(paths: Iterable[Path], write: Callable[[Path], list[Path]]) -> tuple[list[Path], dict[Path, Exception]]:
    """Write each of several outputs, whatever becomes of the others; returns the files, and output -> why it failed.

    Args:
        paths: of the outputs.
        write: writes one of them and returns its files.
    """
    done: list[Path] = []
    failed: dict[Path, Exception] = {}
    for path in paths:
        try:
            done += write(path)
        except Exception as error:
            known = isinstance(error, VoodooError | OSError)
            failed[path] = error if known else VoodooError(f"{path}: {reason(error)}")
    return done, failed


@contextmanager
def on_stdout(path: Path) -> Iterator[Path]:
    """The file to write: `path`, or for STDOUT a temporary .csv, which is printed at the end."""
    if path != STDOUT:
        yield path
        return
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "stdout.csv"
        yield file
        with file.open(encoding="utf-8", newline="") as text:
            shutil.copyfileobj(text, sys.stdout)


def save(
    result: Track | PeopleTrack,
    path: Path,
    *,
    body: Body | Mapping[int, Body],
    root_frame: str,
    turn: Turn | None = None,
) -> list[Path]:
    """Write a result in the format of the suffix, or a ROS 2 bag folder; returns the written files.

    .csv, .npz, .glb and bags hold all persons. Other formats hold one: of a PeopleTrack NAME.bvh becomes NAME_1.bvh, NAME_2.bvh,
    ..., from the first to the last frame of each; without persons there is no file.

    Args:
        result: with limb poses; a Track is person 1.
        path: see FORMATS.
        body: in the sizes it was tracked with; of several persons, number -> body.
        root_frame: frame of the result.
        turn: how all but .csv and .npz are turned upright; None: a camera's optical frame, by its name, by its axes.

    Raises:
        VoodooError: another suffix, or data that the format requires are missing.
        OSError: a file cannot be written.
    """
    check_target(path)
    numbered, bodies = isinstance(result, PeopleTrack), body if isinstance(body, Mapping) else {1: body}
    people = result if isinstance(result, PeopleTrack) else PeopleTrack(result.stamps, {1: result})
    if is_table(path):
        with on_stdout(path) as file:
            people.save(file)
        return [path]
    names = {one: f"{path.stem}_{one}" if numbered else path.stem for one in people.tracks}
    if path.suffix in ONE_PERSON:
        files = {one: path.with_name(f"{name}{path.suffix}") for one, name in names.items()}
        for one, file in files.items():
            check_target(file)
            ONE_PERSON[path.suffix](file, upright(people.unbroken(one), root_frame, turn)[0], bodies[one])
        return list(files.values())
    tracks = {one: (people.unbroken(one, to_the_end=True), bodies[one]) for one in names}
    if path.suffix == ".glb":
        write_glb(
            path, {names[one]: (upright(track, root_frame, turn)[0], own) for one, (track, own) in tracks.items()}
        )
        return [path]
    own = {person_id(one): track for one, track in tracks.items()}
    write = write_foxglove if path.name.endswith(FOXGLOVE) else write_people_bag
    write(path, own, root_frame=root_frame, turn=turn)
    return [path]
