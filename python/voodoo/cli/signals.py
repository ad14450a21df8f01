"""SIGINT, SIGTERM and SIGHUP end every command in the same way: what there is is written."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

import typer

INTERRUPTED = 130
"""Exit code after Ctrl-C; after another signal it is 128 and its number, too."""
_NUMBERS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))


class _Received(threading.Event):
    """Whether one of the signals was received: its number, and whether it raises KeyboardInterrupt."""

    number, raises = int(signal.SIGINT), True


_received = _Received()


@contextmanager
def ending() -> Iterator[None]:
    """The first signal inside raises KeyboardInterrupt or is noted by `deferred`; a second one ends the program at once.

    Ignored signals, as below nohup, stay ignored.

    Raises:
        typer.Exit: with the code of the signal, instead of KeyboardInterrupt or an exit with INTERRUPTED.
    """
    before: dict[int, Any] = {}
    _received.number = int(signal.SIGINT)

    def receive(number: int, _: FrameType | None) -> None:
        for each in before:
            signal.signal(each, signal.SIG_DFL)
        _received.number = number
        _received.set()
        if _received.raises:
            raise KeyboardInterrupt

    if threading.current_thread() is threading.main_thread():
        before = {number: signal.getsignal(number) for number in _NUMBERS}
        before = {number: handler for number, handler in before.items() if handler not in (signal.SIG_IGN, None)}
        for number in before:
            signal.signal(number, receive)
    try:
        yield
    except (KeyboardInterrupt, typer.Exit) as end:
        if getattr(end, "exit_code", INTERRUPTED) != INTERRUPTED:
            raise
        raise typer.Exit(128 + _received.number) from None
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        _received.clear()


@contextmanager
def deferred() -> Iterator[threading.Event]:
    """A signal inside sets the event, and raises nothing."""
    before, _received.raises = _received.raises, False
    try:
        yield _received
    finally:
        _received.raises = before
