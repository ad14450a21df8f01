"""The registered schemes of addresses that `voodoo live --to` sends poses to."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module

from voodoo.errors import VoodooError
from voodoo.live.session import Output
from voodoo.live.sinks.address import Sink

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
