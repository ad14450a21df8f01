"""What live sinks cost: time a frame of four people with every sink on, and how late frames are beside receivers that hang.

    python benches/sinks.py [--frames 60] [--rounds 3]

On one core; the receivers are processes of another one, if there is one. Sessions with and without sinks take turns, so that
both are measured in one run. Sinks whose library is missing are named.
"""

from __future__ import annotations

import argparse
import os
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from itertools import islice

import numpy as np

import voodoo
from voodoo.errors import VoodooError
from voodoo.live.assembly import LiveFrame
from voodoo.live.clock import HostClock
from voodoo.live.follow import Follower, Step
from voodoo.live.session import Output, Session
from voodoo.live.sinks import sink_of
from voodoo.live.source import Arrival, Source, SourceEnded
from voodoo.live.stream import Live
from voodoo.measurements import DepthImage
from voodoo.sensors.settings import FrontEndSettings
from voodoo.synthetic.gait import path
from voodoo.synthetic.people import MadeUpRecording, Scene, Walker
from voodoo.synthetic.stories import base_from_camera

RATE = 15.0
_CLIENT = "import sys, websockets.sync.client as c\nfor _ in c.connect(sys.argv[1], max_size=None): pass"
_OSC = """
import socket, sys
place = socket.socket(type=socket.SOCK_DGRAM)
place.bind(("127.0.0.1", int(sys.argv[1])))
while place.recv(65536):
    pass
"""


def four_people(seconds: float) -> list[LiveFrame]:
    """Frames of four people who stand and walk."""
    places = ((2.6, -1.0), (2.6, 1.0), (3.4, -0.1), (4.3, 1.1))
    walkers = tuple(
        Walker(body=voodoo.Body.human(1.65 + 0.06 * k), stops=path([(0.0, x, y), (seconds, x + 0.3, y)]))
        for k, (x, y) in enumerate(places)
    )
    scene = Scene(
        name="four",
        people=walkers,
        seconds=seconds,
        furniture=(((5.4, -4.0, 0.0), (5.6, 4.0, 3.0)),),
        root_from_sensor=lambda _: base_from_camera(),
        rate_hz=RATE,
        seed=1,
    )
    return [LiveFrame(one.stamp, one.measurements, k, 0.0, 0.0, False) for k, one in enumerate(MadeUpRecording(scene))]


def sinks() -> tuple[list[Output], list[subprocess.Popen[bytes]]]:
    """All live sinks with a receiver each."""
    outputs: list[Output] = []
    receivers = []
    with socket.socket(type=socket.SOCK_DGRAM) as place:
        place.bind(("127.0.0.1", 0))
        port = place.getsockname()[1]
    receivers.append(subprocess.Popen([sys.executable, "-c", _OSC, str(port)], preexec_fn=elsewhere))
    for address in ("ros2://", f"vmc://127.0.0.1:{port}", "ws://:0", "foxglove://:0"):
        try:
            outputs.append(sink_of(address, root_frame=lambda: "base_link"))
        except VoodooError as error:
            print(f"without {address}: {error}")
            continue
        if address.startswith(("ws", "foxglove")):
            code = _CLIENT if address.startswith("ws") else FOXGLOVE
            words = [sys.executable, "-c", code, f"ws://127.0.0.1:{outputs[-1].port}"]  # type: ignore[attr-defined]
            receivers.append(subprocess.Popen(words, preexec_fn=elsewhere))
    time.sleep(2.0)
    return outputs, receivers


FOXGLOVE = """
import json, sys, websockets.sync.client as c
with c.connect(sys.argv[1], subprotocols=["foxglove.sdk.v1"], max_size=None) as client:
    for message in client:
        if isinstance(message, str) and json.loads(message)["op"] == "advertise":
            channels = json.loads(message)["channels"]
            wanted = [{"id": one["id"], "channelId": one["id"]} for one in channels]
            client.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))
"""


def elsewhere() -> None:
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0)) if os.cpu_count() == 1 else (os.cpu_count() or 1) - 1})


