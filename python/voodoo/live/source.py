"""Interface of a live source: it passes on measurements as they arrive, and reports when it is gone."""

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
    """A source has disappeared: it was unplugged, or its driver ended."""


class SourceEnded(VoodooError):
    """A finite source, such as a replayed recording, is at its end."""


@dataclass(frozen=True)
class Arrival:
    """A measurement that arrived and is not decoded yet.

    Args:
        sensor: topic, folder or stream.
        kind: "depth", "points", "scan", "color", "keypoints" or "markers".
        stamp: time of measurement by the source's clock [s].
        measure: decodes it; raises a RecordingError where it cannot be used.
        drives: whether it defines a frame; else it joins the next frame.
        taken: time of measurement by the host clock [s], if the source knows it.
        ready: whether everything that belongs to it has arrived, such as a transform with a later stamp.
        patience: how long to wait for that [s].
    """

    sensor: str
    kind: str
    stamp: float
    measure: Callable[[], Measurement]
    drives: bool = False
    taken: float | None = None
    ready: Callable[[], bool] = lambda: True
    patience: float = 0.0


class Source(ABC):
    """A source of measurements. One thread calls `open`, then `read` repeatedly, then `close`.

    Attributes:
        name: name in messages.
        stays: the source may come back after it has disappeared, and is then opened again.
        unusable: number of frame-defining measurements that could not become an arrival.
        placed: whether the poses of its sensors relative to other sources are known.
    """

    name: str
    stays: bool = True
    unusable: int = 0
    placed: bool = True

    @property
    @abstractmethod
    def root_frame(self) -> str:
        """The target frame of `root_from_sensor` of all measurements."""

    @abstractmethod
    def open(self, clock: Clock, faults: Faults) -> None:
        """Open the source, also again after it had disappeared.

        Args:
            clock: host clock.
            faults: counts faults while reading.

        Raises:
            SourceGone: it is not available yet.
            VoodooError: it cannot be used.
        """

    @abstractmethod
    def read(self, timeout: float) -> Sequence[Arrival]:
        """New measurements in the order of arrival; empty if none arrives within `timeout` [s].

        Raises:
            SourceGone: it was unplugged.
            SourceEnded: there are no more measurements.
        """

    def close(self) -> None:  # noqa: B027 - some have nothing to close
        """Close the source; no effect if it is not open."""

    def root_from(self, frame: str, stamp: float) -> FloatArray | None:
        """root_from_frame (4, 4) at a time [s]; None if the source does not know it."""
        return None

    def about(self) -> dict[str, Any]:
        """Properties for the report."""
        return {"name": self.name}
