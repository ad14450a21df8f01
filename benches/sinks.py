"""What live sinks cost: processor time of a frame of four people without and with all, and how late poses are beside receivers
that hang.

    python benches/sinks.py [--seconds 4] [--rounds 3]

On one core; receivers are processes of the last one, and take everything but the markers of ROS 2. Sessions with and without
sinks take turns. A sink whose library is missing is named.
"""

from __future__ import annotations

import argparse
import gc
import os
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

import voodoo
from voodoo.errors import VoodooError
from voodoo.live.follow import Follower, Step
from voodoo.live.session import Output, Session
from voodoo.live.sinks import sink_of
from voodoo.live.sources.played import PlayedSource
from voodoo.live.stream import Live
from voodoo.sensors.settings import FrontEndSettings

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from synthetic.gait import path
from synthetic.people import MadeUpRecording, Scene, Walker
from synthetic.stories import base_from_camera

OSC = "import socket as s; p = s.socket(type=s.SOCK_DGRAM); p.bind(('127.0.0.1', 39540))\nwhile p.recv(65536): pass"
ROS = """
from voodoo.live.ros2.dds import Node
node, heard = Node(), {}
while True:
    for topic, offer in node.offers().items():
        if topic not in heard and not topic.endswith("markers"):
            heard[topic] = node.subscribe(topic, offer)
    node.wait(0.2)
    for one in heard.values():
        one.take()
"""
CLIENT = """
import json, sys, websockets.sync.client as c
with c.connect(sys.argv[1], subprotocols=["foxglove.sdk.v1"] if sys.argv[2:] else None, max_size=None) as client:
    for message in client:
        if sys.argv[2:] and isinstance(message, str) and json.loads(message)["op"] == "advertise":
            wanted = [{"id": one["id"], "channelId": one["id"]} for one in json.loads(message)["channels"]]
            client.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))
"""


class Watched(Output):
    """Calls a function with every step; the output that it belongs to stays open."""

    receiver = True

    def __init__(self, name: str, call: Callable[[Step], object], *, prompt: bool = False, waits: bool = True) -> None:
        self.name, self.prompt, self.waits = name, prompt, waits
        self.publish = call  # type: ignore[method-assign,assignment]
        self.waiting = 1 if prompt or name != "steps" else 1000

    def publish(self, step: Step) -> None:
        """Replaced."""


def four_people(seconds: float) -> MadeUpRecording:
    places = ((2.6, -1.0), (2.6, 1.0), (3.4, -0.1), (4.3, 1.1))
    bodies = [voodoo.Body.human(1.65 + 0.06 * number) for number in range(4)]
    stops = [path([(0.0, x, y), (seconds, x + 0.3, y)]) for x, y in places]
    people = tuple(Walker(body=body, stops=way) for body, way in zip(bodies, stops, strict=True))
    walls = (((5.4, -4.0, 0.0), (5.6, 4.0, 3.0)),)
    view = {"root_from_sensor": lambda _: base_from_camera(), "rate_hz": 15.0, "seed": 1}
    return MadeUpRecording(Scene(name="four", people=people, seconds=seconds, furniture=walls, **view))  # type: ignore[arg-type]


def session(recording: MadeUpRecording, outputs: Sequence[Output], told: list[str]) -> Session:
    settings = FrontEndSettings(use=("depth",))
    with Live([PlayedSource(recording)], on_message=told.append) as live:
        made = Session(
            live,
            lambda _: Follower(people=lambda: voodoo.People(voodoo.Body.human()), settings=settings),
            outputs=outputs,
        )
        while made.wait(0.05):
            pass
        made.finish()
    return made


