"""ROS 2 messages of a live source, without a network: what they become, and what is published."""

import gc
import math
import re
import time
import weakref
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
import pytest

import voodoo
from live_rig import HandClock, Rig, depth_of, follower_of, wall
from voodoo.export.ros2 import IDS, STORE, TRACKED, cdr, header_at, instant, keypoints_message, new
from voodoo.export.upright import by_axes, by_floor
from voodoo.live import Faults, Live, Step
from voodoo.live.assembly import LiveFrame
from voodoo.live.recorder import _cloud, _depth, _scan, camera_info, transforms
from voodoo.live.ros2.dds import _LOOPBACK, Node, Offer, dds_name, domain_id, ros_name
from voodoo.live.ros2.feed import ROOT_PATIENCE_S, TF, RosFeed
from voodoo.live.session import Output, Session
from voodoo.live.sinks.ros2 import RESET, Ros2Sink
from voodoo.live.source import SourceGone
from voodoo.live.sources.played import PlayedSource
from voodoo.live.sources.ros2 import Ros2Source, listing
from voodoo.measurements import ColorImage, DepthImage, LaserScan, PointCloud
from voodoo.people import FORGET_AFTER_S
from voodoo.pipeline.floor import visible_floor
from voodoo.pipeline.front_end import nobody
from voodoo.pipeline.run import start_tracker, track
from voodoo.recordings import open_recording, sample_path
from voodoo.recordings.ros_topics import CAMERA_INFO, CLOUD, COMPRESSED, IMAGE, SCAN, info_topic
from voodoo.recordings.transforms import TransformTree

DEPTH, INFO = "/camera/depth/image_raw", "/camera/depth/camera_info"


def feed_of(*topics, messages=None, **options):
    clock = HandClock(1000.0)
    faults = Faults(messages.append if messages is not None else None)
    return RosFeed(topics or (DEPTH,), faults, clock, **options), clock, faults


def moved(x):
    pose = np.eye(4)
    pose[0, 3] = x
    return pose


def send(feed, topic, kind, message):
    return feed.take(topic, kind, cdr(message))


def depth_message(stamp, frame="camera"):
    return _depth(header_at(stamp, frame), wall(stamp))


def test_transforms_that_change_are_interpolated_and_waited_for():
    feed, _, _ = feed_of(root_frame="base_link")
    send(feed, INFO, CAMERA_INFO, camera_info(header_at(1.0, "camera"), wall(1.0).camera))
    for stamp, x in ((1.0, 0.0), (1.1, 0.1)):
        send(feed, "/tf", TF, transforms("base_link", "camera", stamp, moved(x)))
    (arrival,) = send(feed, DEPTH, IMAGE, depth_message(1.14))
    assert not arrival.ready()
    assert arrival.patience > 0.0
    assert arrival.measure().root_from_sensor[0, 3] == 0.1, "the latest, where no later one comes"
    send(feed, "/tf", TF, transforms("base_link", "camera", 1.2, moved(0.2)))
    assert arrival.ready()
    assert arrival.measure().root_from_sensor[0, 3] == pytest.approx(0.14)
    assert np.array_equal(arrival.measure().image, wall(1.14).image)


def test_old_transforms_are_forgotten_and_those_that_hold_are_not():
    feed, _, _ = feed_of(root_frame="base_link")
    send(feed, "/tf_static", TF, transforms("head", "camera", 0.0, moved(1.0)))
    for number in range(3000):
        send(feed, "/tf", TF, transforms("base_link", "head", 1.0 + 0.02 * number, moved(0.001 * number)))
    (edge, _) = feed._tree._neighbors["base_link"]["head"]
    assert len(edge.stamps) <= 10.0 / 0.02 + 1
    assert feed.root_from("camera", 60.98)[0, 3] == pytest.approx(1.0 + 2.999)


def test_constant_transforms_that_are_repeated_are_forgotten_but_for_the_last():
    tree = TransformTree("test", max_age=0.5)
    tree.add_edge("b", "c", 0.0, moved(2.0), static=True)
    for number in range(100):
        tree.add_edge("a", "b", float(number), moved(1.0), static=False)
        tree.keep(number - 10.0, math.inf)
    (edge, _) = tree._neighbors["a"]["b"]
    assert len(edge.stamps) == 11
    tree.keep(-10.0, -1.0)  # time jumped back
    assert tree.lookup("a", "c", 50.0)[0, 3] == 3.0 and edge.stamps == [-1.0]


