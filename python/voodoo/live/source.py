"""What a live source is: it hands over measurements as they come, and says when it is gone."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from voodoo.errors import VoodooError
from voodoo.live.clock import Clock
from voodoo.live.faults import Faults
from voodoo.measurements import FloatArray, Measurement


class SourceGone(VoodooError):
    """A source that was there is not any more: unplugged, or its driver ended."""


class SourceEnded(VoodooError):
    """A source that has an end is at its end: a recording that was played."""


def _always() -> bool:
    return True


@dataclass(frozen=True)
class Arrival:
    """A measurement that came, not decoded yet.

    Args:
        sensor: topic, folder or stream.
        kind: "depth", "points", "scan", "color", "keypoints" or "markers".
        stamp: time of measurement by the source's clock [s].
        measure: decodes it; raises a RecordingError where it cannot be used.
        drives: whether a frame is made for it; else it joins the next frame.
        taken: the host's time of measurement [s], where the source knows it.
        ready: whether all that belongs to it has come, such as a transform with a later stamp.
        patience: how long to wait for that [s].
    """

    sensor: str
    kind: str
    stamp: float
    measure: Callable[[], Measurement]
    drives: bool = False
    taken: float | None = None
    ready: Callable[[], bool] = _always
    patience: float = 0.0


class Source(ABC):
    """Where measurements come from. One thread calls `open`, then `read` again and again, then `close`.

    Attributes:
        name: for messages.
        stays: a source that is gone may come back, and is opened again.
        unusable: what came for a frame and could not become an arrival.
        placed: it is known where its sensors are among those of other sources.
    """

    name: str
    stays: bool = True
    unusable: int = 0
    placed: bool = True

    @property
    @abstractmethod
    def root_frame(self) -> str:
        """The frame that all measurements' `root_from_sensor` lead to."""

    @abstractmethod
    def open(self, clock: Clock, faults: Faults) -> None:
        """Begin; after the source was gone, begin again.

        Args:
            clock: the host's.
            faults: counts what goes wrong while reading.

        Raises:
            SourceGone: it is not there yet.
            VoodooError: it cannot be used.
        """

    @abstractmethod
    def read(self, timeout: float) -> Sequence[Arrival]:
        """What came, in the order of arrival; empty where nothing came within `timeout` [s].

        Raises:
            SourceGone: it was unplugged.
            SourceEnded: nothing more comes.
        """

    @abstractmethod
    def close(self) -> None:
        """End; harmless when it is not open."""

    def root_from(self, frame: str, stamp: float) -> FloatArray | None:
        """root_from_frame (4, 4) at a time [s]; None where the source does not know."""
        return None

    def about(self) -> dict[str, Any]:
        """What is known of it, for the report."""
        return {"name": self.name}