def cost(recording: MadeUpRecording, rounds: int) -> None:
    """Print the time of a frame without sinks and with all."""
    last = {(os.cpu_count() or 1) - 1}
    os.environ |= {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "ROS_DOMAIN_ID": "94"}
    receivers: list[subprocess.Popen[bytes]] = []

    def receive(code: str, *words: str) -> None:
        command = [sys.executable, "-c", code, *words]
        receivers.append(subprocess.Popen(command, preexec_fn=lambda: os.sched_setaffinity(0, last)))

    sinks: list[Output] = []
    for address in ("ros2://", "vmc://127.0.0.1:39540", "ws://:0", "foxglove://:0"):
        try:
            sink = sink_of(address, root_frame=lambda: "base_link", on_message=lambda words: None)
        except VoodooError as error:
            print(f"without {address}: {error}")
            continue
        sinks.append(sink)
        if hasattr(sink, "port"):
            receive(CLIENT, f"ws://127.0.0.1:{sink.port}", *["foxglove"] * address.startswith("fox"))
        else:
            receive(ROS if address == "ros2://" else OSC)
    time.sleep(2.0)
    os.sched_setaffinity(0, {0})
    tracked: dict[bool, list[float]] = {False: [], True: []}
    used: dict[bool, list[float]] = {False: [], True: []}
    for turn in range(2 * rounds):
        on = turn % 4 in (1, 2)
        steps, at = list[Step](), list[float]()
        taken = Watched("steps", lambda step, steps=steps, at=at: (steps.append(step), at.append(time.process_time())))
        beside = [Watched(one.name, one.publish, prompt=one.prompt, waits=one.waits) for one in sinks if on]
        report = session(recording, [taken, *beside], []).report()
        first = len(steps) // 3  # everybody is found
        used[on].append(1e3 * (at[-1] - at[first]) / (len(steps) - first - 1))
        tracked[on] += [1e3 * step.seconds for step in steps[first:]]
        if on:
            print(f"{len(steps[-1].estimates)} people; poses missed: {report['late_outputs']}")
    for on, times in used.items():
        # A quarter of the frames had the core for themselves, whatever else the machine does.
        track = np.percentile(tracked[on], 25)
        print(
            f"{'with all' if on else 'without'}: tracking {track:.2f} ms a frame; all threads {np.median(times):.2f} ms"
        )
    more = 100.0 * (np.array(used[True]) / used[False] - 1.0)
    low, middle, high = np.percentile(more, [25, 50, 75])
    print(f"processor time of pairs of sessions: {middle:+.1f} % in the median, quartiles {low:+.1f} and {high:+.1f} %")
    for receiver in receivers:
        receiver.kill()


def hangs(step: Step) -> None:
    time.sleep(1.5 if step.frame.number == 8 else 0.0)


def dies(step: Step) -> None:
    if 8 <= step.frame.number < 20:
        raise ConnectionResetError(104, "Connection reset by peer")


def lateness(recording: MadeUpRecording, rounds: int) -> None:
    """Print how much later poses are beside receivers that hang, die and return: of each frame the least of all rounds."""
    late: dict[bool, dict[float, float]] = {True: {}, False: {}}
    for number in range(2 * rounds):
        bad, told, found = number % 2 == 0, list[str](), late[number % 2 == 0]

        def keep(step: Step, found: dict[float, float] = found) -> None:
            found[step.stamp] = min(found.get(step.stamp, np.inf), time.time() - step.frame.taken)

        beside = [Watched("hangs", hangs), Watched("dies", dies)] if bad else []
        session(recording, [Watched("prompt", keep, prompt=True), *beside], told)
        if told:
            print("; ".join(told))
    more = 1e3 * np.array([late[True][stamp] - late[False][stamp] for stamp in late[True].keys() & late[False].keys()])
    print(f"beside receivers that hang and die {np.median(more):+.2f} ms in the median, {more.max():+.2f} ms at most")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=4.0)
    parser.add_argument("--rounds", type=int, default=3)
    arguments = parser.parse_args()
    sys.setswitchinterval(5e-4)  # as `voodoo live` does, and freezing below
    recording = four_people(arguments.seconds)
    gc.collect()
    gc.freeze()
    lateness(recording, arguments.rounds)
    cost(recording, arguments.rounds)


if __name__ == "__main__":
    main()
