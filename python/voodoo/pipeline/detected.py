"""A recording in whose color images a network finds keypoints while it is read."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from voodoo.errors import RecordingError
from voodoo.measurements import FloatArray, RecordedFrame
from voodoo.recordings.left_out import LeftOut
from voodoo.recordings.recording import Recording, RecordingInfo
from voodoo.sensors.keypoints.networks import KeypointNetwork


class Detected(Recording):
    """A recording with the keypoints that a network finds in its color images.

    Args:
        recording: with color images.
        network: run on each of them that has no keypoints yet.
        left_out: counts damaged color images, which are left out; None: they are errors.

    Raises:
        RecordingError: no color images.
    """

    def __init__(self, recording: Recording, network: KeypointNetwork, *, left_out: LeftOut | None = None) -> None:
        """Check that there are color images."""
        self.path, self.name, self.root_frame = recording.path, recording.name, recording.root_frame
        self.start, self.reference, self.assumed = recording.start, recording.reference, recording.assumed
        self.people, self.complete = recording.people, recording.complete
        self._recording, self._network = recording, network
        self._refused = None if left_out is None else left_out.add_error
        sensors = recording.info().sensors
        if not any(sensor.kind == "color" for sensor in sensors):
            found = ", ".join(f"{sensor.name} ({sensor.kind})" for sensor in sensors)
            raise RecordingError(f"{recording.path}: expected color images for {network.name}, found {found or 'none'}")

    def __len__(self) -> int:
        """Number of frames."""
        return len(self._recording)

    def __iter__(self) -> Iterator[RecordedFrame]:
        """The frames, with a KeypointImage before each color image."""
        for recorded in self._recording:
            yield RecordedFrame(recorded.stamp, self._network.added_to(recorded, refused=self._refused))

    def root_from(self, frame: str, stamp: float) -> FloatArray:
        """See Recording."""
        return self._recording.root_from(frame, stamp)

    def empty_scene(self) -> Mapping[str, Sequence[npt.NDArray[np.uint8]]]:
        """See Recording."""
        return self._recording.empty_scene()

    def info(self) -> RecordingInfo:
        """The summary of the recording, with the keypoints."""
        about, words = self._recording.info(), f"{self._network.layout} by {self._network.name}"
        known = {sensor.name for sensor in about.sensors}
        added = tuple(
            replace(sensor, name=f"{sensor.name}/keypoints", kind="keypoints", detail=words)
            for sensor in about.sensors
            if sensor.kind == "color" and f"{sensor.name}/keypoints" not in known
        )
        return replace(about, sensors=(*about.sensors, *added))
