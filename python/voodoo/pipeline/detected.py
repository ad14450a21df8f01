"""A recording in whose color images a network finds keypoints while it is read."""

from __future__ import annotations

from collections.abc import Iterator

from voodoo.errors import RecordingError
from voodoo.measurements import RecordedFrame
from voodoo.recordings.joined import Around
from voodoo.recordings.left_out import LeftOut
from voodoo.recordings.recording import Recording, RecordingInfo
from voodoo.sensors.keypoints.networks import KeypointNetwork


class Detected(Around):
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
        super().__init__(recording)
        self._network, self._refused = network, None if left_out is None else left_out.add_error
        sensors = recording.info().sensors
        names = {sensor.name for sensor in sensors}
        colors = [sensor.name for sensor in sensors if sensor.kind == "color"]
        if not colors:
            found = ", ".join(f"{sensor.name} ({sensor.kind})" for sensor in sensors) or "none"
            raise RecordingError(f"{recording.path}: expected color images for {network.name}, found {found}")
        self._cameras = {name for name in colors if f"{name}/keypoints" not in names}

    def __iter__(self) -> Iterator[RecordedFrame]:
        """The frames, with a KeypointImage before each color image."""
        for recorded in self._recording:
            yield RecordedFrame(recorded.stamp, self._network.added_to(recorded, refused=self._refused))

    def info(self) -> RecordingInfo:
        """The summary of the recording, with the keypoints."""
        return self._info(self._cameras, f"{self._network.layout} by {self._network.name}")
