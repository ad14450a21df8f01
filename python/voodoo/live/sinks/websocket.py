"""Poses as JSON over WebSocket, for browsers and any language; the messages are described in docs/how-to/stream.md."""

from __future__ import annotations

import asyncio
import json
import logging
import math
import re
import socket
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Any
from urllib.parse import parse_qs

from voodoo.errors import VoodooError
from voodoo.export.skeleton import Skeleton
from voodoo.export.track import Track
from voodoo.live.follow import Step
from voodoo.live.session import Output
from voodoo.live.sinks.address import parts_of
from voodoo.live.sinks.people import upright_frame, upright_person
from voodoo.model.rotations import quaternions

FORMAT, VERSION = "voodoo.people", 1
"""The version is increased if earlier readers would misread a message, not for additional keys."""
PORT = 8765
_OWN_PAGES = re.compile(r"https?://(localhost|127\.0\.0\.1|\[::1\])(:\d+)?")
_LATE_S = 1.0
"""A receiver that takes nothing for this long is named."""
_BUFFER = 2**16
"""Bytes that wait for a receiver in the system: a second of one person; more would be old when it is read."""
_CLOSE_S = 2.0
_LOG = logging.getLogger(__name__)
_LOG.addHandler(logging.NullHandler())  # what is no WebSocket client costs no traceback on the screen


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
        try:
            from websockets.asyncio.server import serve
            from websockets.exceptions import ConnectionClosed
        except ImportError:
            raise VoodooError(
                f"{address}: expected websockets, found none; pip install 'voodoo-tracker[stream]'"
            ) from None
        self.name, self.receiver = address, True
        self._root, self._on_message, self._left = root_frame, on_message, ConnectionClosed
        host, port, parts = parts_of(address, host="127.0.0.1", port=PORT)
        origins = [None, _OWN_PAGES, *parse_qs(parts.query).get("origin", ())]
        self._loop = asyncio.new_event_loop()
        self._newest: asyncio.Future[str] = self._loop.create_future()
        self._thread = threading.Thread(target=self._loop.run_forever, daemon=True)
        self._thread.start()

        async def start() -> Any:  # noqa: ANN401 - of websockets
            return await serve(
                self._serve, host, port, origins=origins, compression=None, max_size=_BUFFER, logger=_LOG
            )

        try:
            self._server = asyncio.run_coroutine_threadsafe(start(), self._loop).result()
        except OSError as error:
            self._end()
            raise VoodooError(f"{address}: expected a free address of this machine, found: {error.strerror}") from error
        self.port: int = self._server.sockets[0].getsockname()[1]

    def publish(self, step: Step) -> None:
        """See Output."""
        if self._server.connections:
            self._loop.call_soon_threadsafe(self._put, json.dumps(message_of(step, self._root()), allow_nan=False))

    def _put(self, text: str) -> None:
        self._newest.set_result(text)
        self._newest = self._loop.create_future()

    async def _serve(self, connection: Any) -> None:  # noqa: ANN401 - of websockets
        """Send until the receiver leaves; what it says is not heard."""
        connection.transport.get_extra_info("socket").setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _BUFFER)
        sender = asyncio.ensure_future(self._send_all(connection))
        try:
            async for _ in connection:
                pass
        except self._left as left:
            if left.rcvd is None:
                self._on_message(f"{self._who(connection)} is gone")
        finally:
            sender.cancel()

    async def _send_all(self, connection: Any) -> None:  # noqa: ANN401 - of websockets
        late = False
        with suppress(self._left):
            while True:
                sending = asyncio.ensure_future(connection.send(await asyncio.shield(self._newest)))
                done, _ = await asyncio.wait({sending}, timeout=_LATE_S)
                if not done and not late:
                    self._on_message(f"{self._who(connection)} takes nothing; it gets the newest pose when it does")
                await sending
                if late and done:
                    self._on_message(f"{self._who(connection)} takes poses again")
                late = not done

    def _who(self, connection: Any) -> str:  # noqa: ANN401 - of websockets
        return f"{self.name}: {connection.remote_address[0]}:{connection.remote_address[1]}"

    def close(self) -> None:
        """See Output."""
        self._server.close()
        with suppress(TimeoutError):  # a receiver that does not answer
            asyncio.run_coroutine_threadsafe(self._server.wait_closed(), self._loop).result(_CLOSE_S)
        self._end()

    def _end(self) -> None:
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(_CLOSE_S)


def message_of(step: Step, root_frame: str) -> dict[str, Any]:
    """The message of a step, see docs/how-to/stream.md."""
    return {
        "format": FORMAT,
        "version": VERSION,
        "stamp_s": step.stamp,
        "frame": upright_frame(step, root_frame),
        "people": [
            _person(number, *upright_person(step, number, root_frame))
            for number, estimate in step.estimates.items()
            if estimate.joints
        ],
    }


def _person(number: int, track: Track, posed: Skeleton) -> dict[str, Any]:
    residual = float(track.residual[0])
    turns = quaternions(posed.rotations[0]).round(6).tolist()
    bones = {
        bone.name: {
            "parent": None if bone.parent is None else posed.bones[bone.parent].name,
            "position": place,
            "rotation": turn,
        }
        for bone, place, turn in zip(posed.bones, posed.heads[0].round(5).tolist(), turns, strict=True)
    }
    return {
        "id": number,
        "status": track.status[0],
        "residual_m": residual if math.isfinite(residual) else None,
        "joints": dict(zip(track.joint_names, track.joints[0].round(5).tolist(), strict=True)),
        "bones": bones,
        "limb_status": {limb: words[0] for limb, words in track.limb_status.items()},
    }
