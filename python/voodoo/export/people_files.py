"""Writes a result of several persons in any format, selected by the suffix."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from voodoo.export.files import ONE_PERSON, bag_folder, check_target, is_bag, is_foxglove, on_stdout
from voodoo.export.foxglove import write_foxglove
from voodoo.export.glb import write_glb
from voodoo.export.people import PeopleTrack
from voodoo.export.ros2 import person_id, write_people_bag
from voodoo.export.upright import Turn, upright
from voodoo.model.body import Body
from voodoo.whole import appearing_whole


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
            track, _ = upright(result.unbroken(one), root_frame, turn)
            ONE_PERSON[path.suffix](own, track, bodies[one])
            written.append(own)
        return written
    if is_bag(path) or is_foxglove(path):
        people = {person_id(one): (result.unbroken(one, to_the_end=True), bodies[one]) for one in result.tracks}
        if is_foxglove(path):
            write_foxglove(path, people, root_frame=root_frame, turn=turn)
        else:
            with appearing_whole(path) as place, bag_folder(place) as folder:
                write_people_bag(folder, people, root_frame=root_frame, turn=turn)
    elif path.suffix == ".glb":
        shown = {one: upright(result.unbroken(one, to_the_end=True), root_frame, turn)[0] for one in result.tracks}
        write_glb(path, {f"{path.stem}_{one}": (track, bodies[one]) for one, track in shown.items()})
    else:
        with on_stdout(path) as file:
            result.save(file)
    return [path]