def test_transforms_follow_time_that_jumps_back():
    feed, _, faults = feed_of(root_frame="base_link")
    send(feed, INFO, CAMERA_INFO, camera_info(header_at(1.0, "camera"), wall(1.0).camera))
    for stamp in (100.0, 100.1, 50.0, 50.1, 50.2):
        send(feed, "/tf", TF, transforms("base_link", "camera", stamp, moved(0.01 * (stamp - 50.0))))
    (arrival,) = send(feed, DEPTH, IMAGE, depth_message(50.15))
    assert arrival.ready()
    assert arrival.measure().root_from_sensor[0, 3] == pytest.approx(0.0015)
    assert faults.counts == {}


@pytest.mark.parametrize(
    ("frames", "root"),
    [
        (("odom", "base_link", "camera"), "odom"),
        (("map", "odom", "base_link", "camera"), "odom"),
        (("map", "base_link", "camera"), "map"),
        (("base_link", "camera"), "base_link"),
        (("world", "camera"), "world"),
    ],
    ids="-".join,
)
def test_the_root_is_where_people_stand_still(frames, root):
    feed, _, _ = feed_of()
    send(feed, INFO, CAMERA_INFO, camera_info(header_at(1.0, "camera"), wall(1.0).camera))
    assert send(feed, DEPTH, IMAGE, depth_message(1.0)) == [], "transforms may come"
    for parent, child in pairwise(frames):
        send(feed, "/tf_static", TF, transforms(parent, child, 0.0, moved(1.0)))
    (arrival,) = send(feed, DEPTH, IMAGE, depth_message(1.1))
    assert feed.root_frame == root
    assert arrival.measure().root_from_sensor[0, 3] == len(frames) - frames.index(root) - 1


def test_without_transforms_the_camera_is_the_root():
    feed, clock, _ = feed_of()
    send(feed, INFO, CAMERA_INFO, camera_info(header_at(1.0, "camera"), wall(1.0).camera))
    assert send(feed, DEPTH, IMAGE, depth_message(1.0)) == []
    clock.at += ROOT_PATIENCE_S
    (arrival,) = send(feed, DEPTH, IMAGE, depth_message(2.0))
    assert feed.root_frame == "camera"
    assert np.array_equal(arrival.measure().root_from_sensor, np.eye(4))
    # Where nobody publishes transforms, nobody is waited for.
    feed, _, _ = feed_of()
    feed.expects_transforms = False
    assert len(send(feed, DEPTH, IMAGE, depth_message(1.0))) == 1
    # And a calibration says where the camera is.
    feed, _, _ = feed_of(sensor_pose=("base_link", moved(3.0)))
    send(feed, INFO, CAMERA_INFO, camera_info(header_at(1.0, "camera"), wall(1.0).camera))
    (arrival,) = send(feed, DEPTH, IMAGE, depth_message(1.0))
    assert arrival.ready()
    assert (feed.root_frame, arrival.measure().root_from_sensor[0, 3]) == ("base_link", 3.0)


