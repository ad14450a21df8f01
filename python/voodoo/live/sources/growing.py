"""A folder of images that grows: each new depth image is a frame."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from voodoo.errors import RecordingError
from voodoo.live.clock import Clock
from voodoo.live.source import Arrival, Faults, Source, SourceGone
from voodoo.recordings.camera_files import FolderCalibration, read_calibration
from voodoo.recordings.empty_scene import PICTURES
from voodoo.recordings.folder import DEPTH_SUFFIXES, color_image, depth_image
from voodoo.recordings.folder import FrameClock as NameClock

_POLL_S = 0.005
_PATIENCE_S = 0.5
"""An undecodable image is retried for this time, because it may still be being written."""
_SUFFIXES = {"depth": DEPTH_SUFFIXES, "rgb": PICTURES}


class GrowingSource(Source):
    """New images in depth/ and rgb/ of a folder, see `voodoo.recordings.folder.FolderRecording`; older ones are ignored.

    Args:
        path: the folder; it may be created later.
        calibration: None: calibration.toml in the folder.
    """

    root_frame = "camera_depth_optical_frame"

    def __init__(self, path: Path, *, calibration: Path | None = None) -> None:
        """Store the settings; the folder is not read yet."""
        self.name, self._path = path.resolve().name, path
        self._file = path / "calibration.toml" if calibration is None else calibration
        self._names: dict[str, set[str]] = {}
        self._changed: dict[str, int] = {}
        self._waiting: list[tuple[str, Path, float]] = []

    def open(self, clock: Clock, faults: Faults) -> None:
        """See Source."""
        self._clock, self._faults = clock, faults
        if not (self._path.is_dir() and self._file.is_file()):
            raise SourceGone(f"{self._path}: expected a folder and {self._file.name}, found none yet")
        self._calibration: FolderCalibration = read_calibration(self._file)
        self.root_frame = self._calibration.root_frame
        if not self._names:
            # Images added while the source is gone are read when it is available again.
            self._names = {kind: set(self._listed(kind)) for kind in _SUFFIXES}

    def _listed(self, kind: str) -> list[str]:
        """Names of the images of a kind, if the folder has changed since the last call."""
        folder = self._path / kind
        try:
            changed = os.stat(folder).st_mtime_ns  # noqa: PTH116 - called hundreds of times a second
            if self._changed.get(kind) == changed and time.time_ns() - changed > 50_000_000:
                return []
            self._changed[kind] = changed
            return [entry.name for entry in os.scandir(folder) if entry.name.lower().endswith(_SUFFIXES[kind])]
        except FileNotFoundError:
            return []

    def read(self, timeout: float) -> Sequence[Arrival]:
        """See Source."""
        until = self._clock.now() + timeout
        while True:
            if not self._path.is_dir():
                raise SourceGone(f"{self._path}: expected a folder, found none: it was moved or unmounted")
            arrivals = self._list_arrivals()
            if arrivals or self._clock.now() >= until:
                return arrivals
            time.sleep(_POLL_S)

    def _list_arrivals(self) -> list[Arrival]:
        now = self._clock.now()
        for kind in ("rgb", "depth") if self._calibration.color is not None else ("depth",):
            new = sorted(name for name in self._listed(kind) if name not in self._names[kind])
            self._names[kind].update(new)
            self._waiting += [(kind, self._path / kind / name, now) for name in new]
        found = [(one, self._arrival(*one, now)) for one in self._waiting]
        self._waiting = [one for one, made in found if made is None]
        return sorted((one for _, made in found for one in made or ()), key=lambda one: (one.stamp, one.drives))

    def _arrival(self, kind: str, path: Path, since: float, now: float) -> list[Arrival] | None:
        """The arrival of a file; none if it is unusable, None while it may still be being written."""
        color = self._calibration.color
        try:
            stamp = NameClock(None).of([path])[0]
            if kind == "rgb" and color is not None:
                image = color_image(stamp, path, color)
                _ = image.image
                return [Arrival("rgb", "color", stamp, lambda: image)]
            item = depth_image(stamp, path, self._calibration)
        except (RecordingError, OSError) as error:
            if now - since < _PATIENCE_S:
                return None
            self._faults.add_error(error, now, "damaged picture") if isinstance(error, RecordingError) else None
            return []
        return [Arrival("depth", "depth", stamp, lambda: item, drives=True)]

    def about(self) -> dict[str, Any]:
        """See Source."""
        return {"name": self.name, "kind": "folder", "path": str(self._path)}
