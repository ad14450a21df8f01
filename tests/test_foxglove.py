"""Foxglove: a file read back with its own library mcap, and a server heard by a client of its protocol."""

import json
import re
import struct
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import voodoo
from commands import refused, run
from test_doors import track_of
from test_exports import with_gaps
from test_sinks import opened, step_of, until
from voodoo.errors import VoodooError
from voodoo.export.files import save
from voodoo.export.people import PeopleTrack
from voodoo.export.track import Track
from voodoo.recordings import sample_path

needs_foxglove = pytest.mark.skipif(
    not __import__("importlib").util.find_spec("foxglove"), reason="pip install foxglove-sdk, of the extra foxglove"
)


def decoded(path):
    """Topic -> [(log time, message)], by mcap and the schemas in the file."""
    reader = pytest.importorskip("mcap.reader", reason="pip install mcap, of the extra test")
    protobuf = pytest.importorskip("google.protobuf", reason="pip install protobuf, of the extra test")
    from google.protobuf.descriptor_pb2 import FileDescriptorSet
    from google.protobuf.descriptor_pool import DescriptorPool
    from google.protobuf.message_factory import GetMessageClass

    found, pool = {}, DescriptorPool()
    assert protobuf
    with path.open("rb") as file:
        for schema, channel, message in reader.make_reader(file).iter_messages():
            for one in FileDescriptorSet.FromString(schema.data).file:
                if not any(one.name == name for name in found.get("", [])):
                    pool.Add(one)
                    found.setdefault("", []).append(one.name)
            kind = GetMessageClass(pool.FindMessageTypeByName(schema.name))
            found.setdefault(channel.topic, []).append((message.log_time, kind.FromString(message.data)))
    found.pop("", None)
    return found


def poses_of(transforms):
    """Child frame -> (parent, 4x4)."""
    result = {}
    for one in transforms:
        pose = np.eye(4)
        pose[:3, :3] = Rotation.from_quat([getattr(one.rotation, axis) for axis in "xyzw"]).as_matrix()
        pose[:3, 3] = [getattr(one.translation, axis) for axis in "xyz"]
        result[one.child_frame_id] = one.parent_frame_id, pose
    return result


@needs_foxglove
def test_a_file_read_by_mcap_has_the_pose(tmp_path):
    body = voodoo.Body.human()
    track = with_gaps(track_of(body))
    save(track, tmp_path / "pose.foxglove.mcap", body=body, root_frame="odom")
    topics = decoded(tmp_path / "pose.foxglove.mcap")
    assert set(topics) == {"/tf", "/people"}
    assert [time for time, _ in topics["/people"]] == [round(stamp * 1e9) for stamp in track.stamps]
    found = np.flatnonzero(track.found)
    assert len(topics["/tf"]) == len(found) and 0 < len(found) < len(track)
    assert [len(message.entities) for _, message in topics["/people"]] == track.found.astype(int).tolist()
    for (_, message), index in zip(topics["/tf"], found, strict=True):
        frames = poses_of(message.transforms)
        parent, pose = frames["l_elbow_p1"]
        while parent != "odom":
            parent, above = frames[parent]
            pose = above @ pose
        elbow = track.joints[index, track.joint_names.index("l_elbow")]
        np.testing.assert_allclose(pose[:3, 3], elbow, atol=1e-6)
    (entity,) = topics["/people"][found[0]][1].entities
    assert (entity.id, entity.frame_id) == ("p1", "odom") and len(entity.cylinders) == len(body.limbs)
    for limb, cylinder in zip(body.limbs, entity.cylinders, strict=True):
        middle = track.world_from_limb[found[0], body.limb_names.index(limb.name)] @ [0, 0, limb.shape.length / 2, 1]
        place = cylinder.pose.position
        np.testing.assert_allclose([place.x, place.y, place.z], middle[:3], atol=1e-6)
        assert cylinder.size.x * cylinder.bottom_scale / 2 == pytest.approx(limb.shape.a0, rel=0.2)
    spheres = [(one.pose.position.x, one.pose.position.y, one.pose.position.z) for one in entity.spheres]
    np.testing.assert_allclose(spheres, track.joints[found[0]], atol=1e-6)


