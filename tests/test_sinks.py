"""Live poses to receivers of others on this machine: VMC by python-osc's server, JSON by clients of websockets."""

import importlib.util
import json
import re
import socket
import threading
import time
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import voodoo
import voodoo._core as _core
from browser import needs_chromium, told_by
from commands import run
from live_rig import ByHand
from test_doors import track_of
from voodoo.errors import VoodooError
from voodoo.export.skeleton import skeleton
from voodoo.export.track import Track
from voodoo.live import Live
from voodoo.live.assembly import LiveFrame
from voodoo.live.follow import Step
from voodoo.live.session import Output, Session
from voodoo.live.sinks import register, sink_of
from voodoo.pipeline.front_end import nobody
from voodoo.recordings import sample_path

PAGE = Path(__file__).parents[1] / "docs" / "how-to" / "stream.md"
pythonosc = pytest.importorskip("pythonosc", reason="pip install python-osc, of the extra stream")
websockets = pytest.importorskip("websockets.sync.client", reason="pip install websockets, of the extra stream")


def step_of(track, body, index=0, *, number=1, status="tracking", stamp=None):
    """A step whose only person has the pose of a frame of a track."""
    stamp = float(track.stamps[index]) if stamp is None else stamp
    poses = [(pose[:3, 3].tolist(), Rotation.from_matrix(pose[:3, :3])) for pose in track.world_from_limb[index]]
    known = {
        "status": status.title(),
        "mean_squared_distance": float("nan") if status == "lost" else 1e-4,
        "sites": track.joints[index].tolist(),
        "world_from_limb": [{"translation": place, "rotation": turn.as_quat().tolist()} for place, turn in poses],
        "limb_status": ["Measured"] * len(poses),
    }
    plain, *_ = nobody(stamp).__reduce__()[1]
    estimate = _core._estimate(plain | known, track.limb_names, track.joint_names, body.limb_joints, [])
    return Step(LiveFrame(stamp, (), 0, 0.0, 0.0, False), {number: estimate}, {number: body}, 0.0)


def posed(body, turned, *, heading=0.0):
    """A track of one frame: bones at rest, but those in `turned`, by rotation vectors in the frame of the body."""
    local = {name: Rotation.from_rotvec([turned.get(name, (0, 0, 0))]).as_matrix() for name in body.limb_names}
    local[body.limb_names[0]] = Rotation.from_euler("z", [[heading]]).as_matrix()
    return track_of(body, local)


T_POSE = {"l_upperarm": (np.pi / 2, 0, 0), "r_upperarm": (-np.pi / 2, 0, 0)}


@pytest.fixture
def receiver():
    """A server of python-osc, and what it received: a list of (address, values) by datagram order."""
    from pythonosc.dispatcher import Dispatcher
    from pythonosc.osc_server import ThreadingOSCUDPServer

    found, dispatcher = [], Dispatcher()
    dispatcher.set_default_handler(lambda address, *values: found.append((address, values)))
    server = ThreadingOSCUDPServer(("127.0.0.1", 0), dispatcher)
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    yield SimpleNamespace(port=server.server_address[1], found=found)
    server.shutdown()
    server.server_close()


def until(condition, seconds=5.0):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "nothing happened"
        time.sleep(0.005)


def opened(address, messages=None, root="base_link"):
    return sink_of(address, root_frame=lambda: root, on_message=(messages if messages is not None else []).append)


def vmc_bones(receiver, step):
    receiver.found.clear()
    sink = opened(f"vmc://127.0.0.1:{receiver.port}")
    sink.publish(step)
    until(lambda: len(receiver.found) >= 21)
    sink.close()
    assert ("/VMC/Ext/OK", (1,)) in receiver.found
    return {values[0]: values[1:] for address, values in receiver.found if address == "/VMC/Ext/Bone/Pos"}


