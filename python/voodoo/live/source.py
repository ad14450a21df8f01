"""Interface of a live source: it passes on measurements as they arrive, and reports when it is gone. Its faults have names, are
counted, and are reported when they occur."""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from voodoo.errors import RecordingError, VoodooError
from voodoo.live.clock import Clock
from voodoo.measurements import FloatArray, Measurement

FAULTS: dict[str, str] = {
    "stalled": "nothing that can be used came for 0.3 s",
    "gone": "the source was unplugged or ended; it is opened again and again",
    "repeated stamp": "a measurement with the stamp of the one before",
    "late": "a measurement older than the one before",
    "time jumped back": "stamps go on from an earlier time",
    "time jumped ahead": "stamps go on from a later time than has passed",
    "no stamp": "a header with a stamp of zero, or one that is no time",
    "frozen picture": "a depth image that repeats the one before bit by bit under another stamp",
    "blank picture": "a depth image in which nothing returned: all zero or NaN",
    "wrong unit": "a median depth below 1 cm or beyond 100 m",
    "another size": "an image of another size than its calibration says",
    "calibration missing": "an image of a camera whose calibration did not come",
    "calibration unusable": "a calibration that makes no camera",
    "calibration changed": "another calibration than before",
    "unknown encoding": "an image of an encoding that is not read",
    "half a message": "fewer bytes than a message announces",
    "unreadable message": "bytes that are no message of their type",
    "damaged picture": "a compressed picture that does not decode",
    "transform missing": "no chain of transforms to the root frame",
    "transform too old": "no transform near a measurement's stamp",
    "transform unusable": "a transform that is no rigid one",
    "refused": "a measurement that the tracker refuses",
    "lost on the way": "messages that the network lost",
}
"""Name -> meaning."""

_OF_REASONS = {
    "with a repeated stamp": "repeated stamp",
    "with a stamp before the last one": "late",
    "without a stamp": "no stamp",
    "that are blank": "blank picture",
    "of another size than calibrated": "another size",
    "without a transform near its stamp": "transform too old",
}
_QUIET_S = 1.0
"""A persisting fault is reported once per second."""


def kind_of(reason: str, otherwise: str) -> str:
    """The name in FAULTS for the `reason` of an error, or for what recordings leave out."""
    return _OF_REASONS.get(reason, reason if reason in FAULTS else otherwise)


@contextmanager
def faulty(otherwise: str, where: str = "") -> Iterator[None]:
    """Errors of recordings raised inside get a name in FAULTS as their reason: `otherwise` if it determines none."""
    try:
        yield
    except RecordingError as error:
        raise RecordingError(f"{where}{error}", reason=kind_of(error.reason, otherwise)) from error


class Faults:
    """Counts faults by name and reports them; a persisting fault is reported once per second.

    Args:
        on_message: called with a readable line; None: no reports.

    Attributes:
        counts: name -> number of faults.
        first: name -> description of the first fault.
    """

    def __init__(self, on_message: Callable[[str], None] | None = None) -> None:
        """Start without faults."""
        self.counts: dict[str, int] = {}
        self.first: dict[str, str] = {}
        self._on_message = on_message
        self._reported: dict[str, tuple[float, int]] = {}
        self._lock = threading.Lock()

    def add(self, kind: str, words: object, now: float, count: int = 1) -> None:
        """Count a fault.

        Args:
            kind: a name in FAULTS.
            words: where it occurred, what was expected and what was found.
            now: host time [s].
            count: number of faults.
        """
        with self._lock:
            self.counts[kind] = self.counts.get(kind, 0) + count
            self.first.setdefault(kind, str(words))
            at, counted = self._reported.get(kind, (float("-inf"), 0))
            if now - at < _QUIET_S:
                return
            since = self.counts[kind] - counted
            self._reported[kind] = (now, self.counts[kind])
        self.log(f"{kind}: {words}" if since == 1 else f"{kind} ({since} times): {words}")

    def add_error(self, error: VoodooError, now: float, otherwise: str) -> None:
        """Count the cause of an error; `otherwise` is its name if the error does not determine one."""
        self.add(kind_of(getattr(error, "reason", ""), otherwise), error, now)

    def log(self, words: str) -> None:
        """Report an event that is not a fault."""
        if self._on_message is not None:
            self._on_message(words)

    def __len__(self) -> int:
        """Total number of faults."""
        return sum(self.counts.values())


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
