"""Markers worn on a body as measurements: on its sites, or with an offset on a limb."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from voodoo._core import Body as _CoreBody
from voodoo._core import Frame
from voodoo.errors import BodyError, MeasurementError
from voodoo.model.body import Body, checked_joints
from voodoo.recordings.marker_trajectories import MarkerTrajectories


def body_with_markers(body: Body, markers: Mapping[str, tuple[str, Sequence[float]]]) -> Body:
    """Returns the body with an additional site for every marker that is worn on a limb.

    A measurement is then `frame.add_position(marker, position, weight=...)`.

    Args:
        body: the original body, which is not changed.
        markers: marker name -> (limb, (x, y, z) [m] in the limb's frame: z along its axis from the proximal end).

    Raises:
        BodyError: an unknown limb, a name that is taken, or an offset that is not three finite numbers.
    """
    offsets = dict(checked_joints({name: offset for name, (_, offset) in markers.items()}, what="markers"))
    name, limbs, sites = body.core.parts()
    for marker, (limb, _) in markers.items():
        if limb not in body.limb_names:
            raise BodyError(f"markers[{marker}]: expected one of {', '.join(body.limb_names)}, found {limb!r}")
        sites.append((marker, limb, offsets[marker]))
    return Body(_CoreBody(name, limbs, sites))


def marker_offset(
    world_from_limb: npt.ArrayLike, position: Sequence[float] | npt.NDArray[np.float64]
) -> tuple[float, float, float]:
    """Where a marker sits on a limb, from a frame in which the limb's pose (4, 4) and the marker's position (3,) are
    known."""
    pose = np.asarray(world_from_limb, dtype=np.float64)
    x, y, z = (float(value) for value in (np.asarray(position, dtype=np.float64) - pose[:3, 3]) @ pose[:3, :3])
    return x, y, z


def add_markers(
    frame: Frame,
    trajectories: MarkerTrajectories,
    index: int,
    *,
    sites: Mapping[str, str],
    weight: float,
    world_from_markers: npt.ArrayLike | None = None,
    source: str = "markers",
) -> tuple[str, ...]:
    """Add the markers of one instant to a frame; missing ones are left out.

    Args:
        frame: the frame that the positions are added to.
        trajectories: trajectories of all markers.
        index: index of the instant.
        sites: marker name -> site name; other markers are not used.
        weight: weight of each marker, e.g. SensorModel().weight(0.01).
        world_from_markers: rigid (4, 4); identity by default.
        source: name for `Estimate.sources`.

    Returns:
        Names of the sites that were measured.

    Raises:
        MeasurementError: no such instant.
    """
    if not 0 <= index < len(trajectories.stamps):
        raise MeasurementError(f"markers: expected an instant from 0 to {len(trajectories.stamps) - 1}, found {index}")
    names, positions = trajectories.of(sites)
    pose = np.eye(4) if world_from_markers is None else np.asarray(world_from_markers, dtype=np.float64)
    added = []
    for site, position in zip(names, positions[index], strict=True):
        if np.isfinite(position).all():
            frame.add_position(site, pose[:3, :3] @ position + pose[:3, 3], weight=weight, source=source)
            added.append(site)
    return tuple(added)