def test_vmc_of_a_t_pose_is_the_identity_and_hanging_arms_are_turned_down(receiver):
    body = voodoo.Body.human()
    found = vmc_bones(receiver, step_of(posed(body, T_POSE), body))
    assert len(found) == 18 and {"Hips", "Spine", "LeftShoulder", "RightLowerArm", "LeftFoot"} <= found.keys()
    for name, values in found.items():
        assert abs(values[6]) == pytest.approx(1.0, abs=1e-5), name  # w of the quaternion
    # Unity: X right, Y up, Z forward; in T-pose the left arm is to the left of the body.
    assert found["LeftLowerArm"][0] < -0.2 and found["RightLowerArm"][0] > 0.2
    assert found["Head"][1] > 0.0 and found["LeftLowerLeg"][1] < -0.3
    found = vmc_bones(receiver, step_of(posed(body, {}), body))
    down = Rotation.from_quat(found["LeftUpperArm"][3:]).apply([-1.0, 0.0, 0.0])
    np.testing.assert_allclose(down, [0.0, -1.0, 0.0], atol=1e-5)
    # Quarter turn to the left, and a knee bent: about Y and X of Unity, whose rotations are left-handed.
    found = vmc_bones(receiver, step_of(posed(body, {"l_calf": (0, 1.0, 0)}, heading=np.pi / 2), body))
    np.testing.assert_allclose(Rotation.from_quat(found["Hips"][3:]).as_rotvec(), [0, -np.pi / 2, 0], atol=1e-5)
    np.testing.assert_allclose(Rotation.from_quat(found["LeftLowerLeg"][3:]).as_rotvec(), [1.0, 0, 0], atol=1e-5)


def test_vmc_tells_that_nobody_is_there_and_refuses_what_is_no_human(receiver):
    body = voodoo.Body.human()
    sink = opened(f"vmc://127.0.0.1:{receiver.port}")
    sink.publish(step_of(posed(body, {}), body, status="lost"))
    until(lambda: len(receiver.found) >= 2)
    assert ("/VMC/Ext/OK", (0,)) in receiver.found and len(receiver.found) == 2
    robot = voodoo.Body.from_toml(re.sub(r"\bl_thigh\b", "left leg", body.to_toml()))
    with pytest.raises(
        VoodooError, match=r"vmc://.*expected the body of a human, with the limbs l_thigh, found .*left leg"
    ):
        sink.publish(step_of(posed(robot, {}), robot))
    sink.close()


class Paced:
    """Live frames of one pose that a test hands to a session, which tracks nothing."""

    def __init__(self, outputs, body):
        self.messages, self.count, self.track, self.body = [], 0, posed(body, {}), body
        self.live = Live([ByHand()], on_message=self.messages.append)
        self.live.__enter__()
        self.session = Session(self.live, lambda frame: self, outputs=outputs)

    def step(self, frame):  # as of a Follower
        return replace(step_of(self.track, self.body, stamp=frame.stamp), frame=frame)

    def send(self, count, every=0.01):
        """Hand frames over; those the session tracked."""
        for _ in range(count):
            before, self.count = self.session.tracking.count, self.count + 1
            self.live._frames.put(LiveFrame(float(self.count), (), self.count, time.time(), time.time(), False))
            until(lambda before=before: self.session.tracking.count > before)
            self.session.wait(every)

    def finish(self):
        self.session.finish()
        self.live.close()


def test_a_dead_receiver_of_vmc_is_named_once_and_receives_when_it_is_back(monkeypatch):
    monkeypatch.setattr("voodoo.live.session._BACK_S", 0.1)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as place:
        place.bind(("127.0.0.1", 0))
        port = place.getsockname()[1]
    rig = Paced([opened(f"vmc://127.0.0.1:{port}")], voodoo.Body.human())
    rig.send(10)
    assert rig.messages == [f"vmc://127.0.0.1:{port}: nobody receives: Connection refused"]
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as place:
        place.bind(("127.0.0.1", port))
        rig.send(10, every=0.03)
        assert place.recv(65536).startswith(b"#bundle\0")
    assert rig.messages[1:] == [f"vmc://127.0.0.1:{port}: receives again"]
    rig.finish()


def test_sinks_that_never_wait_share_a_thread_and_messages_are_encoded_once(monkeypatch):
    class Threaded(Output):
        def __init__(self, name, waits):
            self.name, self.waits, self.threads, self.count = name, waits, set(), 0

        def publish(self, step):
            self.threads.add(threading.get_ident())
            self.count += 1

    made = [Threaded("a", False), Threaded("b", False), Threaded("c", True), Threaded("d", True)]
    rig = Paced(made, voodoo.Body.human())
    rig.send(3)
    until(lambda: all(one.count for one in made))
    rig.finish()
    (a,), (b,), (c,), (d,) = (one.threads for one in made)
    assert a == b and len({a, c, d}) == 3
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as place:
        place.bind(("127.0.0.1", 0))
        vmc = opened(f"vmc://127.0.0.1:{place.getsockname()[1]}")
        server = opened("ws://:0")
        assert not vmc.waits and not server.waits
        encoded, encode = [], vmc._bundle
        monkeypatch.setattr(vmc, "_bundle", lambda messages: encoded.append(len(messages)) or encode(messages))
        body = voodoo.Body.human()
        track, datagrams = track_of(body), []
        for index in range(4):
            vmc.publish(step_of(track, body, index))
            datagrams.append([place.recv(65536) for _ in encoded])
        assert len(encoded) == len(datagrams[0]) == 2 and datagrams[0] != datagrams[3]
        vmc.close()
        server.close()


