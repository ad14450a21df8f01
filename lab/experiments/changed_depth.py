"""A recording whose depth images are changed: resampled for another lens, cut, ..."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import lru_cache

import numpy as np

from voodoo.measurements import DepthImage, RecordedFrame
from voodoo.model.camera import Camera
from voodoo.recordings.recording import Recording, RecordingInfo


class ChangedDepth(Recording):
    """A recording whose depth images are changed; everything else is unchanged.

    Args:
        recording: with depth images.
        change: what takes the place of a depth image.
    """

    def __init__(self, recording: Recording, change: Callable[[DepthImage], DepthImage]) -> None:
        self.path, self.name, self.root_frame = recording.path, recording.name, recording.root_frame
        self.start, self.reference, self.people = recording.start, recording.reference, recording.people
        self._recording, self._change = recording, change

    def __len__(self) -> int:
        return len(self._recording)

    def __iter__(self) -> Iterator[RecordedFrame]:
        for recorded in self._recording:
            items = (self._change(item) if isinstance(item, DepthImage) else item for item in recorded.measurements)
            yield RecordedFrame(recorded.stamp, tuple(items))

    def info(self) -> RecordingInfo:
        return self._recording.info()


def resampled(item: DepthImage, camera: Camera) -> DepthImage:
    """The depth image of another camera at the same place, through any lens.

    Every pixel takes the depth of the recorded pixel nearest to its ray, which has an error of the surface's slope over half a
    pixel. Pixels whose ray is outside the recorded image, or that have no ray, have no return.
    """
    index = sources(item.camera, camera)
    image = np.where(index >= 0, item.image.reshape(-1)[index], item.image.dtype.type(0))
    return replace(item, image=image, camera=camera)


@lru_cache(maxsize=4)
def sources(recorded: Camera, camera: Camera) -> np.ndarray:
    """(H, W) of a camera: index of the recorded pixel nearest to its ray, row by row; -1 where there is none."""
    rays = camera.rays().reshape(-1, 2).astype(np.float64)
    columns, rows = np.rint(recorded.project(np.column_stack([rays, np.ones(len(rays))]))).T
    inside = (columns >= 0) & (columns < recorded.width) & (rows >= 0) & (rows < recorded.height)
    index = np.full(len(rays), -1, dtype=np.intp)
    index[inside] = rows[inside].astype(np.intp) * recorded.width + columns[inside].astype(np.intp)
    return index.reshape(camera.height, camera.width)