def cost(frames: Sequence[LiveFrame], rounds: int) -> None:
    """Print the time of a frame with and without sinks."""
    outputs, receivers = sinks()
    os.sched_setaffinity(0, {0})
    tracked: dict[bool, list[float]] = {True: [], False: []}
    used: dict[bool, list[float]] = {True: [], False: []}
    persons = 0
    try:
        for number in range(2 * rounds):
            on = number % 2 == 0
            with Live([Paced(frames, RATE)], on_message=lambda words: None) as live:
                began, steps = time.process_time(), Steps()
                lent = [Lent(output) for output in outputs] if on else []
                session = Session(live, lambda _: follower(), outputs=[steps, *lent])
                while session.wait(0.2):
                    pass
                session.finish()
                used[on].append((time.process_time() - began) / len(steps.seconds))
            tracked[on] += steps.seconds[len(steps.seconds) // 3 :]  # everybody is found
            persons = max(persons, *steps.persons)
            if on:
                late = [f"{one.name} {lane.box.dropped}" for lane in session._lanes for one in lane.outputs]
    finally:
        for receiver in receivers:
            receiver.kill()
        for output in outputs:
            output.close()
    # A quarter of the frames had the core for themselves, whatever else the machine does.
    without, with_ = (1e3 * float(np.percentile(tracked[on], 25)) for on in (False, True))
    less, more = (1e3 * float(np.median(used[on])) for on in (False, True))
    print(f"{persons} people at {RATE:.0f} Hz on one core, all sinks on; missed poses: {', '.join(late)}")
    print(f"tracking a frame: {without:.2f} ms without, {with_:.2f} ms with: {100 * (with_ / without - 1):+.1f} %")
    print(
        f"all work for a frame (CPU of the process): {less:.2f} ms without, {more:.2f} ms with: +{more - less:.2f} ms"
    )


def follower() -> Follower:
    return Follower(people=lambda: voodoo.People(voodoo.Body.human()), settings=FrontEndSettings(use=("depth",)))


class Steps(Output):
    """Notes how long tracking took."""

    name, waiting = "steps", 1000

    def __init__(self) -> None:
        self.seconds: list[float] = []
        self.persons: list[int] = []

    def publish(self, step: Step) -> None:
        self.seconds.append(step.seconds)
        self.persons.append(sum(bool(one.joints) for one in step.estimates.values()))


class Lent(Output):
    """An output that stays open after the session."""

    def __init__(self, output: Output) -> None:
        self.name, self.prompt, self.receiver = output.name, output.prompt, output.receiver
        self.publish = output.publish  # type: ignore[method-assign]

    def publish(self, step: Step) -> None:
        """Of the output."""


class Paced(Source):
    """Hands frames over at their rate."""

    name, root_frame, stays = "paced", "base_link", False

    def __init__(self, frames: Sequence[LiveFrame], rate: float) -> None:
        self.items = [next(item for item in one.measurements if isinstance(item, DepthImage)) for one in frames]
        self.period, self.number = 1.0 / rate, 0

    def open(self, clock: HostClock, faults: object) -> None:
        self.clock, self.began = clock, clock.now()

    def read(self, timeout: float) -> list[Arrival]:
        if self.number >= len(self.items):
            raise SourceEnded("end")
        due = self.began + self.number * self.period
        time.sleep(min(max(due - self.clock.now(), 0.0), timeout))
        if self.clock.now() < due:
            return []
        item = self.items[self.number]
        self.number += 1
        return [Arrival("depth", "depth", item.stamp, lambda: item, drives=True, taken=due)]

    def close(self) -> None:
        pass


class Receiver(Output):
    """Notes when it gets a pose; hangs, or fails, between two frames."""

    receiver = True

    def __init__(self, name: str, *, prompt: bool = False, hangs: range = range(0), fails: range = range(0)) -> None:
        self.name, self.prompt, self.hangs, self.fails = name, prompt, hangs, fails
        self.late: dict[float, float] = {}
        self.go = threading.Event()

    def publish(self, step: Step) -> None:
        number = step.frame.number
        self.late[step.stamp] = time.time() - step.frame.taken
        if number in self.hangs:
            self.go.wait(2.0)
        if number in self.fails:
            raise ConnectionResetError(104, "Connection reset by peer")


def lateness(frames: Sequence[LiveFrame], rounds: int) -> None:
    """Print how much later poses are beside receivers that hang, die and return: of each frame the least of all rounds."""
    late: dict[bool, dict[float, list[float]]] = {True: {}, False: {}}
    for number in range(2 * rounds):
        bad = number % 2 == 0
        told: list[str] = []
        prompt = Receiver("prompt", prompt=True)
        beside = [Receiver("hangs", hangs=range(8, 12)), Receiver("dies", fails=range(8, 20))] if bad else []
        with Live([Paced(frames, RATE)], on_message=told.append) as live:
            session = Session(live, lambda _: follower(), outputs=[prompt, *beside])
            while session.wait(0.05):
                pass
            session.finish()
        for stamp, seconds in prompt.late.items():
            late[bad].setdefault(stamp, []).append(seconds)
        if bad:
            print("; ".join(told))
    more = 1e3 * np.array([min(late[True][stamp]) - min(late[False][stamp]) for stamp in sorted(late[True])])
    print(
        f"beside receivers that hang and die, later by {np.median(more):+.2f} ms in the median, at most {more.max():+.2f} ms"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--frames", type=int, default=60)
    parser.add_argument("--rounds", type=int, default=3)
    arguments = parser.parse_args()
    frames = list(islice(four_people(arguments.frames / RATE), arguments.frames))
    lateness(frames, arguments.rounds)
    cost(frames, arguments.rounds)


if __name__ == "__main__":
    main()