class Fake(Output):
    """A receiver that hangs while `free` is not set, and fails while `dead`."""

    receiver = True

    def __init__(self, name, *, waits=True):
        self.name, self.waits = name, waits
        self.free, self.dead, self.stamps, self.closed = threading.Event(), False, [], False
        self.free.set()

    def publish(self, step):
        self.free.wait()
        if self.dead:
            raise ConnectionResetError(104, "Connection reset by peer")
        self.stamps.append(step.stamp)

    def close(self):
        self.closed = True


def test_receivers_that_hang_die_and_return_hold_nobody_and_are_named_once(monkeypatch):
    monkeypatch.setattr("voodoo.live.session.LATE_S", 0.1)
    monkeypatch.setattr("voodoo.live.session._BACK_S", 0.05)
    monkeypatch.setattr("voodoo.live.session._CLOSE_S", 0.2)
    good, hangs, dies, swift = Fake("good"), Fake("hangs"), Fake("dies"), Fake("swift", waits=False)
    rig = Paced([good, hangs, dies, swift], voodoo.Body.human())
    rig.send(3)
    hangs.free.clear()
    swift.free.clear()
    dies.dead = True
    rig.send(20)
    until(lambda: good.stamps[-1] == 23.0)
    assert rig.session.tracking.count == 23 and len(good.stamps) >= 20  # all were tracked, whoever hangs
    assert sorted(rig.messages) == [
        "dies: nobody receives: Connection reset by peer",
        "hangs: takes nothing; it gets the newest pose when it does",
        "swift: takes nothing; it gets the newest pose when it does",
    ]
    dies.dead = False
    hangs.free.set()
    swift.free.set()
    until(lambda: hangs.stamps[-1] == swift.stamps[-1] == 23.0)  # the newest; it had 4.0 in its hands
    assert len([stamp for stamp in hangs.stamps if 4.0 < stamp < 23.0]) == 0
    rig.send(10)
    assert sorted(rig.messages[3:]) == [f"{name}: receives again" for name in ("dies", "hangs", "swift")]
    hangs.free.clear()
    rig.send(1, every=0.0)
    began = time.monotonic()
    rig.finish()  # neither for ever nor with an error
    assert time.monotonic() - began < 1.0 and good.closed and dies.closed and swift.closed
    assert rig.messages[6:] == ["hangs: did not take the last pose"]
    hangs.free.set()


class Timed(Output):
    """Notes how late poses are."""

    name, waits = "timed", False

    def __init__(self):
        self.late = {}

    def publish(self, step):
        self.late[step.stamp] = time.time() - step.frame.taken


class Lent(Output):
    """A sink that stays open after a session."""

    receiver = True

    def __init__(self, sink):
        self.name, self.sink, self.waits = sink.name, sink, sink.waits

    def publish(self, step):
        self.sink.publish(step)


def test_no_pose_is_late_beside_programs_that_hang_and_hosts_that_are_dead():
    """Of each frame the earliest of up to 40 rounds: a machine with other work is late at random, a sink is always."""
    body, messages = voodoo.Body.human(), []
    track = track_of(body)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as place:
        place.bind(("127.0.0.1", 0))
        dead = f"vmc://127.0.0.1:{place.getsockname()[1]}"
    servers = [opened("ws://:0", messages)]
    if importlib.util.find_spec("foxglove"):
        servers.append(opened("foxglove://:0", messages))
    with ExitStack() as clients:
        for server in servers:
            small = socket.create_connection(("127.0.0.1", server.port))
            small.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            protocols = ["foxglove.sdk.v1"] if server.name.startswith("foxglove") else None
            how = {"sock": small, "subprotocols": protocols, "max_queue": 1, "max_size": None}
            client = clients.enter_context(websockets.connect("ws://127.0.0.1", **how))
            clients.callback(small.shutdown, socket.SHUT_RDWR)
            told = {"channels": ()}
            while protocols and not told.get("channels"):
                text = client.recv(timeout=5)
                told = json.loads(text) if isinstance(text, str) else {}
            wanted = [{"id": one["id"], "channelId": one["id"]} for one in told["channels"]]
            client.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))
            until(lambda server=server: getattr(getattr(server, "_channels", server), "are_subscribed", True))
        until(lambda: servers[0]._server.connections)
        for number in range(200):  # nothing more goes through
            for server in servers:
                server.publish(step_of(track, body, stamp=float(number)))
        until(lambda: servers[0]._late)
        rounds = []
        worst = np.inf
        while len(rounds) < 8 or (worst >= 0.005 and len(rounds) < 40):
            timed = Timed()
            rig = Paced([timed, *map(Lent, (opened(dead), *servers))], body)
            rig.send(20)
            rig.finish()
            rounds.append(timed.late)
            assert [words for words in rig.messages if not words.startswith("timed")] == [
                f"{dead}: nobody receives: Connection refused"
            ]
            worst = max(min(late.get(stamp, np.inf) for late in rounds) for stamp in rounds[0])
    assert worst < 0.005, f"{1e3 * worst:.1f} ms"
    for server in servers:
        server.close()


