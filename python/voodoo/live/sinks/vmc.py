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
import numpy.typing as npt

import voodoo._core as _core
from voodoo.errors import VoodooError, installed, reading
from voodoo.export.conventions import NAMES, names_of
from voodoo.export.skeleton import FloatArray, Skeleton
from voodoo.export.template import template
from voodoo.live.follow import Step
from voodoo.live.session import Output
from voodoo.live.sinks import parts_of
from voodoo.live.sinks.people import shown
from voodoo.model.rotations import matrix_of_turn

PORT = 39539
_AXES, _SIGNS = np.array([1, 2, 0, 4, 5, 3, 6]), np.array([-1.0, 1.0, 1.0, 1.0, -1.0, -1.0, 1.0])
"""Place X, Y, Z and rotation X, Y, Z, W of Unity, left-handed, from those with x forward, y left, z up."""
_TURN = np.pi / 2.0
"""At rest our arms hang; those of a VRM avatar point to the sides, a quarter turn about the forward axis."""
_ARM = ("upperarm", "forearm", "hand")
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
        people, numbers = shown(step, self._root()), np.empty(0)
        names: tuple[str, ...] = ()
        if people.present:
            first = min(people.present, key=people.numbers.__getitem__)
            names, numbers = bones_of(people.posed, first, self.name)
        for datagram in self._template_of(names).filled([np.array([step.stamp - self._start]), numbers], b""):
            with suppress(BlockingIOError):
                self._socket.send(datagram)

    def _make_template(self, names: tuple[str, ...]) -> _core.Template:
        return template(lambda numbers: self._datagrams(names, numbers), 1 + 7 * len(names), single=True)

    def _datagrams(self, names: tuple[str, ...], numbers: list[float]) -> list[bytes]:
        """Messages of the time and of bones, whose seven numbers each follow it."""
        messages: list[tuple[str | float, ...]] = [("/OK", int(bool(names))), ("/T", numbers[0])]
        messages += [("/Root/Pos", "root", *(0.0,) * 6, 1.0)] if names else []
        messages += [("/Bone/Pos", name, *numbers[7 * at + 1 : 7 * at + 8]) for at, name in enumerate(names)]
        return [self._bundle(messages[first : first + _TOGETHER]) for first in range(0, len(messages), _TOGETHER)]

    def _bundle(self, messages: list[tuple[str | float, ...]]) -> bytes:
        bundle = self._bundle_of(0)
        for path, *values in messages:
            bundle.add_content(self._message_of(f"/VMC/Ext{path}", values))
        return bytes(bundle.build().dgram)

    def close(self) -> None:
        """See Output."""
        self._socket.close()


def bones_of(posed: Skeleton, index: int, address: str) -> tuple[tuple[str, ...], FloatArray]:
    """Names for /VMC/Ext/Bone/Pos, and position on the parent (3) [m] and rotation relative to it (4) as x, y, z, w of each.

    Rotations of an avatar in T-pose that looks along the x axis of the world are the identity.

    Args:
        posed: with z up.
        index: of the frame.
        address: named in the error.

    Raises:
        VoodooError: the body lacks bones without which an avatar does not move.
    """
    chosen, names, plan, arms = _avatar(posed.body.limb_tree, address)
    _, rows = _core.placed((posed.rotations[index] @ arms)[None], posed.heads[index][None], plan)
    return names, rows.take(chosen) * _SIGNS


@lru_cache(maxsize=8)
def _avatar(
    limbs: tuple[tuple[str, int | None], ...], address: str
) -> tuple[npt.NDArray[np.int64], tuple[str, ...], npt.NDArray[np.int64], FloatArray]:
    """Of an avatar's bones the seven numbers among those of all limbs, and their names; of all limbs the plan of `placed` and the
    turns to its rest pose."""
    quarter = {"l": matrix_of_turn((-_TURN, 0.0, 0.0)), "r": matrix_of_turn((_TURN, 0.0, 0.0))}
    arms = [quarter.get(limb[0], np.eye(3)) if limb.partition("_")[2] in _ARM else np.eye(3) for limb, _ in limbs]
    rows = {names_of(limb).vrm: index for index, (limb, _) in enumerate(limbs)}
    rows.pop("", None)
    if missing := [name for name in _NEEDED if name not in rows]:
        needed = [limb for limb, names in NAMES.items() if names.vrm in missing and limb != "torso"]
        raise VoodooError(
            f"{address}: expected the body of a human, with the limbs {', '.join(needed)}, found "
            f"{', '.join(limb for limb, _ in limbs)}"
        )
    plan = [(index, index, index, -1 if up is None else up) for index, (_, up) in enumerate(limbs)]
    return 7 * np.array([[row] for row in rows.values()]) + _AXES, tuple(rows), np.array(plan), np.array(arms)
