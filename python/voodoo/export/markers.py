"""TRC, the marker format of OpenSim, and C3D, the format of motion capture laboratories: named positions over time."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from voodoo.errors import VoodooError
from voodoo.export.conventions import plain
from voodoo.export.skeleton import mean_interval
from voodoo.export.table import cells
from voodoo.export.track import Track
from voodoo.recordings.marker_trajectories import Z_UP_FROM_Y_UP
from voodoo.whole import appearing_whole, write_whole


def write_trc(path: str | Path, track: Track, *, names: Sequence[str] | None = None, y_up: bool = True) -> None:
    """Write the joints and sites of a track as markers, in meters; searching frames have empty cells.

    Args:
        path: .trc file.
        track: the track.
        names: joints and sites to write; None means all.
        y_up: rotate from z up (REP-103) to OpenSim's Y up: (X, Y, Z) = (y, z, x); False keeps the axes.

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
    positions = track.joints[:, [track.joint_names.index(name) for name in chosen]]
    if y_up:
        positions = positions @ Z_UP_FROM_Y_UP
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
_MILLIMETERS = 1000.0


def write_c3d(path: str | Path, track: Track) -> None:
    """Write the joints and sites of a track as points in millimeters, z up; in searching frames they are not observed.

    The format has a constant rate, that of the median time between two frames.

    Args:
        path: .c3d file.
        track: with at least one frame, in a frame whose z points up.

    Raises:
        VoodooError: stamps that do not increase.
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
        writer.write(file)
