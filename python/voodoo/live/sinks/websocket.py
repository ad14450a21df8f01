"""Poses as JSON over WebSocket, for browsers and any language; the messages are described in docs/how-to/stream.md."""

from __future__ import annotations

import asyncio
import json
import logging
import re
import selectors
import socket
import threading
import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from functools import lru_cache
from typing import Any
from urllib.parse import parse_qs

import voodoo._core as _core
from voodoo.errors import VoodooError, installed
from voodoo.export.layout import Layout
from voodoo.live.follow import Step
from voodoo.live.session import HANGS, LATE_S, Output
from voodoo.live.sinks import parts_of
from voodoo.live.sinks.people import posed_people

FORMAT, VERSION = "voodoo.people", 1
"""The version is increased if earlier readers would misread a message, not for additional keys."""
PORT = 8765
_OWN_PAGES = re.compile(r"https?://(localhost|127\.0\.0\.1|\[::1\])(:\d+)?")
_BUFFER = 2**16
"""Bytes that wait for a receiver in the system: a second of one person; more would be old when it is read."""
_CLOSE_S = 2.0
_LOG = logging.getLogger(__name__)
_LOG.addHandler(logging.NullHandler())  # what is no WebSocket client costs no traceback on the screen


class _Releasing(selectors.DefaultSelector):
    """Releases a lock while its event loop waits. A thread that holds it may use the loop's transports: to send takes less time
    than to wake the loop.
    """

    def __init__(self, lock: threading.Lock) -> None:
        """The loop runs while it holds the lock."""
        super().__init__()
        self._lock = lock

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        """See the base class."""
        self._lock.release()
        try:
            return super().select(timeout)
        finally:
            self._lock.acquire()


class WebSocketSink(Output):
    """A server that sends every receiver the newest pose that it can take.

    Web pages may connect if they come from this machine, or from an origin in the address; other programs always.

    Args:
        address: ws://[HOST][:PORT][?origin=ORIGIN&origin=...]; without a host only this machine can connect.
        root_frame: see `Sink`.
        on_message: see `Sink`.

    Raises:
        VoodooError: an address that is in use or not of this machine, or websockets is not installed.
    """

    def __init__(self, address: str, *, root_frame: Callable[[], str], on_message: Callable[[str], None]) -> None:
        """Start the server."""
        missing = f"{address}: expected websockets, found none; pip install 'voodoo-tracker[stream]'"
        server = installed("websockets.asyncio.server", missing)
        self._left = installed("websockets.exceptions", missing).ConnectionClosed
        self._frames = installed("websockets.frames", missing)
        self.name, self.receiver, self.waits = address, True, False
        self._root, self._on_message = root_frame, on_message
        host, port, parts = parts_of(address, host="127.0.0.1", port=PORT)
        origins = [None, _OWN_PAGES, *parse_qs(parts.query).get("origin", ())]
        self._lock = threading.Lock()
        self._loop = asyncio.SelectorEventLoop(_Releasing(self._lock))
        self._late: dict[Any, tuple[float, bool]] = {}
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

        async def start() -> Any:  # noqa: ANN401 - of websockets
            how = {"origins": origins, "compression": None, "max_size": _BUFFER, "logger": _LOG}
            return await server.serve(self._serve, host, port, **how)

        try:
            self._server = asyncio.run_coroutine_threadsafe(start(), self._loop).result()
        except OSError as error:
            self._end()
            raise VoodooError(f"{address}: expected a free address of this machine, found: {error.strerror}") from error
        self.port: int = self._server.sockets[0].getsockname()[1]

    def publish(self, step: Step) -> None:
        """See Output."""
        with self._lock:
            if connections := self._server.connections:
                frame = self._frames.Frame(self._frames.Opcode.TEXT, message_of(step, self._root()))
                self._put(connections, frame.serialize(mask=False))  # once for all

    def _run(self) -> None:
        with self._lock:
            self._loop.run_forever()

    def _put(self, connections: Iterable[Any], frame: bytes) -> None:
        """Send to all who took what they were sent before."""
        now = time.monotonic()
        for connection in connections:
            since, named = self._late.pop(connection, (now, False))
            transport = connection.transport
            if transport.get_write_buffer_size():
                if not named and now - since > LATE_S:
                    self._on_message(f"{self._who(connection)} {HANGS}")
                    named = True
                self._late[connection] = since, named
                continue
            if named:
                self._on_message(f"{self._who(connection)} takes poses again")
            transport.write(frame)
            if transport.get_write_buffer_size() or transport.is_closing():
                self._loop.call_soon_threadsafe(bool)  # the loop has more to do

    async def _serve(self, connection: Any) -> None:  # noqa: ANN401 - of websockets
        """Wait until the receiver leaves; what it says is not heard."""
        connection.transport.get_extra_info("socket").setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _BUFFER)
        try:
            async for _ in connection:
                pass
        except self._left as left:
            if left.rcvd is None:
                self._on_message(f"{self._who(connection)} is gone")
        finally:
            self._late.pop(connection, None)

    def _who(self, connection: Any) -> str:  # noqa: ANN401 - of websockets
        return f"{self.name}: {connection.remote_address[0]}:{connection.remote_address[1]}"

    def close(self) -> None:
        """See Output."""
        with self._lock:
            self._server.close()
        with suppress(TimeoutError):  # a receiver that does not answer
            asyncio.run_coroutine_threadsafe(self._server.wait_closed(), self._loop).result(_CLOSE_S)
        self._end()

    def _end(self) -> None:
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(_CLOSE_S)


def message_of(step: Step, root_frame: str) -> bytes:
    """The message of a step as JSON, see docs/how-to/stream.md."""
    people = posed_people(step, root_frame)
    numbers = [] if people.layout is None else [people.rows[:, people.layout.text]]
    text = _format(people.frame, tuple(people.estimates), people.layout)
    return _core.people_text(text, numbers, step.stamp, list(people.estimates.values()))


_WRITTEN = {
    "\0word": '"\1"', "\0value": "\1", "\0place": "[\0e-5, \0e-5, \0e-5]", "\0turn": "[\2e-6, \2e-6, \2e-6, \2e-6]",
}  # fmt: skip
"""Values of a message, and how they are formatted; names cannot begin like them. Whole numbers of 10 um and of 1e-6 are written
several times as fast as others."""


@lru_cache(maxsize=16)
def _format(frame: str, numbers: tuple[int, ...], layout: Layout | None) -> bytes:
    """A message in which only values are missing, which `people_text` fills in."""
    limbs, joint_names = (layout.limbs, layout.joints) if layout else ((), ())
    bones = {
        name: {"parent": None if above is None else limbs[above][0], "position": "\0place", "rotation": "\0turn"}
        for name, above in limbs
    }
    person = {"status": "\0word", "residual_m": "\0value", "joints": dict.fromkeys(joint_names, "\0place")}
    person |= {"bones": bones, "limb_status": dict.fromkeys((name for name, _ in limbs), "\0word")}
    people = [{"id": number, **person} for number in numbers]
    whole = {"format": FORMAT, "version": VERSION, "stamp_s": "\0value", "frame": frame, "people": people}
    text = json.dumps(whole)
    for value, written in _WRITTEN.items():
        text = text.replace(json.dumps(value), written)
    return text.encode()
