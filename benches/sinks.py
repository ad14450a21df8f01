"""What live sinks cost: processor time of a frame of four people without and with all, and how late poses are beside receivers
that hang.

    python benches/sinks.py [--seconds 4] [--rounds 24]

On one core; receivers are processes of the last one, and take everything but what ROS 2 makes on demand, markers and 2-D
skeletons. Sessions with and without sinks take turns. Of the processor time of all threads from one frame to the next, the
least of all sessions counts, when the rest of the machine was quiet. A sink whose library is missing is named.
"""

from __future__ import annotations

import argparse
import gc
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

import voodoo
from voodoo.errors import VoodooError
from voodoo.live.follow import Follower, Step
from voodoo.live.session import Output, Session
from voodoo.live.sinks import sink_of
from voodoo.live.sources.played import PlayedSource
from voodoo.live.stream import Live
from voodoo.measurements import ColorImage, Measurement, RecordedFrame
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
        if topic not in heard and not topic.endswith(("markers", "skeleton2d")):
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


def painted(item: Measurement) -> Measurement:
    """The measurement; a color image, of which a live source makes copies that decode it anew, has been painted."""
    if not isinstance(item, ColorImage):
        return item
    image = item.image
    return replace(item, decode=lambda: image)


class Kept(MadeUpRecording):
    """Images are painted once, as a camera's driver would take no time for them from the tracker.

    Attributes:
        used: processor time of all threads [s] when each frame was read.
    """

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene)
        self._kept, self.used = list[RecordedFrame](), list[float]()
        for frame in super().__iter__():
            self._kept.append(replace(frame, measurements=tuple(map(painted, frame.measurements))))

    def __iter__(self) -> Iterator[RecordedFrame]:
        self.used = []
        for frame in self._kept:
            self.used.append(time.process_time())
            yield frame


class Watched(Output):
    """Calls a function with every step; the output that it belongs to stays open."""

    receiver = True

    def __init__(self, name: str, call: Callable[[Step], object], *, waits: bool = True) -> None:
        self.name, self.waits = name, waits
        self.publish = call  # type: ignore[method-assign,assignment]

    def publish(self, step: Step) -> None:
        """Replaced."""


def four_people(seconds: float) -> Kept:
    places = ((2.6, -1.0), (2.6, 1.0), (3.4, -0.1), (4.3, 1.1))
    bodies = [voodoo.Body.human(1.65 + 0.06 * number) for number in range(4)]
    stops = [path([(0.0, x, y), (seconds, x + 0.3, y)]) for x, y in places]
    people = tuple(Walker(body=body, stops=way) for body, way in zip(bodies, stops, strict=True))
    walls = (((5.4, -4.0, 0.0), (5.6, 4.0, 3.0)),)
    view = {"root_from_sensor": lambda _: base_from_camera(), "rate_hz": 15.0, "seed": 1}
    return Kept(Scene(name="four", people=people, seconds=seconds, furniture=walls, **view))  # type: ignore[arg-type]


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


def cost(recording: MadeUpRecording, rounds: int, receivers: list[subprocess.Popen[bytes]]) -> None:
    """Print the time of a frame without sinks and with all; the receivers that it starts, which never end, are added."""
    last = {(os.cpu_count() or 1) - 1}
    os.environ |= {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "ROS_DOMAIN_ID": "94"}

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
    collected()
    for thread in Path("/proc/self/task").iterdir():
        os.sched_setaffinity(int(thread.name), {0})
    used: dict[bool, list[np.ndarray]] = {False: [], True: []}
    for turn in range(2 * rounds):
        on = turn % 4 in (1, 2)
        made = session(recording, [Watched(one.name, one.publish, waits=one.waits) for one in sinks if on], [])
        dropped = made.report()["dropped"]
        if dropped or len(made.persons()) < 4:  # a frame that is not tracked would be the least
            print(f"{len(made.persons())} people; {dropped} frames dropped: left out")
            continue
        used[on].append(1e3 * np.diff(recording.used)[len(recording.used) // 3 :])  # everybody is found
    for on, side in ((False, "without sinks"), (True, "with all sinks")):
        if not used[on]:
            raise SystemExit(f"{side}: expected a session that finds four people and drops no frame, found none")
    without, with_all = (np.min(used[on], axis=0) for on in (False, True))
    more = with_all - without
    print(
        f"without {without.mean():.2f} ms a frame, with all {with_all.mean():.2f} ms: {more.mean():+.2f} ms, "
        f"{100.0 * more.mean() / without.mean():+.1f} %"
    )
    for name, of in (("lower quartile", 25), ("median", 50)):
        low, high = (np.percentile([each.mean() for each in used[on]], of) for on in (False, True))
        print(f"{name} of whole sessions: {low:.2f} and {high:.2f} ms, {100.0 * (high / low - 1.0):+.1f} %")


def collected() -> None:
    """Collect garbage, and what is left never again, as `voodoo live` does when its outputs are open."""
    gc.collect()
    gc.freeze()


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
        session(recording, [Watched("swift", keep, waits=False), *beside], told)
        if told:
            print("; ".join(told))
    more = 1e3 * np.array([late[True][stamp] - late[False][stamp] for stamp in late[True].keys() & late[False].keys()])
    print(f"beside receivers that hang and die {np.median(more):+.2f} ms in the median, {more.max():+.2f} ms at most")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=4.0)
    parser.add_argument("--rounds", type=int, default=24)
    arguments = parser.parse_args()
    sys.setswitchinterval(5e-4)  # as `voodoo live` does
    recording = four_people(arguments.seconds)
    collected()
    lateness(recording, min(arguments.rounds, 5))
    receivers: list[subprocess.Popen[bytes]] = []
    try:
        cost(recording, arguments.rounds, receivers)
    finally:
        for receiver in receivers:
            receiver.kill()


if __name__ == "__main__":
    main()
