"""Receivers of live poses by address, which `voodoo live --to` sends them to: one file for each scheme."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Protocol
from urllib.parse import SplitResult, urlsplit

from voodoo.errors import VoodooError
from voodoo.live.session import Output


class Sink(Protocol):
    """Makes the output of an address.

    Args:
        address: as it was given, e.g. "vmc://host:39539".
        root_frame: returns the frame of the poses, once a frame has arrived.
        on_message: called with a readable line when one of several receivers is late, gone, or back; from any thread.

    Raises:
        VoodooError: the address is of no use, or a library is missing; names both.
    """

    def __call__(self, address: str, *, root_frame: Callable[[], str], on_message: Callable[[str], None]) -> Output:
        """Open the output. It is a `receiver`: what holds `Output.publish` up, or an OSError of it, is named once."""


def parts_of(address: str, *, host: str | None, port: int) -> tuple[str, int, SplitResult]:
    """Host, port and all parts of an address.

    Args:
        address: SCHEME://[HOST][:PORT][?...].
        host: if the address has none; None: it must have one.
        port: if the address has none.

    Raises:
        VoodooError: no host, or no valid port.
    """
    try:
        parts = urlsplit(address)
        found, number = parts.hostname or host, port if parts.port is None else parts.port
        (found or "").encode("idna")  # as it will be looked up
    except ValueError as error:
        raise VoodooError(f"{address}: expected SCHEME://HOST:PORT, found: {error}") from None
    if not found or parts.path.strip("/") or " " in address:
        raise VoodooError(f"{address}: expected SCHEME://HOST:PORT, found another form")
    return found, number, parts


_sinks: dict[str, Callable[[], Sink]] = {
    "foxglove": lambda: import_module("voodoo.live.sinks.foxglove").FoxgloveSink,
    "ros2": lambda: import_module("voodoo.live.sinks.ros2").Ros2Sink,
    "vmc": lambda: import_module("voodoo.live.sinks.vmc").VmcSink,
    "ws": lambda: import_module("voodoo.live.sinks.websocket").WebSocketSink,
}


def register(scheme: str, find: Callable[[], Sink]) -> None:
    """Register a sink: `voodoo.live.sinks.register("udp", lambda: MySink)`.

    Args:
        scheme: begins the addresses, before "://".
        find: imports and returns the sink.

    Raises:
        VoodooError: the scheme has one already.
    """
    if scheme in _sinks:
        raise VoodooError(f"scheme {scheme!r}: expected a new one, found one that is registered")
    _sinks[scheme] = find


def sink_of(address: str, *, root_frame: Callable[[], str], on_message: Callable[[str], None] = print) -> Output:
    """The output of an address; see `Sink`.

    Raises:
        VoodooError: an unknown scheme, or as `Sink`.
    """
    scheme, separator, _ = address.partition("://")
    if scheme not in _sinks or not separator:
        known = ", ".join(f"{name}://" for name in sorted(_sinks))
        raise VoodooError(f"to: expected an address that begins with {known}, found {address!r}")
    return _sinks[scheme]()(address, root_frame=root_frame, on_message=on_message)
