"""A recording as another depth camera at the same place would have seen it, through any lens."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from voodoo.measurements import DepthImage, Measurement, RecordedFrame
from voodoo.model.camera import Camera
from voodoo.recordings.recording import Recording, RecordingInfo


class ThroughLens(Recording):
    """A recording whose depth images are seen through other cameras; everything else is as it was.

    Every pixel has the depth that the recorded image has where its ray is seen, the nearest pixel's: what is between two
    pixels of a surface is off by the surface's slope over half a pixel. Nothing returns where the recorded camera does not
    look, or the lens has no ray.

    Args:
        recording: with depth images.
        lens: the camera in place of a recorded one.
    """

    def __init__(self, recording: Recording, lens: Callable[[Camera], Camera]) -> None:
        """Keep the recording."""
        self.path, self.name, self.root_frame = recording.path, recording.name, recording.root_frame
        self.start, self.reference, self.people = recording.start, recording.reference, recording.people
        self._recording, self._lens = recording, lens

    def __len__(self) -> int:
        """Number of frames."""
        return len(self._recording)

    def __iter__(self) -> Iterator[RecordedFrame]:
        """The frames in order."""
        for recorded in self._recording:
            yield RecordedFrame(recorded.stamp, tuple(self._rendered(item) for item in recorded.measurements))

    def _rendered(self, item: Measurement) -> Measurement:
        if not isinstance(item, DepthImage):
            return item
        camera = self._lens(item.camera)
        index = _sources(item.camera, camera)
        image = np.where(index >= 0, item.image.reshape(-1)[index], item.image.dtype.type(0))
        return replace(item, image=image, camera=camera)

    def info(self) -> RecordingInfo:
        """That of the recording."""
        about = self._recording.info()
        return replace(about, notes=(*about.notes, "depth seen through another lens"))


@lru_cache(maxsize=4)
def _sources(recorded: Camera, camera: Camera) -> npt.NDArray[np.intp]:
    """(H, W) of a camera: index of the recorded pixel that its ray is seen in, row by row; -1 where there is none."""
    rays = camera.rays().reshape(-1, 2).astype(np.float64)
    columns, rows = np.rint(recorded.project(np.column_stack([rays, np.ones(len(rays))]))).T
    inside = (columns >= 0) & (columns < recorded.width) & (rows >= 0) & (rows < recorded.height)
    index = np.full(len(rays), -1, dtype=np.intp)
    index[inside] = rows[inside].astype(np.intp) * recorded.width + columns[inside].astype(np.intp)
    return index.reshape(camera.height, camera.width)