def test_every_type_becomes_its_measurement():
    topics = (
        DEPTH,
        "/packed/depth/compressedDepth",
        "/color/image_raw",
        "/color/image_raw/compressed",
        "/cloud",
        "/scan",
    )
    feed, _, faults = feed_of(*topics, root_frame="camera")
    camera = wall(1.0).camera
    for info in {info_topic(topic) for topic in topics[:4]}:
        send(feed, info, CAMERA_INFO, camera_info(header_at(1.0, "camera"), camera))
    header = header_at(1.0, "camera")
    depth = wall(1.0)
    meters = np.where(depth.image > 2050, np.nan, depth.image / 1000.0).astype(np.float32)
    picture = np.random.default_rng(1).integers(0, 255, (24, 32, 3)).astype(np.uint8)
    raw = {"header": header, "height": 24, "width": 32, "is_bigendian": 0}
    packed = np.concatenate([np.zeros(12, np.uint8), cv2.imencode(".png", depth.image)[1].ravel()])
    points = PointCloud("", 1.0, np.arange(12.0).reshape(4, 3), np.eye(4))
    scan = LaserScan("", 1.0, np.full(5, 2.0, np.float32), -0.2, 0.1, 0.1, 10.0, np.eye(4))
    messages = [
        (DEPTH, IMAGE, _depth(header, depth)),
        (DEPTH, IMAGE, new(IMAGE, **raw, encoding="32FC1", step=128, data=meters.view(np.uint8).ravel())),
        (
            topics[1],
            COMPRESSED,
            new(COMPRESSED, header=header, format="16UC1; compressedDepth png", data=packed),
        ),
        (topics[2], IMAGE, new(IMAGE, **raw, encoding="rgb8", step=96, data=picture[:, :, ::-1].ravel())),
        (
            topics[3],
            COMPRESSED,
            new(COMPRESSED, header=header, format="png", data=cv2.imencode(".png", picture)[1].ravel()),
        ),
        (topics[4], CLOUD, _cloud(header, points)),
        (topics[5], SCAN, _scan(header, scan)),
    ]
    found = [arrival.measure() for message in messages for arrival in send(feed, *message)]
    assert faults.counts == {}
    assert [type(item) for item in found] == [DepthImage] * 3 + [ColorImage] * 2 + [PointCloud, LaserScan]
    for item, unit, image in zip(found, (0.001, 1.0, 0.001), (depth.image, meters, depth.image), strict=False):
        assert np.array_equal(item.image, image, equal_nan=image.dtype.kind == "f")
        assert item.meters_per_unit == unit
    assert all(np.array_equal(item.image, picture) for item in found[3:5])
    assert np.array_equal(found[5].points, points.points)
    assert np.array_equal(found[6].ranges, scan.ranges)


def test_a_tree_knows_how_far_its_transforms_reach():
    tree = TransformTree("test", max_age=0.5)
    assert not tree.covers("a", "b", 1.0)
    for stamp in (1.0, 2.0):
        tree.add_edge("a", "b", stamp, moved(stamp), static=False)
    assert tree.covers("a", "b", 2.0)
    assert not tree.covers("b", "a", 2.1)
    tree.keep(10.0, 20.0)
    with pytest.raises(voodoo.RecordingError, match="found the nearest usable one"):
        tree.lookup("a", "b", 15.0)
    tree.add_edge("a", "b", 3.0, moved(7.0), static=True)
    assert tree.lookup("a", "b", 99.0)[0, 3] == 7.0, "it holds from now on"


def test_names_of_types():
    assert dds_name("sensor_msgs/msg/Image") == "sensor_msgs::msg::dds_::Image_"
    assert ros_name("sensor_msgs::msg::dds_::Image_") == "sensor_msgs/msg/Image"
    assert ros_name("DCPSParticipant") == ""


@pytest.mark.parametrize(("word", "number"), [("", 0), ("0", 0), ("232", 232), (None, 0)])
def test_the_domain_is_a_number(monkeypatch, word, number):
    monkeypatch.delenv("ROS_DOMAIN_ID", raising=False)
    if word is not None:
        monkeypatch.setenv("ROS_DOMAIN_ID", word)
    assert domain_id() == number


@pytest.mark.parametrize("word", ["abc", "233", "-1", "1.0"])
def test_a_wrong_domain_is_refused(monkeypatch, word):
    monkeypatch.setenv("ROS_DOMAIN_ID", word)
    with pytest.raises(voodoo.VoodooError, match=f"ROS_DOMAIN_ID: expected a number from 0 to 232, found '{word}'"):
        domain_id()


def test_nodes_of_this_machine_find_each_other_by_its_address(monkeypatch):
    """The name of its interface differs between systems."""
    pytest.importorskip("cyclonedds", reason="pip install cyclonedds, of the extra ros2")
    assert "NetworkInterface name" not in _LOOPBACK
    monkeypatch.setenv("ROS_LOCALHOST_ONLY", "1")
    monkeypatch.setenv("ROS_DOMAIN_ID", "77")
    one, other = Node(), Node()
    publication, until = one.advertise("/here", "std_msgs/msg/String"), time.monotonic() + 5.0
    while not (found := other.offers()) and time.monotonic() < until:
        time.sleep(0.01)
    assert found.keys() == {"/here"} and publication.subscribers == 0


