"""Virtual Motion Capture protocol (VMC): bones of a VRM avatar over OSC and UDP.

The messages are those of a performer, https://protocol.vmc.info/english: /VMC/Ext/OK, /T, /Root/Pos and /Bone/Pos, with the
axes of Unity (X right, Y up, Z forward, left-handed).
"""

from __future__ import annotations

import socket
from collections.abc import Callable
from contextlib import suppress

import numpy as np

from voodoo.errors import VoodooError
from voodoo.export.conventions import NAMES, names_of
from voodoo.export.skeleton import FloatArray, Skeleton
from voodoo.live.follow import Step
from voodoo.live.session import Output
from voodoo.live.sinks.address import parts_of
from voodoo.live.sinks.people import upright_person
from voodoo.model.rotations import matrix_of_turn, quaternions

PORT = 39539
_UNITY: FloatArray = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
"""(X, Y, Z) of Unity from (x forward, y left, z up); left-handed."""
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
        try:
            from pythonosc import osc_bundle_builder, osc_message_builder
        except ImportError:
            advice = "pip install 'voodoo-tracker[stream]'"
            raise VoodooError(f"{address}: expected python-osc, found none; {advice}") from None
        self._bundle_of, self._message_of = osc_bundle_builder.OscBundleBuilder, osc_message_builder.OscMessageBuilder
        self.name, self.receiver = address, True
        self._root = root_frame
        host, port, _ = parts_of(address, host=None, port=PORT)
        try:
            family, kind, protocol, _, place = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
            self._socket = socket.socket(family, kind, protocol)
            self._socket.setblocking(False)
            self._socket.connect(place)
        except OSError as error:
            raise VoodooError(f"{address}: expected the name or address of a host, found: {error.strerror}") from error
        self._start: float | None = None

    def publish(self, step: Step) -> None:
        """See Output.

        Raises:
            VoodooError: a body without the bones of an avatar.
            OSError: nobody receives.
        """
        self._start = step.stamp if self._start is None else self._start
        shown = sorted(number for number, one in step.estimates.items() if one.joints and str(one.status) != "lost")
        messages: list[tuple[str | float, ...]] = [("/OK", int(bool(shown))), ("/T", step.stamp - self._start)]
        if shown:
            messages.append(("/Root/Pos", "root", *(0.0,) * 6, 1.0))
            _, posed = upright_person(step, shown[0], self._root())
            messages += [("/Bone/Pos", *row) for row in bones_of(posed, self.name)]
        for first in range(0, len(messages), _TOGETHER):
            self._send(self._bundle(messages[first : first + _TOGETHER]))

    def _bundle(self, messages: list[tuple[str | float, ...]]) -> bytes:
        bundle = self._bundle_of(0)
        for path, *values in messages:
            message = self._message_of(f"/VMC/Ext{path}")
            for value in values:
                message.add_arg(value)
            bundle.add_content(message.build())
        return bytes(bundle.build().dgram)

    def _send(self, datagram: bytes) -> None:
        with suppress(BlockingIOError):
            self._socket.send(datagram)

    def close(self) -> None:
        """See Output."""
        self._socket.close()


def bones_of(posed: Skeleton, address: str) -> list[tuple[str | float, ...]]:
    """Rows of /VMC/Ext/Bone/Pos: name, position on the parent (3) [m], rotation relative to it (4) as x, y, z, w.

    Rotations of an avatar in T-pose that looks along the x axis of the world are the identity.

    Args:
        posed: one frame, z up.
        address: named in the error.

    Raises:
        VoodooError: the body lacks bones without which an avatar does not move.
    """
    parts = posed.bones
    quarter = {"l": matrix_of_turn((-_TURN, 0.0, 0.0)), "r": matrix_of_turn((_TURN, 0.0, 0.0))}
    arms = [
        quarter.get(bone.name[0], np.eye(3)) if bone.name.partition("_")[2] in _ARM else np.eye(3) for bone in parts
    ]
    turns = posed.rotations[0] @ np.array(arms)
    above = np.array([np.eye(3) if bone.parent is None else turns[bone.parent] for bone in parts]).transpose(0, 2, 1)
    origins = np.array([np.zeros(3) if bone.parent is None else posed.heads[0, bone.parent] for bone in parts])
    local = quaternions(_UNITY @ above @ turns @ _UNITY.T).tolist()
    places = (_UNITY @ above @ (posed.heads[0] - origins)[..., None])[..., 0].tolist()
    names = [names_of(bone.name).vrm for bone in parts]
    rows = {name: (name, *place, *turn) for name, place, turn in zip(names, places, local, strict=True) if name}
    if missing := [name for name in _NEEDED if name not in rows]:
        limbs = [limb for limb, names in NAMES.items() if names.vrm in missing and limb != "torso"]
        raise VoodooError(
            f"{address}: expected the body of a human, with the limbs {', '.join(limbs)}, found "
            f"{', '.join(bone.name for bone in parts)}"
        )
    return list(rows.values())
