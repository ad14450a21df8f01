"""Faults of live sources: each kind has a name, is counted and is reported when it occurs."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from voodoo.errors import RecordingError, VoodooError

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
    "wrong unit": "depths beyond 100 m: meters that are millimeters",
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


class Fault(RecordingError):
    """A measurement that cannot be used.

    Args:
        kind: a name in FAULTS.
        message: what was expected and found, and where.
    """

    def __init__(self, kind: str, message: str) -> None:
        """Store kind and message."""
        super().__init__(message, reason=kind)


def kind_of(reason: str, otherwise: str) -> str:
    """The name in FAULTS for the `reason` of an error, or for what recordings leave out."""
    return _OF_REASONS.get(reason, reason if reason in FAULTS else otherwise)


@contextmanager
def faulty(otherwise: str, where: str = "") -> Iterator[None]:
    """Errors of recordings raised inside become faults, of the kind `otherwise` if their reason determines none."""
    try:
        yield
    except RecordingError as error:
        raise Fault(kind_of(error.reason, otherwise), f"{where}{error}") from error


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
