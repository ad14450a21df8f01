"""Motions for OpenSim: joint angles (.mot) and orientations of bodies as OpenSense reads them (.sto).

A frame without a pose has no row. Times are those of `voodoo.export.markers`, from the track's first frame.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from voodoo.export.conventions import Y_UP_RIGHT, coordinates, names_of, plain
from voodoo.export.skeleton import FloatArray, mean_interval, skeleton
from voodoo.export.track import Track
from voodoo.model.body import Body
from voodoo.model.rotations import quaternions
from voodoo.whole import write_whole


def write_mot(path: str | Path, track: Track, body: Body) -> None:
    """Write the angles of all joints in degrees, and the place of the root bone in meters, as coordinates over time.

    Names, axes and signs are those of `voodoo.export.conventions`; zero is standing at rest, looking along X; Y is up.

    Args:
        path: .mot file.
        track: with limb poses, in a frame whose z points up.
        body: with the sizes it was tracked with.

    Raises:
        VoodooError: the track has no limb poses or is of another body.
        OSError: the file cannot be written.
    """
    posed = skeleton(track, body).of_frames(track.found)
    names, angles = coordinates(posed)
    root = names_of(posed.bones[0].name).opensim
    places = posed.heads[:, 0] @ Y_UP_RIGHT.T
    rows = (
        "\t".join(f"{value:.6f}" for value in (*np.degrees(turns), *place))
        for turns, place in zip(angles, places, strict=True)
    )
    columns = [*names, *(f"{root}_t{axis}" for axis in "xyz")]
    size = f"nRows={len(angles)}", f"nColumns={1 + len(columns)}"
    header = [plain(Path(path).name), "version=1", *size, "inDegrees=yes"]
    _write(Path(path), header, columns, posed.stamps - track.stamps[0], rows)


def write_sto(path: str | Path, track: Track, body: Body) -> None:
    """Write the orientation of each bone in a frame X forward, Y up, Z to the right as unit quaternions w,x,y,z.

    Columns are named `<body>_imu` as OpenSense expects sensors on the bodies of its model; at rest all are the identity.

    Args:
        path: .sto file.
        track: with limb poses, in a frame whose z points up.
        body: with the sizes it was tracked with.

    Raises:
        VoodooError: the track has no limb poses or is of another body, or its stamps do not increase.
        OSError: the file cannot be written.
    """
    posed = skeleton(track, body).of_frames(track.found)
    turns = quaternions(Y_UP_RIGHT @ posed.rotations @ Y_UP_RIGHT.T)[..., [3, 0, 1, 2]]
    rows = ("\t".join(",".join(f"{value:.9f}" for value in one) for one in frame) for frame in turns)
    columns = [f"{names_of(bone.name).opensim}_imu" for bone in posed.bones]
    rate = 1.0 / mean_interval(track.stamps)
    header = [f"DataRate={rate:.6f}", "DataType=Quaternion", "version=3", "OpenSimVersion=4.5"]
    _write(Path(path), header, columns, posed.stamps - track.stamps[0], rows)


def _write(path: Path, header: Sequence[str], columns: Sequence[str], times: FloatArray, rows: Iterable[str]) -> None:
    lines = [*header, "endheader", "\t".join(["time", *columns])]
    lines += [f"{time:.6f}\t{row}" for time, row in zip(times, rows, strict=True)]
    write_whole(path, "\n".join(lines) + "\n")
