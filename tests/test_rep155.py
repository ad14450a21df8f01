"""What clients of REP-155 do: they read `tracked`, and make every other name from an id in it."""

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import yaml
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

import voodoo
from made_up import two_people
from voodoo.export.files import save
from voodoo.export.people import PeopleTrack
from voodoo.export.ros2 import person_id, write_bag
from voodoo.export.track import Track
from voodoo.export.urdf import urdf
from voodoo.live.sinks.ros2 import FOLLOW
from voodoo.pipeline.run import track
from voodoo.pipeline.run import track as run_track
from voodoo.pipeline.start import start_tracker
from voodoo.recordings import sample_path

ROOT = Path(__file__).resolve().parent.parent
STORE = get_typestore(Stores.ROS2_HUMBLE)
STORE.register(get_types_from_msg("std_msgs/Header header\nstring[] ids", "hri_msgs/msg/IdsList"))


def one_person(folder):
    recording = voodoo.open_recording(sample_path(), use=("depth",))
    tracker = start_tracker(recording)
    steps = zip(run_track(recording, tracker), range(5), strict=False)
    write_bag(
        folder, Track.of([step.estimate for step, _ in steps], body=tracker.body), tracker.body, root_frame="odom"
    )
    return 1


def several(folder):
    people, bodies, estimates = voodoo.People(), {}, []
    for step in track(two_people(), people):
        estimates.append(step.estimate)
        bodies |= {person.id: people.body(person.id) for person in step.estimate}
    save(PeopleTrack.of(estimates, bodies=bodies), folder, body=bodies, root_frame="odom")
    return 2


def messages_of(folder):
    """Topic -> messages, by stamp for those with transforms."""
    found = {}
    with AnyReader([folder], default_typestore=STORE) as reader:
        for connection, at, raw in reader.messages():
            found.setdefault(connection.topic, []).append((at, reader.deserialize(raw, connection.msgtype)))
    return found


@pytest.mark.parametrize("write", [one_person, several])
def test_every_name_follows_from_an_id_in_tracked(write, tmp_path):
    count = write(tmp_path / "bag")
    found = messages_of(tmp_path / "bag")
    ids = {one for _, message in found["/humans/bodies/tracked"] for one in message.ids}
    assert len(ids) == count and all(one[0].isalpha() for one in ids)
    frames = {}
    for at, message in found["/tf"]:
        frames.setdefault(at, set()).update(transform.child_frame_id for transform in message.transforms)
    for at, message in found["/humans/bodies/tracked"]:
        assert {name for name in frames.get(at, ()) if name.startswith("body_")} == {
            f"body_{one}" for one in message.ids
        }
    for one in ids:
        ((_, text),) = found[f"/human_description_{one}"]
        robot = ElementTree.fromstring(text.data)
        links, joints = ({item.get("name") for item in robot.findall(kind)} for kind in ("link", "joint"))
        assert {f"body_{one}", f"l_elbow_{one}", f"head_{one}"} <= links
        assert set(found[f"/humans/bodies/{one}/joint_states"][0][1].name) <= joints
        assert {name for names in frames.values() for name in names if name.endswith(f"_{one}")} <= links
        assert len(joints) == len(links) - 1, "a tree"
        (((_, body),), ((_, anonymous),)) = (
            found[f"/humans/persons/{one}/{name}"] for name in ("body_id", "anonymous")
        )
        assert body.data == one and anonymous.data
    for kind in ("bodies", "persons"):
        topics = {topic for topic in found if topic.startswith(f"/humans/{kind}/") and topic.count("/") > 3}
        assert {topic.split("/")[3] for topic in topics} == ids
    lists = ([(at, message.ids) for at, message in found[f"/humans/{kind}/tracked"]] for kind in ("bodies", "persons"))
    assert next(lists) == next(lists)


def test_the_joints_of_a_description_place_the_frames_as_the_transforms_do():
    """The turns of the arm, with angles as joint states have them."""
    robot = ElementTree.fromstring(urdf(voodoo.Body.human(1.75), "p1"))
    joints = {joint.find("child").get("link"): joint for joint in robot.findall("joint")}

    def place(link):
        total, height = np.zeros(3), link
        while height in joints:
            total = total + np.array([float(word) for word in joints[height].find("origin").get("xyz").split()])
            height = joints[height].find("parent").get("link")
        return total

    left, right = place("l_wrist_p1"), place("r_wrist_p1")
    np.testing.assert_allclose(left * (1, -1, 1), right, atol=0.01)
    assert left[1] > 0.15 and place("l_ankle_p1")[2] < -0.7 and place("head_p1")[2] > 0.5
    axes = {
        joint.get("name"): joint.find("axis").get("xyz") for joint in joints.values() if joint.get("type") != "fixed"
    }
    assert axes["l_elbow_p1"] == "0.0000 -1.0000 0.0000" and axes["r_p_shoulder_p1"].startswith("-1.0000 ")


def test_any_body_is_described():
    lamp = voodoo.Body.load(ROOT / "examples/bodies/lamp.toml")
    assert len(ElementTree.fromstring(urdf(lamp, "p1")).findall("link")) > len(lamp.limbs)


def test_the_display_of_rviz_names_what_is_published():
    manager = yaml.safe_load((ROOT / "examples/voodoo.rviz").read_text())["Visualization Manager"]
    assert [tool["Topic"]["Value"] for tool in manager["Tools"] if "Topic" in tool] == [FOLLOW]
    displays = manager["Displays"]
    topics = {display.get(key, {}).get("Value") for display in displays for key in ("Topic", "Description Topic")}
    body = f"/humans/bodies/{person_id(1)}"
    assert topics - {None} == {f"{body}/markers", f"{body}/pose", f"/human_description_{person_id(1)}"}