LAMP = Path(__file__).resolve().parent.parent / "examples/bodies/lamp.toml"
LISTS = {"/humans/bodies/tracked", "/humans/persons/tracked"}
ORDER = ["/human_description_p1", "/humans/persons/p1/body_id", "/humans/persons/p1/anonymous"]
ONCE = set(ORDER)


class FakeNode:
    """Keeps what is published."""

    def __init__(self):
        self.sent, self.heard = [], {}
        self.offered, self.published, self.unheard = {}, {}, set()

    def advertise(self, topic, kind, *, depth=10, latched=False):
        node = self

        class Publication:
            @property
            def subscribers(self):
                return topic not in node.unheard

            def write(self, message):
                node.sent.append((topic, STORE.deserialize_cdr(message, kind)))

        return Publication()

    def subscribe(self, topic, offer, *, depth=5):
        self.heard[topic] = [b""] * self.published.get(topic, 0)
        node = self

        class Subscription:
            def take(self):
                taken, node.heard[topic] = node.heard[topic], []
                return taken

        return Subscription()

    def offers(self):
        return self.offered

    def wait(self, seconds):
        time.sleep(seconds)

    def take(self):
        sent, self.sent = self.sent, []
        return {topic: [message for name, message in sent if name == topic] for topic, _ in sent}


def test_what_is_published_has_the_stamps_of_the_data():
    node = FakeNode()
    output = Ros2Sink(root_frame=lambda: "base_link", node=node)
    recording = open_recording(sample_path(), use=("depth",))
    tracker = start_tracker(recording)
    step = next(track(recording, tracker))

    def publish(stamp, estimate):
        frame = LiveFrame(stamp, step.recorded.measurements, 0, 0.0, 0.0, False)
        output.publish(Step(frame, {1: estimate}, {1: tracker.body}, 0.0))
        return node.take()

    sent = publish(step.estimate.stamp, step.estimate)
    body = "/humans/bodies/p1"
    assert set(sent) == {
        "/tf",
        f"{body}/joint_states",
        f"{body}/markers",
        f"{body}/pose",
        f"{body}/skeleton2d",
        *LISTS,
        *ONCE,
    }
    stamps = {
        (message.header.stamp.sec, message.header.stamp.nanosec)
        for message in (
            *sent["/tf"][0].transforms,
            *(sent[f"{body}/{name}"][0] for name in ("joint_states", "pose")),
            *(sent[topic][0] for topic in TRACKED),
        )
    }
    assert stamps == {divmod(round(step.estimate.stamp * 1e9), 1_000_000_000)}
    names = {transform.child_frame_id: transform.header.frame_id for transform in sent["/tf"][0].transforms}
    assert names["body_p1"] == "base_link"
    assert names["l_elbow_p1"] == "l_shoulder_p1"
    assert sent[TRACKED[0]][0].ids == ["p1"]
    gone = publish(step.estimate.stamp + 0.1, nobody(step.estimate.stamp + 0.1))
    assert set(gone) == {f"{body}/markers", *LISTS}
    assert [marker.action for marker in gone[f"{body}/markers"][0].markers] == [3], "they are deleted"
    assert gone[TRACKED[0]][0].ids == []
    assert set(publish(step.estimate.stamp + 0.2, nobody(step.estimate.stamp + 0.2))) == LISTS
    assert gone[TRACKED[0]][0].__msgtype__ == IDS
    on_demand = {f"{body}/markers", f"{body}/skeleton2d"}
    node.unheard |= on_demand
    unheard = publish(step.estimate.stamp + 0.3, step.estimate)
    assert set(sent) - set(unheard) == on_demand | ONCE, "made for nobody"
    assert all(sent[topic][0].ids == ["p1"] for topic in LISTS)
    description, body_id, anonymous = (sent[topic][0].data for topic in sorted(ONCE, key=ORDER.index))
    assert description.startswith("<robot") and body_id == "p1" and anonymous is True


