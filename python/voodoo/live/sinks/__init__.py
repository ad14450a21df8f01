"""Receivers of live poses by address: one file for each scheme."""

from voodoo.live.sinks.address import Sink
from voodoo.live.sinks.registry import register, sink_of

__all__ = ["Sink", "register", "sink_of"]