def test_what_is_no_receiver_ends_the_session_with_its_error():
    disk = Fake("disk")
    disk.receiver, disk.dead = False, True
    rig = Paced([disk], voodoo.Body.human())
    with pytest.raises(ConnectionResetError):
        rig.send(50)
    with pytest.raises(ConnectionResetError):
        rig.finish()
    rig.live.close()


def shape_of(value):
    """Keys and types, without the names of joints, bones and limbs."""
    if isinstance(value, dict):
        named = all(isinstance(each, dict | list) for each in value.values()) or {"l_hand"} & value.keys()
        return (
            {"NAME": shape_of(next(iter(value.values())))}
            if named
            else {key: shape_of(each) for key, each in value.items()}
        )
    return [shape_of(value[0])] if isinstance(value, list) else type(value).__name__


def heard(client, sink, step):
    """The next message; a receiver gets none of before it came."""
    for _ in range(100):
        sink.publish(step)
        try:
            return json.loads(client.recv(timeout=0.05))
        except TimeoutError:
            pass
    raise AssertionError("nothing was sent")


def test_websocket_sends_what_the_page_describes():
    body = voodoo.Body.human()
    track = track_of(body)
    sink = opened("ws://:0", root="camera_depth_optical_frame")
    with websockets.connect(f"ws://127.0.0.1:{sink.port}") as client:
        message = heard(client, sink, step_of(track, body, 5, number=3))
        lost = heard(client, sink, step_of(track, body, 6, status="lost"))
        while lost["stamp_s"] == message["stamp_s"]:
            lost = json.loads(client.recv(timeout=5))
        assert lost["people"][0]["residual_m"] is None
    sink.close()
    assert message["frame"] == "camera_depth_optical_frame_upright" and message["stamp_s"] == track.stamps[5]
    (person,) = message["people"]
    assert person["id"] == 3
    turn = np.array([[0, 0, 1], [-1, 0, 0], [0, -1, 0]])
    expected = skeleton(track, body)
    for index, bone in enumerate(expected.bones):
        found = person["bones"][bone.name]
        assert found["parent"] == (None if bone.parent is None else expected.bones[bone.parent].name)
        np.testing.assert_allclose(found["position"], turn @ expected.heads[5, index], atol=1e-5)
        np.testing.assert_allclose(
            Rotation.from_quat(found["rotation"]).as_matrix(), turn @ expected.rotations[5, index], atol=1e-5
        )
    (example,) = re.findall(r"```javascript\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.S)
    assert shape_of(json.loads(example)) == shape_of(message)


def test_a_receiver_that_hangs_holds_nobody_up_and_gets_the_newest_when_it_wakes(monkeypatch):
    monkeypatch.setattr("voodoo.live.sinks.websocket.LATE_S", 0.2)
    body, messages, slowest = voodoo.Body.human(), [], 0.0
    track = track_of(body)
    sink = opened("ws://:0", messages)
    address = f"ws://127.0.0.1:{sink.port}"
    small = socket.create_connection(("127.0.0.1", sink.port))
    small.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 32768)
    with websockets.connect(address) as good, websockets.connect(address, sock=small, max_queue=1) as hung:
        until(lambda: len(sink._server.connections) == 2)
        received = []
        reader = threading.Thread(
            target=lambda: received.extend(json.loads(text)["stamp_s"] for text in good), daemon=True
        )
        reader.start()
        count = 0
        while not messages or count < 100:
            step = step_of(track, body, 0, stamp=float(count))
            began = time.perf_counter()
            sink.publish(step)
            slowest = max(slowest, time.perf_counter() - began)
            count += 1
            time.sleep(0.005)
            assert count < 2000, "the receiver that hangs was not named"
        assert re.fullmatch(
            r"ws://:0: 127\.0\.0\.1:\d+ takes nothing; it gets the newest pose when it does", messages[0]
        )
        assert len(messages) == 1 and slowest < 0.05
        until(lambda: received and received[-1] == count - 1)
        for number in range(count, count + 400):  # it wakes
            sink.publish(step_of(track, body, 0, stamp=float(number)))
            latest = json.loads(hung.recv(timeout=5))["stamp_s"]
            if latest > count:
                break
        assert latest > count
        until(lambda: len(messages) == 2)
        assert messages[1].endswith("takes poses again")
        small.shutdown(socket.SHUT_RDWR)  # it dies
        until(lambda: len(messages) == 3)
        assert messages[2].endswith("is gone")
    sink.close()
    reader.join(5)


