"""A live source in the form of a recording, for code that determines the start of tracking from a recording."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from voodoo.live.assembly import LiveFrame
from voodoo.live.stream import Live
from voodoo.measurements import FloatArray, RecordedFrame
from voodoo.recordings.recording import Recording, SensorInfo


class FirstFrame(Recording):
    """A recording without frames that has the sensors of a live source.

    Args:
        live: the source.
        frame: its first frame.
    """

    loader = "live"

    def __init__(self, live: Live, frame: LiveFrame) -> None:
        """Store source and frame."""
        self.name = live.sources[0].name
        self.path = Path(self.name)
        self.root_frame = live.root_frame
        self._live, self._stamps = live, [frame.stamp]

    def __len__(self) -> int:
        """No frames."""
        return 0

    def __iter__(self) -> Iterator[RecordedFrame]:
        """No frames."""
        return iter(())

    def _sensors(self) -> Iterator[SensorInfo]:
        for name, kind in self._live.kinds.items():
            yield SensorInfo.of(name, kind, self.root_frame, self._stamps, "live")

    def root_from(self, frame: str, stamp: float) -> FloatArray:
        """See Recording."""
        known = self._live.root_from(frame, stamp)
        return super().root_from(frame, stamp) if known is None else known
