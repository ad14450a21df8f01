"""Writes a result of several persons in any format, selected by the suffix."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from voodoo.export.files import ONE_PERSON, check_target, is_table, on_stdout, save, write_persons
from voodoo.export.people import PeopleTrack
from voodoo.export.ros2 import person_id
from voodoo.export.upright import Turn
from voodoo.model.body import Body


def save_people(
    result: PeopleTrack, path: Path, *, bodies: Mapping[int, Body], root_frame: str, turn: Turn | None = None
) -> list[Path]:
    """Write a result of several persons; returns the written files.

    .csv, .npz, .glb and bags hold all persons. Other formats hold one person: NAME.bvh becomes NAME_1.bvh, NAME_2.bvh, ..., from
    the first to the last frame of each; without persons there is no file.

    Args:
        result: with limb poses.
        path: see `voodoo.export.files.FORMATS`.
        bodies: of all persons, in the sizes they were tracked with.
        root_frame: frame of the tracks.
        turn: see `voodoo.export.files.save`.

    Raises:
        VoodooError: another suffix, or what the format needs is missing.
        OSError: a file cannot be written.
    """
    check_target(path)
    if path.suffix in ONE_PERSON:
        written = []
        for one in result.tracks:
            own = path.with_name(f"{path.stem}_{one}{path.suffix}")
            save(result.unbroken(one), own, body=bodies[one], root_frame=root_frame, turn=turn)
            written.append(own)
        return written
    if is_table(path):
        with on_stdout(path) as file:
            result.save(file)
        return [path]
    people = {
        person_id(one): (f"{path.stem}_{one}", result.unbroken(one, to_the_end=True), bodies[one])
        for one in result.tracks
    }
    write_persons(path, people, root_frame=root_frame, turn=turn)
    return [path]
