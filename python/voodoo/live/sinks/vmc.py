"""Virtual Motion Capture protocol (VMC): bones of a VRM avatar over OSC and UDP.

The messages are those of a performer, https://protocol.vmc.info/english: /VMC/Ext/OK, /T, /Root/Pos and /Bone/Pos, with the
axes of Unity (X right, Y up, Z forward, left-handed).
"""

from __future__ import annotations

import socket
from collections.abc import Callable
from contextlib import suppress
from functools import lru_cache

import numpy as np

import voodoo._core as _core
from voodoo.errors import VoodooError, installed, reading
from voodoo.export.conventions import NAMES, names_of
from voodoo.export.layout import Layout
from voodoo.export.template import template
from voodoo.live.follow import Step
from voodoo.live.session import Output
from voodoo.live.sinks import parts_of
from voodoo.live.sinks.people import posed_people
from voodoo.measurements import FloatArray

PORT = 39539
_NEEDED = ("Hips", "Head", *(f"{side}Upper{limb}" for side in ("Left", "Right") for limb in ("Arm", "Leg")))
_TOGETHER = 15
"""Messages a datagram: it fits into one packet of Ethernet."""


class VmcSink(Output):
    """Sends the tracked person with the lowest number.

    A lost person is not sent; /VMC/Ext/OK is 0 then. UDP does not wait: what a receiver does not take is lost.

    Args:
        address: vmc://HOST[:PORT].
        root_frame: see `Sink`.
        on_message: see `Sink`.

    Raises:
        VoodooError: no host, an unknown one, or python-osc is not installed.
    """

    def __init__(self, address: str, *, root_frame: Callable[[], str], on_message: Callable[[str], None]) -> None:
        """Find the host."""
        missing = f"{address}: expected python-osc, found none; pip install 'voodoo-tracker[stream]'"
        self._bundle_of = installed("pythonosc.osc_bundle_builder", missing).OscBundleBuilder
        self._message_of = installed("pythonosc.osc_message_builder", missing).build_msg
        self.name, self.receiver, self.waits = address, True, False
        self._root = root_frame
        host, port, _ = parts_of(address, host=None, port=PORT)
        with reading(address, "the name or address of a host", error=VoodooError):
            family, kind, protocol, _, place = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
            self._socket = socket.socket(family, kind, protocol)
            self._socket.setblocking(False)
            self._socket.connect(place)
        self._start: float | None = None
        self._template_of = lru_cache(2)(self._make_template)

    def publish(self, step: Step) -> None:
        """See Output.

        Raises:
            VoodooError: a body without the bones of an avatar.
            OSError: nobody receives.
        """
        self._start = step.stamp if self._start is None else self._start
        people, numbers = posed_people(step, self._root()), [np.array([step.stamp - self._start])]
        if people.there:
            numbers.append(people.rows_there[people.there.index(min(people.there))])
        for datagram in self._template_of(people.layout if people.there else None).filled(numbers, b""):
            with suppress(BlockingIOError):
                self._socket.send(datagram)

    def _make_template(self, layout: Layout | None) -> _core.Template:
        width = sum(layout.widths) if layout else 0
        return template(lambda numbers: self._datagrams(layout, numbers), 1 + width, single=True)

    def _datagrams(self, layout: Layout | None, numbers: FloatArray) -> list[bytes]:
        """Messages of the time and of the bones of a row that follows it."""
        messages: list[tuple[str | float, ...]] = [("/OK", int(layout is not None)), ("/T", float(numbers[0]))]
        if layout is not None:
            rows = layout.parts(numbers[1:])[-1][0].tolist()
            messages.append(("/Root/Pos", "root", *(0.0,) * 6, 1.0))
            messages += [("/Bone/Pos", name, *rows[limb]) for name, limb in _bones(layout, self.name).items()]
        return [self._bundle(messages[first : first + _TOGETHER]) for first in range(0, len(messages), _TOGETHER)]

    def _bundle(self, messages: list[tuple[str | float, ...]]) -> bytes:
        bundle = self._bundle_of(0)
        for path, *values in messages:
            bundle.add_content(self._message_of(f"/VMC/Ext{path}", values))
        return bytes(bundle.build().dgram)

    def close(self) -> None:
        """See Output."""
        self._socket.close()


def _bones(layout: Layout, address: str) -> dict[str, int]:
    """Names for /VMC/Ext/Bone/Pos, and the limb of each, whose rotation in T-pose along the x axis of the world is the identity.

    Args:
        layout: of the person.
        address: named in the error.

    Raises:
        VoodooError: the body lacks bones without which an avatar does not move.
    """
    rows = {names_of(limb).vrm: index for index, (limb, _) in enumerate(layout.limbs)}
    rows.pop("", None)
    if missing := [name for name in _NEEDED if name not in rows]:
        needed = [limb for limb, names in NAMES.items() if names.vrm in missing and limb != "torso"]
        raise VoodooError(
            f"{address}: expected the body of a human, with the limbs {', '.join(needed)}, found "
            f"{', '.join(limb for limb, _ in layout.limbs)}"
        )
    return rows
