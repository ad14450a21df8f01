"""A message on /voodoo/follow chooses the person: at a place in a frame that is known."""

from dataclasses import replace

import numpy as np
import pytest

import voodoo
from made_up import two_people
from test_live_ros import FakeNode
from voodoo.export.ros2 import STORE, cdr
from voodoo.live import Follower, Live, Step
from voodoo.live.assembly import LiveFrame
from voodoo.live.session import Output, Session
from voodoo.live.sinks.ros2 import FOLLOW, Ros2Sink
from voodoo.live.sources.played import PlayedSource
from voodoo.measurements import DepthImage
from voodoo.pipeline.front_end import nobody
from voodoo.sensors.settings import FrontEndSettings

SETTINGS = FrontEndSettings(use=("depth",))


@pytest.fixture(scope="module")
def recording():
    return two_people()


@pytest.fixture(scope="module")
def frames(recording):
    return [LiveFrame(one.stamp, one.measurements, index, 0.0, 0.0, False) for index, one in enumerate(recording)]


def roots(recording, index):
    return recording.people.of("humanoid_root")[index]


def message(frame, place):
    stamp = STORE.types["builtin_interfaces/msg/Time"](sec=0, nanosec=0)
    header = STORE.types["std_msgs/msg/Header"](stamp=stamp, frame_id=frame)
    point = STORE.types["geometry_msgs/msg/Point"](*map(float, place))
    return cdr(STORE.types["geometry_msgs/msg/PointStamped"](header=header, point=point))


def off(recording, index, estimate):
    return np.linalg.norm(roots(recording, index) - estimate.joints["humanoid_root"], axis=1)


@pytest.mark.parametrize("chosen", [0, 1])
def test_one_of_several_is_followed_alone(recording, frames, chosen):
    follower = Follower(people=voodoo.People, settings=SETTINGS)
    for frame in frames[16:24]:
        step = follower.step(frame)
    assert len(step.people) == 2
    head = roots(recording, 24)[chosen] + (0.0, 0.0, 0.6)
    assert follower.choose(frames[24], head).endswith("only")
    for index in range(24, 28):
        (one,) = follower.step(frames[index]).estimates.values()
        assert int(np.argmin(off(recording, index, one))) == chosen
    for nowhere in ([50.0, 0.0, 0.0], [np.nan] * 3):
        with pytest.raises(voodoo.VoodooError, match=r"expected somebody within 1 m of .* found nobody"):
            follower.choose(frames[28], np.array(nowhere))
    assert len(follower.step(frames[28]).people) == 1, "nothing has changed"
    follower.restart(back=True, gone=True)
    assert [len(follower.step(frame).people) for frame in frames[29:]][-1] == 2, "a reset forgets the choice"


@pytest.mark.parametrize("chosen", [0, 1])
def test_a_single_person_is_the_one_at_the_place(recording, frames, chosen):
    follower = Follower(voodoo.Tracker(voodoo.Body.human()), settings=SETTINGS)
    for frame in frames[16:22]:
        follower.step(frame)
    follower.choose(frames[22], roots(recording, 22)[chosen])
    away = []
    for index in range(22, 32):
        (one,) = follower.step(frames[index]).estimates.values()
        away.append(off(recording, index, one))
    assert (np.argmin(away, axis=1) == chosen).all() and np.min(away, axis=1).max() < 0.2
    # Who leaves is not waited for.
    last = next(item for item in frames[31].measurements if isinstance(item, DepthImage))
    for number in range(1, 41):
        stamp, empty = last.stamp + 0.1 * number, np.full(last.image.shape, 4600 + number % 2, np.uint16)
        item = replace(last, stamp=stamp, image=empty)
        (one,) = follower.step(LiveFrame(stamp, (item,), 32 + number, 0.0, 0.0, False)).estimates.values()
    assert not one.joints


def test_a_message_chooses_the_person(recording, monkeypatch):
    node, asked, said = FakeNode(), [], []
    output = Ros2Sink(root_frame=lambda: "base_link", node=node, on_message=said.append)
    output.on_choice = lambda *choice: asked.append(choice)
    node.heard[FOLLOW] = [b"damage", message("odom", (1.0, 2.0, 3.0))]
    step = Step(LiveFrame(2.0, (), 1, 0.0, 0.0, False), {1: nobody(2.0)}, {1: voodoo.Body.human()}, 0.0)
    output.publish(step)
    output.publish(step)
    ((frame, place),) = asked
    assert frame == "odom" and place.tolist() == [1.0, 2.0, 3.0]
    assert len(said) == 1 and said[0].startswith(
        "ros2: /voodoo/follow: expected a geometry_msgs/msg/PointStamped message"
    )
    # and the session follows whoever is there, in a frame 1 m in front of the root frame
    ahead = np.eye(4)
    ahead[0, 3] = 1.0
    monkeypatch.setattr(PlayedSource, "root_from", lambda self, frame, stamp: ahead if frame == "ahead" else None)
    messages, shown = [], []

    class Asks(Output):
        waiting = 100

        def publish(self, step):
            shown.append(len(step.people))
            if len(shown) == 24:
                self.on_choice("nowhere", np.zeros(3))
            if len(shown) == 27:
                self.on_choice("ahead", roots(recording, 27)[1] - (1.0, 0.0, 0.0))

    with Live([PlayedSource(recording, rate=2.0)], on_message=messages.append) as live:
        session = Session(live, lambda _: Follower(people=voodoo.People, settings=SETTINGS), outputs=[Asks()])
        while session.wait(0.05):
            pass
        session.finish()
    said = [words for words in messages if words.startswith("follow: ")]
    assert "expected a frame that is known, found 'nowhere'" in said[0] and said[1].endswith("only")
    assert shown[23:26] == [2, 2, 2] and shown[-1] == 1
