"""Poses for the app Foxglove, by its own WebSocket server."""

from __future__ import annotations

from collections.abc import Callable

from voodoo.errors import VoodooError
from voodoo.export.foxglove import Channels, library
from voodoo.live.follow import Step
from voodoo.live.session import Output
from voodoo.live.sinks import parts_of
from voodoo.live.sinks.people import posed_people

PORT = 8766
"""Foxglove's own default is that of `ws://`."""
_WAITING = 16
"""Messages that wait for a viewer; the oldest are dropped for one that is slow."""


class FoxgloveSink(Output):
    """A server with the topics of `voodoo.export.foxglove`. It drops messages for a slow viewer, which is not named.

    Args:
        address: foxglove://[HOST][:PORT]; without a host only this machine can connect.
        root_frame: see `Sink`.
        on_message: see `Sink`.

    Raises:
        VoodooError: an address that is in use or not of this machine, or foxglove-sdk is not installed.
    """

    receiver, waits = True, False

    def __init__(self, address: str, *, root_frame: Callable[[], str], on_message: Callable[[str], None]) -> None:
        """Start the server."""
        self.name, self._root = address, root_frame
        foxglove = library(address)
        host, port, _ = parts_of(address, host="127.0.0.1", port=PORT)
        context = foxglove.Context()
        self._channels = Channels(foxglove, context)
        try:
            self._server = foxglove.start_server(
                name="voodoo", host=host, port=port, context=context, message_backlog_size=_WAITING
            )
        except Exception as error:
            raise VoodooError(f"{address}: expected a free address of this machine, found: {error}") from error
        self.port: int = self._server.port

    def publish(self, step: Step) -> None:
        """See Output."""
        if not self._channels.are_subscribed:
            return
        people = posed_people(step, self._root())
        about = [] if people.layout is None else [people.layout.shapes] * len(people.there)
        self._channels.log(step.stamp, people.ids, about, [people.rows_there], people.frame)

    def close(self) -> None:
        """See Output."""
        self._server.stop()
