"""A recording replayed in real time, as if its sensors were live."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

from voodoo.live.clock import Clock
from voodoo.live.source import Arrival, Faults, Source, SourceEnded, kind_of
from voodoo.measurements import FloatArray, RecordedFrame
from voodoo.pipeline.pairing import paired
from voodoo.recordings.first_images import doubts, first_frames
from voodoo.recordings.left_out import LeftOut
from voodoo.recordings.recording import Recording
from voodoo.sensors.adapters import adapter_of


class PlayedSource(Source):
    """Replays a recording, each frame when it is due; the due time is used as the time of measurement.

    Args:
        recording: recording to replay.
        rate: playback speed relative to real time.
        loop: start again at the end; stamps continue to rise.
        left_out: damaged measurements that the recording leaves out; they are reported as they occur, and counted no longer.
    """

    stays, root_frame = False, ""

    def __init__(
        self, recording: Recording, *, rate: float = 1.0, loop: bool = False, left_out: LeftOut | None = None
    ) -> None:
        """Store the settings; nothing is read yet."""
        self.name, self.recording, self.root_frame = recording.name, recording, recording.root_frame
        self._rate, self._loop = rate, loop
        self._left_out = LeftOut() if left_out is None else left_out
        self._told: set[str] = set()
        self._about = recording.info()
        self._driver = self._about.sensors[0].name if self._about.sensors else ""

    def open(self, clock: Clock, faults: Faults) -> None:
        """See Source."""
        self._clock, self._faults = clock, faults
        self._doubts = doubts(first_frames(self.recording, left_out=self._left_out))
        self._frames: Iterator[RecordedFrame] = iter(paired(self.recording))
        self._next = self._following()
        self._first = 0.0 if self._next is None else self._next.stamp
        self._began = clock.now()
        self._shift = 0.0

    def read(self, timeout: float) -> Sequence[Arrival]:
        """See Source."""
        frame = self._next
        if frame is None:
            raise SourceEnded(f"{self.name}: it is at its end")
        due = self._began + (frame.stamp + self._shift - self._first) / self._rate
        wait = due - self._clock.now()
        if wait > 0.0:
            time.sleep(min(wait, timeout))
            if wait > timeout:
                return ()
        arrivals = self._arrivals(frame, due)
        self._advance(frame)
        return arrivals

    def _advance(self, frame: RecordedFrame) -> None:
        self._next = self._following()
        if self._next is None and self._loop:
            self._frames = iter(paired(self.recording))
            self._next = self._following()
            period = (frame.stamp - self._first) / max(self._about.frames - 1, 1)
            self._shift += frame.stamp - self._first + period

    def _following(self) -> RecordedFrame | None:
        """The next frame; reports what was left out before it, and once what is assumed and noted."""
        following = next(self._frames, None)
        for reason, count in self._left_out.counts.items():
            kind = kind_of(reason, "unreadable message")
            self._faults.add(kind, self._left_out.first[reason], self._clock.now(), count)
        self._left_out.counts.clear()
        own = (f"{self.name}: {words}" for words in (*self._doubts, *self._left_out.notes))
        for words in (*self.recording.assumed, *own):
            if words not in self._told:
                self._told.add(words)
                self._faults.log(words)
        return following

    def _arrivals(self, frame: RecordedFrame, due: float) -> list[Arrival]:
        arrivals = []
        made_for = [item for item in frame.measurements if item.stamp == frame.stamp]
        driver = next((item for item in made_for if item.sensor == self._driver), made_for[-1])
        for item in (*(item for item in frame.measurements if item is not driver), driver):
            adapter, stamp = adapter_of(item), item.stamp + self._shift
            measure = partial(replace, item, stamp=stamp)
            kind = adapter.recorded_as or adapter.kind
            arrivals.append(Arrival(item.sensor, kind, stamp, measure, item is driver, taken=due))
        return arrivals

    def close(self) -> None:
        """See Source."""
        self._frames, self._next = iter(()), None

    def root_from(self, frame: str, stamp: float) -> FloatArray | None:
        """See Source."""
        return self.recording.root_from(frame, stamp - self._shift)

    def about(self) -> dict[str, Any]:
        """See Source."""
        return {"name": self.name, "kind": "recording", "path": str(self.recording.path), "rate": self._rate}
