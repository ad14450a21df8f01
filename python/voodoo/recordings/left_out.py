"""Counts measurements of a damaged recording that are left out, so that the rest can be tracked."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from copy import deepcopy

from voodoo.errors import RecordingError, VoodooError


def no_frame(name: str, left_out: LeftOut | None) -> str:
    """What is said of a recording of which no frame could be used, and why."""
    first = f" (the first: {next(iter(left_out.first.values()))})" if left_out else ""
    return f"{name}: expected at least one frame that can be used, found none: {left_out or 'it is empty'}{first}"


class LeftOut:
    """Unusable measurements, counted by reason.

    A loader that gets this object leaves such measurements out and continues; without it, the first one is an error.

    Attributes:
        counts: reason -> number.
        first: reason -> description of the first one.
        notes: what else to know, each once.
    """

    def __init__(self) -> None:
        """Start with no counts."""
        self.counts: dict[str, int] = {}
        self.first: dict[str, str] = {}
        self.notes: dict[str, None] = {}

    def add(self, reason: str, words: object, count: int = 1) -> None:
        """Count measurements that were left out.

        Args:
            reason: the same words for the same kind of damage.
            words: which measurement, and what is wrong with it.
            count: number of measurements.
        """
        self.counts[reason] = self.counts.get(reason, 0) + count
        self.first.setdefault(reason, str(words))

    def add_error(self, error: VoodooError) -> None:
        """Count the measurement that raised an error."""
        self.add(getattr(error, "reason", "refused"), error)

    @contextmanager
    def aside(self) -> Iterator[None]:
        """What is read inside is read again, and not counted here."""
        before = deepcopy(vars(self))
        try:
            yield
        finally:
            vars(self).update(before)

    def __len__(self) -> int:
        """Number of left-out measurements."""
        return sum(self.counts.values())

    def __str__(self) -> str:
        """Counts and reasons in one line."""
        return ", ".join(f"{count} {reason}" for reason, count in sorted(self.counts.items()))


def leave_out(left_out: LeftOut | None, error: RecordingError, reason: str = "", count: int = 1) -> None:
    """Count measurements that cannot be used; without `left_out`, their error is raised.

    Args:
        left_out: of the loader.
        error: what is wrong with them.
        reason: see `LeftOut.add`; by default that of the error.
        count: number of measurements.
    """
    if left_out is None:
        raise error
    left_out.add(reason or error.reason, error, count)


@contextmanager
def leaving_out(left_out: LeftOut | None, reason: str = "") -> Iterator[None]:
    """An error inside ends the block and is counted, see `leave_out`."""
    try:
        yield
    except RecordingError as error:
        leave_out(left_out, error, reason)