@needs_chromium
def test_a_page_in_a_browser_receives_poses(tmp_path):
    """The script of the page of the documentation, which reports what it logs to the server it came from."""
    (script,) = re.findall(r"```html\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.S)
    log = "<script>console.log = (...words) => fetch('/', {method: 'POST', body: JSON.stringify(words)})</script>"
    body = voodoo.Body.human()
    step = step_of(track_of(body), body, number=7)
    sink = opened("ws://:0")
    page = log + script.replace(":8765", f":{sink.port}")
    (number, status, wrist), console = told_by(page, tmp_path, meanwhile=lambda: sink.publish(step))
    sink.close()
    assert (number, status) == (7, "tracking") and not console
    assert wrist == pytest.approx(step.estimates[7].joints["l_wrist"], abs=1e-5)


def test_pages_of_others_may_not_connect():
    sink = opened("ws://:0?origin=https://robot.example")
    address = f"ws://127.0.0.1:{sink.port}"
    for origin in (None, "http://localhost:8000", "http://127.0.0.1", "https://robot.example"):
        with websockets.connect(address, origin=origin):
            pass
    from websockets.exceptions import InvalidStatus

    for origin in ("https://other.example", "null", "http://localhost.other.example"):
        with pytest.raises(InvalidStatus, match="403"):
            websockets.connect(address, origin=origin)
    sink.close()


def test_addresses_that_are_no_use_are_named(tmp_path):
    sink = opened("ws://127.0.0.1:0")
    taken = f"ws://127.0.0.1:{sink.port}"
    for address, words in {
        "http://127.0.0.1": r"expected an address that begins with .*vmc://, ws://, found 'http://127\.0\.0\.1'",
        "pose.csv": "expected an address that begins with",
        "vmc://": r"vmc://: expected SCHEME://HOST:PORT",
        "vmc://my host": r"vmc://my host: expected SCHEME://HOST:PORT",
        "vmc://127.0.0.1:99999": r"expected SCHEME://HOST:PORT, found: Port out of range",
        "ws://a..b": r"ws://a\.\.b: expected SCHEME://HOST:PORT, found: .*label empty",
        "vmc://no-such-host.invalid": "expected the name or address of a host",
        "ws://203.0.113.7:8000": "expected a free address of this machine",
        taken: "expected a free address of this machine",
    }.items():
        with pytest.raises(VoodooError, match=words):
            opened(address)
    done = run("live", sample_path(), "--to", taken, "--out", tmp_path / "pose.csv")
    assert done.exit_code == 1 and taken in done.stderr and not list(tmp_path.iterdir())
    sink.close()
    with pytest.raises(VoodooError, match="expected a new one"):
        register("vmc", lambda: None)


def test_live_sends_to_several_receivers_at_once(tmp_path, receiver):
    report = tmp_path / "report.json"
    done = run(
        "live", sample_path(), "--use", "depth", "--rate", 4, "--to", f"vmc://127.0.0.1:{receiver.port}", "--to", "ws://:0",
        "--out", tmp_path / "pose.npz", "--report", report,
    )  # fmt: skip
    assert done.exit_code == 0, done.stderr
    hips = [values for address, values in receiver.found if address == "/VMC/Ext/Bone/Pos" and values[0] == "Hips"]
    told = json.loads(report.read_text())
    late = told["late_outputs"][f"vmc://127.0.0.1:{receiver.port}"]
    assert told["late_outputs"].keys() >= {"ws://:0"}
    assert 20 < len(hips) <= told["processed"] - late
    track = Track.load(tmp_path / "pose.npz")
    forward, left, up = track.joints[track.found][-1, track.joint_names.index("humanoid_root")]
    np.testing.assert_allclose(hips[-1][1:4], (-left, up, forward), atol=0.12)  # between hips and pelvis
