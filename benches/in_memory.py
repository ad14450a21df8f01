"""A recording whose frames are in memory: what is read and decoded is not measured, and frames may be changed or left out."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from voodoo.measurements import RecordedFrame
from voodoo.recordings import Recording


@dataclass
class InMemory:
    """Frames of a recording, and all else that it tells."""

    source: Recording
    frames: Sequence[RecordedFrame]

    def __getattr__(self, name: str) -> Any:
        return getattr(self.source, name)

    def __len__(self) -> int:
        return len(self.frames)

    def __iter__(self) -> Iterator[RecordedFrame]:
        return iter(self.frames)
