"""C3D, the format of motion capture laboratories: named points over time, with units and rate."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np

from voodoo.export.conventions import plain
from voodoo.export.skeleton import mean_interval
from voodoo.export.track import Track
from voodoo.whole import appearing_whole

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
