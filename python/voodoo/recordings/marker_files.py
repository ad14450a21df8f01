"""Marker files (.trc, .c3d) as recordings, with a map that says which site each marker stands for."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field, FiniteFloat

from voodoo.errors import RecordingError, shortened
from voodoo.measurements import MARKER_SIGMA_M, FloatArray, MarkerSet, RecordedFrame
from voodoo.model.body import Body
from voodoo.model.joint import Strict, valid
from voodoo.model.standing import HIGH_M, standing_along
from voodoo.model.toml_io import parse_toml, read_text
from voodoo.recordings.marker_trajectories import Z_UP_FROM, MarkerTrajectories, read_markers
from voodoo.recordings.pose2sim import SITES
from voodoo.recordings.recording import Recording, SensorInfo, Start

FRAME = "world"


class OnLimb(Strict):
    """The place of a marker on the body.

    Args:
        limb: name of the limb.
        position: (x, y, z) [m] in the limb's frame.
    """

    limb: str
    position: tuple[FiniteFloat, FiniteFloat, FiniteFloat]


class MarkerMap(Strict):
    """Assigns the markers of a file to sites and limbs.

    Args:
        sites: marker name -> site name. Markers named like a site of the default human need no entry, nor do
            Pose2Sim's.
        limbs: marker name -> its place on a limb; it becomes a new site.
        y_up: the file's axes are OpenSim's (Y up) and are turned to z up; False keeps them; None: as a .c3d says (Y_SCREEN; with
            X_SCREEN only, the axis across it along which the body stands), else OpenSim's.
        sigma_m: standard deviation of a marker's position [m].
    """

    sites: dict[str, str] = Field(default_factory=dict)
    limbs: dict[str, OnLimb] = Field(default_factory=dict)
    y_up: bool | None = None
    sigma_m: Annotated[FiniteFloat, Field(gt=0.0)] = MARKER_SIGMA_M

    @classmethod
    def load(cls, path: Path) -> MarkerMap:
        """Read a map from TOML.

        Raises:
            RecordingError: unreadable or of another format; names file and key.
        """
        tables = parse_toml(read_text(path, error=RecordingError), source=str(path), error=RecordingError)
        with valid(path, RecordingError, most=1):
            return cls.model_validate(tables)

    def worn(self) -> dict[str, tuple[str, tuple[float, float, float]]]:
        """The markers on limbs, in the format of voodoo.sensors.markers.body_with_markers."""
        return {name: (place.limb, place.position) for name, place in self.limbs.items()}


class MarkerRecording(Recording):
    """A .trc or .c3d file: one frame for each instant, the first instant as start.

    Args:
        path: the file.
        markers: assigns the markers; None: their names are those of the default human's sites, or Pose2Sim's. Others
            are not used.
        bare: the first instant is not used as the start; its markers are measurements like all others.

    Raises:
        RecordingError: the file is damaged.
    """

    loader = "markers"

    def __init__(self, path: Path, markers: MarkerMap | None = None, *, bare: bool = False) -> None:
        """Read the file."""
        self.path, self.name, self.root_frame = path, path.stem, FRAME
        self.map = markers or MarkerMap()
        content = read_markers(path)
        own = Body.human(model="full").site_names
        names = {name: name for name in own} | SITES | self.map.sites | {name: name for name in self.map.limbs}
        sites, positions = content.of(names)
        self._likely = standing_along(sites, positions)
        if self.map.y_up is None:
            self._up, assumed_axes = self._up_of(content)
        else:
            self._up, assumed_axes = "+Y" if self.map.y_up else "+Z", ()
        self._notes = (f"up is {self._up} of the file",)
        self._positions = positions @ Z_UP_FROM[self._up].T
        self._sites, self._stamps = sites, content.stamps
        unknown = sorted((set(self.map.sites) | set(self.map.limbs)) - set(content.names))
        if unknown:
            raise RecordingError(f"{path}: expected the markers {', '.join(unknown)}, found {', '.join(content.names)}")
        if len(set(sites)) != len(sites):
            raise RecordingError(f"{path}: expected one marker for each site, found {', '.join(sorted(sites))}")
        first = {name: at for name, at in self._at(0).items() if name not in self.map.limbs}
        start = Start(joints={name: (float(x), float(y), float(z)) for name, (x, y, z) in first.items()})
        self.start = None if bare or not first else start
        warnings = self._warnings() if self.map.y_up is None else ()
        self.assumed = (*content.remarks, *assumed_axes, *self._unnamed(content.names), *warnings)

    def _at(self, index: int) -> dict[str, FloatArray]:
        rows = zip(self._sites, self._positions[index], strict=True)
        return {site: position for site, position in rows if np.isfinite(position).all()}

    def _unnamed(self, names: Sequence[str]) -> tuple[str, ...]:
        """What to do if no marker stands for a site."""
        if self._sites or not names:
            return ()
        words = f"no marker is named like a site (l_wrist, ...): {shortened(', '.join(names))}"
        return (f'{self.path.name}: {words}; name their sites for --marker-map: [sites] "{names[0]}" = "l_wrist", ...',)

    def _up_of(self, content: MarkerTrajectories) -> tuple[str, tuple[str, ...]]:
        """The axis of the file that is taken for up, and what to know about it."""
        if content.up or not content.right:
            return content.up or "+Y", ()
        level = content.right[1]
        standing = self._likely if self._likely and self._likely[1] != level else ""
        up = standing or ("+Z" if level == "Y" else "+Y")
        why = "along which the body stands" if standing else "a guess"
        words = f"X_SCREEN without Y_SCREEN says only that {level} is level; {up} is taken for up, {why}"
        return up, (f"{self.path.name}: {words}",)

    def _warnings(self) -> tuple[str, ...]:
        """What speaks against the axis that is taken for up."""
        likely = self._likely
        heights = self._positions[..., 2][np.isfinite(self._positions[..., 2])]
        if likely in ("", self._up):
            if not {"l_ankle", "r_ankle"} & set(self._sites) or not heights.size or heights.min() < HIGH_M:
                return ()
            words = f"{self._up} of the file is taken for up, and no marker is lower than {heights.min():.1f} m"
            return (f"{self.path.name}: {words}; are axes and unit right?",)
        y_up = {"+Y": "true", "+Z": "false"}.get(likely)
        remedy = f"y_up = {y_up} in a --marker-map says so" if y_up else "exchange the axes of the file"
        words = f"{self._up} of the file is taken for up, but the body stands along its {likely}"
        return (f"{self.path.name}: {words}; if that is up, {remedy}",)

    def __iter__(self) -> Iterator[RecordedFrame]:
        """The markers, instant by instant.

        Raises:
            RecordingError: no marker stands for a site.
        """
        if not self._sites:
            raise RecordingError(f"{self.path.name}: expected markers of the body, found none")
        for index, stamp in enumerate(self._stamps):
            item = MarkerSet(self.path.name, float(stamp), self._at(index), self.map.sigma_m)
            yield RecordedFrame(float(stamp), (item,))

    def _sensors(self) -> Iterator[SensorInfo]:
        yield SensorInfo.of(self.path.name, "markers", FRAME, self._stamps, f"{len(self._sites)} markers")
