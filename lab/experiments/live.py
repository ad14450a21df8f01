"""Latency, drops and memory of `voodoo live`.

    python lab/experiments/live.py realsense [--rate 90]      a device of software, 640x480 (needs pyrealsense2)
    python lab/experiments/live.py overload [--seconds 60]    four times as many images as can be tracked
    python lab/experiments/live.py ros2 --peer PYTHON         depth from a node by rclpy, skeletons back (needs cyclonedds)
    python lab/experiments/live.py robot                      the same from a robot with odometry of 50 Hz, by voodoo's own node
    python lab/experiments/live.py faults                     frames from good data to the right pose, for every kind of fault

Prints JSON. Memory is that of the process that tracks, after ten seconds and at the end. The person is rendered, the noise is
4 mm. On a busy machine `chrt -f 10` before the command keeps others away.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

import voodoo
from voodoo.live import Arrival, Follower, Live, Source
from voodoo.live.session import Session
from voodoo.measurements import DepthImage

PEERS = Path(__file__).resolve().parents[2] / "tests" / "peers"
sys.path.insert(0, str(PEERS))
from live_camera import CAMERA, SoftwareCamera, pictures  # noqa: E402

SETTLED_S = 10.0


def memory_mb(process: int | str = "self") -> float:
    """What a process holds in memory [MB]."""
    rows = Path(f"/proc/{process}/status").read_text(encoding="ascii").splitlines()
    return next(int(row.split()[1]) / 1024 for row in rows if row.startswith("VmRSS"))


def follower(_frame: object) -> Follower:
    return Follower(voodoo.Tracker(voodoo.Body.human()))


class TooFast(Source):
    """Hands over images at a rate, however late the tracker is."""

    name, root_frame, stays = "too fast", "camera", False

    def __init__(self, rate: float, images: list[np.ndarray]) -> None:
        self.period, self.images, self.number = 1.0 / rate, images, 0

    def open(self, clock, faults):
        self.clock, self.due = clock, clock.now()

    def read(self, timeout):
        time.sleep(min(max(self.due - self.clock.now(), 0.0), timeout))
        self.due += self.period
        self.number += 1
        # Noise that costs nothing: the same picture shifted by a column.
        image = np.roll(self.images[self.number % len(self.images)], self.number % 3, axis=1)
        stamp = self.clock.now()
        item = DepthImage("depth", stamp, image, 0.001, CAMERA, np.eye(4))
        return [Arrival("depth", "depth", stamp, lambda: item, drives=True)]

    def close(self):
        pass


def observed(session: Session, seconds: float) -> dict[str, object]:
    """Let a session run; its report, with memory."""
    began, settled = time.monotonic(), None
    while session.wait(0.2) and time.monotonic() - began < seconds:
        if settled is None and time.monotonic() - began > min(SETTLED_S, seconds / 2):
            settled = memory_mb()
    ended = memory_mb()
    session.finish()
    return displayed(session.report()) | {"memory_mb": [round(settled or ended, 1), round(ended, 1)]}


def displayed(report: dict[str, object]) -> dict[str, object]:
    names = ("rate_hz", "latency_ms", "tracking_ms", "received", "published", "dropped", "refused", "faults")
    return {name: report[name] for name in names}


def realsense(rate: float, seconds: float) -> dict[str, object]:
    from voodoo.live.sources.realsense import RealSenseSource

    camera = SoftwareCamera(rate)
    with Live([RealSenseSource(device=camera.device, rate=int(rate))]) as live:
        session = Session(live, follower)
        with camera:
            return observed(session, seconds)


def overload(seconds: float) -> dict[str, object]:
    images = pictures()
    with Live([TooFast(30.0, images)]) as live:
        session = Session(live, follower)
        usual = observed(session, 5.0)
    rate = 4.0 / (1e-3 * usual["tracking_ms"]["p50"])
    with Live([TooFast(rate, images)]) as live:
        return {"source_hz": rate} | observed(Session(live, follower), seconds)


def ros2(command: list[str], words: list[str], rate: float, seconds: float) -> dict[str, object]:
    folder = Path(os.environ.get("TMPDIR", "/tmp"))
    images, report = folder / "voodoo-bench-images.npz", folder / "voodoo-bench-report.json"
    k = np.array([CAMERA.fx, 0, CAMERA.cx, 0, CAMERA.fy, CAMERA.cy, 0, 0, 1.0])
    np.savez(images, images=np.array(pictures()), k=k)
    here = {**os.environ, "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "ROS_DOMAIN_ID": "93"}
    code = "import sys; from voodoo.cli import main; sys.argv[0] = 'voodoo'; main()"
    words = ["live", "ros2:/camera/depth/image_raw", *words, "--report", str(report)]
    options = {"--rate": rate, "--count": round(rate * seconds)}
    command = [*command, str(images), *(str(word) for option in options.items() for word in option)]
    running = [subprocess.Popen([sys.executable, "-c", code, *words], env=here)]
    try:
        time.sleep(4.0)
        running.append(subprocess.Popen(command, env=here, stdout=subprocess.PIPE, text=True))
        ours, theirs = running
        time.sleep(min(60.0, seconds / 2))
        settled = memory_mb(ours.pid)
        printed = theirs.communicate()[0]
        if theirs.returncode:
            raise SystemExit(f"{command[0]}: expected to end with 0, found {theirs.returncode}")
        ended = memory_mb(ours.pid)
    finally:
        for process in running:
            process.terminate()
            process.wait()
    answer = json.loads(printed)
    latency = 1e3 * np.array([seconds for _, seconds in answer["states"]])
    tenth = max(len(latency) // 10, 1)
    return displayed(json.loads(report.read_text(encoding="utf-8"))) | {
        "sent": len(answer["sent"]),
        "skeletons_back": len(answer["states"]),
        "end_to_end_ms": {"p50": float(np.percentile(latency, 50)), "p99": float(np.percentile(latency, 99))},
        "median_ms_of_first_and_last_tenth": [float(np.median(part)) for part in (latency[:tenth], latency[-tenth:])],
        "memory_mb": [round(settled, 1), round(ended, 1)],
    }


def faults() -> dict[str, int]:
    """Images of good data (30 a second) until the pose is right and stays so: the faults of tests/test_live_faults.py."""
    sys.path.insert(0, str(PEERS.parent))
    from test_live_faults import FAULTY, RIGHT_M, Bus, error

    found = {}
    for name, fault in FAULTY.items():
        bus = Bus()
        bus.good(15)
        fault(bus)
        begun, before = bus.at, len(bus.rig.steps)
        bus.good(min(40, 89 - bus.at))
        images = {round(bus.images[number].stamp + bus.shift, 6): bus.images[number].stamp for number in range(bus.at)}
        right = {}
        for step in bus.rig.steps[before:]:
            one = step.estimates[1]
            stamp = images[round(step.stamp, 6)]
            right[stamp] = bool(one.joints) and str(one.status) != "lost" and error(one, stamp) < RIGHT_M
        stamps = [bus.images[number].stamp for number in range(begun, bus.at)]
        wrong = [number for number, stamp in enumerate(stamps, 1) if not right.get(stamp, False)]
        found[name] = max(wrong, default=0) + 1
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("realsense", "overload", "ros2", "robot", "faults"))
    parser.add_argument("--rate", type=float, default=30.0)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--peer", help="a Python with rclpy")
    parser.add_argument(
        "--queue", type=int, default=10, help="images that wait in the peer, see tests/peers/ros_peer.py"
    )
    chosen = parser.parse_args()
    sys.setswitchinterval(5e-4)
    if chosen.what == "realsense":
        found = realsense(chosen.rate, chosen.seconds)
    elif chosen.what == "faults":
        found = faults()
    elif chosen.what == "overload":
        found = overload(chosen.seconds)
    else:
        peer = [chosen.peer or sys.executable]
        if chosen.what == "robot":
            command, words = [*peer, str(PEERS / "ros_robot.py")], ["--frame", "odom"]
        else:
            # Its own libraries, not voodoo's.
            without = ["env", "-u", "PYTHONPATH", *peer]
            command, words = [*without, str(PEERS / "ros_peer.py"), "--queue", str(chosen.queue)], []
        found = ros2(command, words, chosen.rate, chosen.seconds)
    print(json.dumps(found, indent=2))


if __name__ == "__main__":
    main()