@needs_foxglove
def test_a_file_of_nobody_has_empty_scenes(tmp_path):
    body = voodoo.Body.human()
    track = track_of(body)
    nothing = {name: np.full_like(getattr(track, name), np.nan) for name in ("joints", "world_from_limb", "residual")}
    nobody = replace(track, status=("searching",) * len(track), limb_status={}, **nothing)
    save(nobody, tmp_path / "pose.foxglove.mcap", body=body, root_frame="odom")
    topics = decoded(tmp_path / "pose.foxglove.mcap")
    assert set(topics) == {"/people"} and [len(message.entities) for _, message in topics["/people"]] == [0] * len(
        track
    )


@needs_foxglove
def test_a_file_of_several_people_has_each_while_it_is_there(tmp_path):
    body = voodoo.Body.human()
    first, second = track_of(body), track_of(body, seed=8)
    people = PeopleTrack(first.stamps, {1: first, 2: second.of_frames(np.arange(4, 9))})
    save(people, tmp_path / "all.foxglove.mcap", body={1: body, 2: body}, root_frame="camera_optical_frame")
    topics = decoded(tmp_path / "all.foxglove.mcap")
    there = [{entity.id for entity in message.entities} for _, message in topics["/people"]]
    assert there[3] == {"p1"} and there[4] == there[8] == {"p1", "p2"}
    assert topics["/people"][0][1].entities[0].frame_id == "camera_optical_frame_upright"


@needs_foxglove
def test_a_stamp_that_the_format_cannot_hold_is_named(tmp_path):
    body = voodoo.Body.human()
    track = track_of(body)
    early = replace(track, stamps=track.stamps - track.stamps[1])
    with pytest.raises(voodoo.VoodooError, match="stamps: expected none before zero"):
        save(early, tmp_path / "pose.foxglove.mcap", body=body, root_frame="odom")
    assert not list(tmp_path.iterdir())


@needs_foxglove
def test_a_command_writes_it_whole_or_not_at_all(tmp_path):
    output = tmp_path / "pose.foxglove.mcap"
    assert run("track", sample_path(), "--use", "depth", "--out", output, "--out", tmp_path / "pose.npz").exit_code == 0
    assert len(decoded(output)["/people"]) == len(Track.load(tmp_path / "pose.npz"))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["pose.foxglove.mcap", "pose.npz"]


@needs_foxglove
def test_a_client_of_foxglove_receives_poses_and_nobody_costs_nothing():
    client_of = pytest.importorskip("websockets.sync.client", reason="pip install websockets, of the extra stream")
    body = voodoo.Body.human()
    track = track_of(body)
    sink = opened("foxglove://:0")
    sink.publish(step_of(track, body))
    with pytest.raises(VoodooError, match=r"expected a free address of this machine, found: .*in use"):
        opened(f"foxglove://127.0.0.1:{sink.port}")
    with client_of.connect(f"ws://127.0.0.1:{sink.port}", subprotocols=["foxglove.sdk.v1"], max_size=None) as client:
        channels = {}
        while len(channels) < 2:
            text = client.recv(timeout=5)
            told = json.loads(text) if isinstance(text, str) else {}
            channels |= {one["topic"]: one for one in told.get("channels", ())}
        assert channels["/people"]["schemaName"] == "foxglove.SceneUpdate"
        wanted = [{"id": number, "channelId": one["id"]} for number, one in enumerate(channels.values())]
        client.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))
        until(lambda: sink._channels.are_subscribed)
        sink.publish(step_of(track, body, 3))
        received = [client.recv(timeout=5) for _ in range(2)]
    stamps = {struct.unpack_from("<BIQ", data)[2] for data in received}
    assert stamps == {round(track.stamps[3] * 1e9)} and all(len(data) > 1000 for data in received)
    sink.close()


def test_without_the_library_or_with_a_wrong_address_nothing_is_written(tmp_path, monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "foxglove", None)
    with pytest.raises(VoodooError, match=re.escape("pip install 'voodoo-tracker[foxglove]'")):
        opened("foxglove://")
    body = voodoo.Body.human()
    with pytest.raises(VoodooError, match="expected foxglove-sdk"):
        save(track_of(body), tmp_path / "pose.foxglove.mcap", body=body, root_frame="odom")
    assert not list(tmp_path.iterdir())
    refused(run("live", sample_path(), "--to", "foxglove://"), "foxglove://: expected foxglove-sdk")