def test_keypoints_are_where_the_camera_sees_the_joints():
    recording = open_recording(sample_path(), use=("depth",))
    tracker = start_tracker(recording)
    step = next(track(recording, tracker))
    (image,) = (item for item in step.recorded.measurements if isinstance(item, DepthImage))
    raw = cdr(keypoints_message(step.estimate, image))
    message = STORE.deserialize_cdr(raw, "hri_msgs/msg/Skeleton2D")
    header = len(cdr(new("std_msgs/msg/Header", frame_id=image.sensor)))
    assert len(raw) == -(-header // 4) * 4 + 18 * 12, "an array, not a sequence"
    points = np.array([(one.x, one.y, one.c) for one in message.skeleton])
    assert (points[[0, 14, 15, 16, 17]] == 0.0).all() and (points[1:14, 2] > 0.5).all() and (points[:, 2] <= 1.0).all()
    sensor_from_root = np.linalg.inv(image.root_from_sensor)
    for number, site in ((4, "r_wrist"), (5, "l_shoulder"), (9, "r_knee"), (13, "l_ankle")):
        place = sensor_from_root[:3, :3] @ step.estimate.joints[site] + sensor_from_root[:3, 3]
        seen = (image.camera.project(place[None])[0] + 0.5) / (image.camera.width, image.camera.height)
        np.testing.assert_allclose(points[number, :2], seen, atol=1e-6)
    lamp = voodoo.Tracker(voodoo.Body.load(LAMP), detector=None).estimate
    assert all(one.c == 0.0 for one in keypoints_message(lamp, image).skeleton)
    outside = replace(image, root_from_sensor=image.root_from_sensor @ np.diag([-1.0, 1.0, -1.0, 1.0]))
    assert all(one.x == one.y == one.c == 0.0 for one in keypoints_message(step.estimate, outside).skeleton)


@pytest.mark.parametrize("root", ["odom", "camera_depth_optical_frame"])
def test_several_people_are_published_as_a_bag_has_them(root):
    """The numbers that are filled in are those of messages that are made one by one."""
    node = FakeNode()
    output = Ros2Sink(root_frame=lambda: root, node=node)
    recording = open_recording(sample_path(), use=("depth",))
    tracker = start_tracker(recording)
    steps = [step for step, _ in zip(track(recording, tracker), range(12), strict=False)]
    people, body = {1: steps[3].estimate, 4: steps[11].estimate}, tracker.body
    bodies = {1: body, 4: body.scaled(1.1)}
    for stamp in (7.25, 8.5):  # the same persons again
        output.publish(Step(LiveFrame(stamp, (), 0, 0.0, 0.0, False), people, bodies, 0.0))
        sent = node.take()
        (transforms,) = sent["/tf"]
        assert sent[TRACKED[0]][0].ids == ["p1", "p4"] and sent[TRACKED[0]][0].header.stamp.nanosec == (stamp % 1) * 1e9
        expected = []
        for number, estimate in people.items():
            made = instant(estimate, bodies[number], root_frame=root, person=f"p{number}")
            joints, pose = (f"/humans/bodies/p{number}/{name}" for name in ("joint_states", "pose"))
            assert sent[joints][0].name == made[joints].name
            np.testing.assert_allclose(sent[joints][0].position, made[joints].position, atol=1e-12)
            np.testing.assert_allclose(sent[pose][0].pose.covariance, made[pose].pose.covariance, rtol=1e-9, atol=1e-15)
            assert sent[pose][0].header.frame_id == made[pose].header.frame_id
            expected += [
                one for one in made["/tf"].transforms if one.child_frame_id not in {e.child_frame_id for e in expected}
            ]
        for found, one in zip(transforms.transforms, expected, strict=True):
            assert (found.child_frame_id, found.header.frame_id) == (one.child_frame_id, one.header.frame_id)
            assert (found.header.stamp.sec, found.header.stamp.nanosec) == (int(stamp), (stamp % 1) * 1e9)
            for part, axes in (("translation", "xyz"), ("rotation", "xyzw")):
                here, there = ([getattr(getattr(each.transform, part), axis) for axis in axes] for each in (found, one))
                np.testing.assert_allclose(here, there, atol=1e-12)


def test_topics_of_who_left_are_withdrawn():
    node, alive = FakeNode(), weakref.WeakValueDictionary()
    advertise = node.advertise
    node.advertise = lambda topic, *about, **how: alive.setdefault(topic, advertise(topic, *about, **how))
    output = Ros2Sink(root_frame=lambda: "odom", node=node)
    recording = open_recording(sample_path(), use=("depth",))
    tracker = start_tracker(recording)
    estimate = next(track(recording, tracker)).estimate
    for stamp, numbers in ((1.0, (1, 10)), (2.0, (10,)), (2.0 + FORGET_AFTER_S, (10,))):
        how = dict.fromkeys(numbers, estimate), dict.fromkeys(numbers, tracker.body)
        output.publish(Step(LiveFrame(stamp, (), 0, 0.0, 0.0, False), *how, 0.0))
        gc.collect()
        people = {person for topic in alive for person in ("p1", "p10") if re.search(rf"[/_]{person}(/|$)", topic)}
        assert people == ({"p10"} if stamp > FORGET_AFTER_S else {"p1", "p10"})


def test_a_frame_is_written_in_as_few_messages_as_it_has_topics_and_encoded_once(monkeypatch):
    encoded = []
    monkeypatch.setattr("voodoo.export.ros2.cdr", lambda message: encoded.append(message) or cdr(message))
    node = FakeNode()
    output = Ros2Sink(root_frame=lambda: "odom", node=node)
    recording = open_recording(sample_path(), use=("depth",))
    tracker = start_tracker(recording)
    steps = [step for step, _ in zip(track(recording, tracker), range(6), strict=False)]
    for number in range(1, 5):
        node.unheard.add(f"/humans/bodies/p{number}/markers")
    counts = []
    for step in steps[2:]:
        people, bodies = (dict.fromkeys(range(1, 5), one) for one in (step.estimate, tracker.body))
        output.publish(Step(LiveFrame(step.estimate.stamp, (), 0, 0.0, 0.0, False), people, bodies, 0.0))
        sent = [topic for topic, _ in node.sent if not re.search("description|body_id|anonymous", topic)]
        node.take()
        counts.append((len(sent), len(set(sent)), len(encoded)))
    assert {count[:2] for count in counts} == {(11, 11)}  # /tf, two lists of ids, and two of each person
    assert counts[0][2] == counts[-1][2] == 11 + 3 * 4  # and what is sent once of each person


def test_a_whole_recording_goes_through_the_bus():
    """Messages as a driver sends them give what the recording gives, to the last bit."""
    recording = open_recording(sample_path(), use=("depth",), bare=True)
    rig = Rig(follower_of())
    feed = RosFeed([DEPTH], rig.live.faults, rig.clock, root_frame="base_link")
    images = [depth_of(frame) for frame, _ in zip(recording, range(20), strict=False)]
    send(feed, INFO, CAMERA_INFO, camera_info(header_at(1.0, "camera"), images[0].camera))
    send(feed, "/tf_static", TF, transforms("base_link", "camera", 0.0, images[0].root_from_sensor))
    for item in images:
        for arrival in send(feed, DEPTH, IMAGE, _depth(header_at(item.stamp, "camera"), item)):
            rig.deliver(arrival)
        rig.wait(1 / 30, tick=1 / 30)
    assert [frame.stamp for frame in rig.frames] == pytest.approx([item.stamp for item in images], abs=1e-6)
    for frame, item in zip(rig.frames, images, strict=True):
        (found,) = frame.measurements
        assert np.array_equal(found.image, item.image)
        assert found.camera == item.camera
        np.testing.assert_allclose(found.root_from_sensor, item.root_from_sensor, atol=1e-12)
    assert str(rig.steps[-1].estimates[1].status) == "tracking"


def test_what_is_published_is_listed_with_type_and_rate():
    node = FakeNode()
    kinds = {"/tf": TF, "/depth": IMAGE, "/scan": SCAN, "/speech": "std_msgs/msg/String"}
    node.offered = {topic: Offer(kind, reliable=True, latched=False) for topic, kind in kinds.items()}
    node.published = {"/depth": 6, "/tf": 3}
    lines = listing(node, seconds=0.2)
    assert [line.split()[0] for line in lines] == ["/depth", "/scan", "/speech", "/tf"], "what is tracked comes first"
    depth, scan, speech, tf = (line.split("  ")[1:] for line in lines)
    assert depth[0] == IMAGE and 15.0 < float(depth[1].split()[0]) <= 30.0 and scan[1] == "0.0 Hz"
    assert speech == ["std_msgs/msg/String"] and tf[0] == TF


def test_a_wrong_topic_says_which_there_are(monkeypatch):
    node = FakeNode()
    node.offered = {
        "/depth": Offer(IMAGE, reliable=True, latched=False),
        "/tf": Offer(TF, reliable=True, latched=False),
    }
    monkeypatch.setattr("voodoo.live.sources.ros2.Node", lambda: node)
    monkeypatch.setattr("voodoo.live.sources.ros2._DISCOVERY_S", 0.0)
    with pytest.raises(SourceGone, match=r"/wrong: expected somebody .* published are /depth$"):
        Ros2Source(["/wrong"]).open(HandClock(1.0), Faults(None))


@pytest.mark.parametrize("wrong", [{"meters_per_unit": -1.0}, {"meters_per_unit": "two"}, {"tf_max_age": math.nan}])
def test_numbers_of_topics_are_checked_as_those_of_bags(wrong):
    with pytest.raises(voodoo.RecordingError, match=f"ros2:/depth: {next(iter(wrong))}: expected"):
        Ros2Source(["/depth"], **wrong)


def test_a_message_lets_everybody_be_searched_for_again():
    node, asked = FakeNode(), []
    output = Ros2Sink(root_frame=lambda: "base_link", node=node)
    output.on_reset = lambda: asked.append(True)
    step = Step(LiveFrame(2.0, (), 1, 0.0, 0.0, False), {1: nobody(2.0)}, {1: voodoo.Body.human()}, 0.0)
    output.publish(step)
    assert asked == []
    node.heard[RESET] = [b"", b""]
    output.publish(replace(step, frame=replace(step.frame, stamp=2.6)))  # it looks twice a second
    assert asked == [True]
    # and the session forgets everybody
    messages, statuses = [], []

    class Asks(Output):
        waiting = 1000

        def publish(self, step):
            statuses.append(str(step.estimates[1].status))
            if len(statuses) == 15:
                self.on_reset()

    follower, forgotten = follower_of(), []
    restart = follower.restart

    def restarted(**how):
        restart(**how)
        forgotten.append(not follower._front.tracker.estimate.joints)  # it may be found again in the same frame

    follower.restart = restarted
    source = PlayedSource(open_recording(sample_path(), use=("depth",)), rate=2.0)
    with Live([source], on_message=messages.append) as live:
        session = Session(live, lambda _: follower, outputs=[Asks()])
        while session.wait(0.05):
            pass
        session.finish()
    assert any(message.startswith("reset") for message in messages)
    assert statuses[14] != "searching" and forgotten == [True] and statuses[-1] == "tracking"


@pytest.mark.parametrize(("root", "rate"), [("camera_depth_optical_frame", 2.0), ("base_link", 8.0)])
def test_live_topics_stand_on_the_floor_that_is_seen_as_files_do(root, rate):
    recording = open_recording(sample_path(), use=("depth",), root_frame=root)
    node, messages, turns = FakeNode(), [], []

    class Turns(Output):
        waiting = 1000

        def publish(self, step):
            turns.append(step.turn)

    with Live([PlayedSource(recording, rate=rate)], on_message=messages.append) as live:
        outputs = [Ros2Sink(root_frame=lambda: live.root_frame, node=node), Turns()]
        session = Session(live, lambda _: follower_of(root), outputs=outputs)
        while session.wait(0.05):
            pass
        session.finish()
    said = [message for message in messages if "upright by the floor" in message]
    poses = [one.transforms for one in node.take()["/tf"]]
    (body,) = (one for one in poses[-1] if one.child_frame_id == "body_p1")
    if root == "base_link":
        assert not said and turns[-1].words == "" and body.header.frame_id == root
        return
    assert len(said) == 1 and turns[0].words == by_axes(root).words
    expected = by_floor(visible_floor(recording), optical=True)
    assert turns[-1].words == expected.words
    # The camera is 1.3 m high, and looks down by 7 degrees.
    np.testing.assert_allclose(turns[-1].pose, expected.pose, atol=0.03)
    assert np.degrees(np.arccos(turns[-1].pose[2, :3] @ turns[0].pose[2, :3])) == pytest.approx(7.0, abs=1.0)
    assert body.header.frame_id == f"{root}_upright"
    (above,) = (one.transform for one in poses[-1] if one.child_frame_id == f"{root}_upright")
    assert above.translation.y == pytest.approx(1.3, abs=0.05), "in the camera's frame the floor is below"
    pelvis = body.transform.translation.z
    assert 0.8 < pelvis < 1.1, "above the floor"
