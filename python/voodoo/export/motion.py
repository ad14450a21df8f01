"""Formats of other programs that hold the motion of one person.

BVH, of animation programs, is a hierarchy with offsets, then Euler angles frame by frame. TRC, of OpenSim, and C3D, of motion
capture laboratories, are named positions over time. For OpenSim there are also joint angles (.mot) and orientations of bodies as
OpenSense reads them (.sto): a frame without a pose has no row there, and times are those from the track's first frame.
"""

from __future__ import annotations

import struct
import warnings
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from voodoo.errors import VoodooError
from voodoo.export.conventions import Y_UP_LEFT, Y_UP_RIGHT, coordinates, names_of, plain
from voodoo.export.skeleton import held, mean_interval, placed_on_parents, skeleton
from voodoo.export.table import cells
from voodoo.export.track import Track
from voodoo.measurements import FloatArray
from voodoo.model.body import Body
from voodoo.model.rotations import euler_angles, quaternions
from voodoo.recordings.marker_trajectories import Z_UP_FROM_Y_UP
from voodoo.whole import appearing_whole, write_whole

_CENTIMETERS, _MILLIMETERS = 100.0, 1000.0
"""Units of animation programs and of C3D, per meter."""


def write_bvh(path: str | Path, track: Track, body: Body) -> None:
    """Write a track as BVH, in centimeters.

    At rest, axes are X left, Y up, Z forward; with zero rotations the body stands at rest. Rotations are in the order Z, X, Y
    in degrees. Joints have the positions of the track: a joint whose position on its parent changes by more than 0.1 mm
    (lengths are refined while tracking) has position channels, which replace its OFFSET, the median. End sites are those of
    `body`. The format has a constant frame time, the median of the track, and no gaps: a searching frame repeats the previous
    pose, frames before the first pose have the first one, and a track without a pose has the body at rest.

    Args:
        path: .bvh file.
        track: with limb poses, in a frame whose z points up.
        body: with the sizes it was tracked with (`Tracker.body`).

    Raises:
        VoodooError: the track has no limb poses, is of another body, or its stamps do not increase.
        OSError: the file cannot be written.
    """
    posed = held(skeleton(track, body), track.found)
    parts = posed.bones
    lines = ["HIERARCHY"]
    order: list[int] = []
    offsets, still, moving = placed_on_parents(posed, track.found)
    still[0] = 0.0

    def describe(index: int, indent: str) -> None:
        """Append the joint of a bone and, depth first, those of its children; `order` is that of the channels."""
        order.append(index)
        turns = "Zrotation Xrotation Yrotation"
        channels = f"6 Xposition Yposition Zposition {turns}" if moving[index] else f"3 {turns}"
        lines.append(f"{indent}{'JOINT' if index else 'ROOT'} {plain(parts[index].name)}")
        lines.append(f"{indent}{{")
        lines.append(f"{indent}\tOFFSET {_numbers(still[index])}")
        lines.append(f"{indent}\tCHANNELS {channels}")
        children = [child for child, other in enumerate(parts) if other.parent == index]
        for child in children:
            describe(child, indent + "\t")
        if not children:
            tip = _numbers(parts[index].tip - parts[index].head)
            lines.extend(f"{indent}\t{line}" for line in ("End Site", "{", f"\tOFFSET {tip}", "}"))
        lines.append(f"{indent}}}")

    describe(0, "")
    lines += ["MOTION", f"Frames: {len(track)}", f"Frame Time: {mean_interval(track.stamps):.9f}"]
    local = Y_UP_LEFT @ posed.local() @ Y_UP_LEFT.T
    angles = np.empty((len(track), len(parts), 3))
    for index in range(len(parts)):
        angles[:, index] = np.degrees(euler_angles(local[:, index], "ZXY"))
    places = offsets @ Y_UP_LEFT.T * _CENTIMETERS
    for shifts, turns in zip(places, angles, strict=True):
        row = [value for bone in order for value in (*(shifts[bone] if moving[bone] else ()), *turns[bone])]
        lines.append(" ".join(f"{value:.6f}" for value in row))
    write_whole(Path(path), "\n".join(lines) + "\n")


def _numbers(vector: FloatArray) -> str:
    return " ".join(f"{value:.6f}" for value in Y_UP_LEFT @ vector * _CENTIMETERS)


def write_trc(path: str | Path, track: Track, *, names: Sequence[str] | None = None) -> None:
    """Write the joints and sites of a track as markers, in meters and OpenSim's axes: (X, Y, Z) = (y, z, x).

    Searching frames have empty cells.

    Args:
        path: .trc file.
        track: the track.
        names: joints and sites to write; None means all.

    Raises:
        VoodooError: a name that is not in the track, none at all, or stamps that do not increase.
        OSError: the file cannot be written.
    """
    chosen = list(track.joint_names if names is None else names)
    unknown = [name for name in chosen if name not in track.joint_names]
    if unknown or not chosen:
        raise VoodooError(
            f"names: expected some of {', '.join(track.joint_names)}, found {', '.join(unknown) or 'none'}"
        )
    path = Path(path)
    rate = round(1.0 / mean_interval(track.stamps), 6)
    positions = track.joints[:, [track.joint_names.index(name) for name in chosen]] @ Z_UP_FROM_Y_UP
    numbers = range(1, len(chosen) + 1)
    lines = [
        f"PathFileType\t4\t(X/Y/Z)\t{path.name}",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames",
        f"{rate:g}\t{rate:g}\t{len(track)}\t{len(chosen)}\tm\t{rate:g}\t1\t{len(track)}",
        "Frame#\tTime\t" + "\t\t\t".join(chosen) + "\t\t",
        "\t\t" + "\t".join(f"X{i}\tY{i}\tZ{i}" for i in numbers),
        "",
    ]
    # OpenSim starts its clock near zero; Unix times would lose their fraction in it.
    for index, (stamp, row) in enumerate(zip(track.stamps - track.stamps[0], positions, strict=True), start=1):
        lines.append(f"{index}\t{stamp:.6f}\t" + "\t".join(cells(np.ravel(row))))
    write_whole(path, "\n".join(lines) + "\n")


_RESIDUAL = 3
"""Column of the library's points that tells a point that was not observed (-1); columns 0 to 2 are the position."""


def write_c3d(path: str | Path, track: Track) -> None:
    """Write the joints and sites of a track as points in millimeters, z up; in searching frames they are not observed.

    The format has a constant rate, that of the median time between two frames.

    Args:
        path: .c3d file.
        track: with at least one frame, in a frame whose z points up.

    Raises:
        VoodooError: stamps that do not increase, or more joints and sites than the format can hold.
        OSError: the file cannot be written.
    """
    import c3d

    writer = c3d.Writer(point_rate=1.0 / mean_interval(track.stamps), point_units="mm")
    writer.set_point_labels([plain(name) for name in track.joint_names])
    writer.set_screen_axis(X="+X", Y="+Z")
    points = np.zeros((len(track), len(track.joint_names), 5), dtype=np.float32)
    points[..., :_RESIDUAL] = np.nan_to_num(track.joints * _MILLIMETERS)
    points[~track.found, :, _RESIDUAL] = -1.0
    nothing = np.empty((0, 0), dtype=np.float32)
    for frame in points:
        writer.add_frames((frame, nothing))
    with appearing_whole(Path(path)) as place, place.open("wb") as file, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of the library, where there are no forces
        try:
            writer.write(file)
        except struct.error as error:
            count = len(track.joint_names)
            raise VoodooError(
                f"{path}: expected joints and sites as a .c3d can hold, found {count}: {error}"
            ) from error


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
