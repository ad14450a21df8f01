"""BVH, TRC and ROS 2 bags, read back by readers that share no code with the writers."""

import json
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from rosbags.convert import convert
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore
from scipy.spatial.transform import Rotation

import voodoo
from color_scene import write_videos
from commands import run
from measurement_data import data_folder
from voodoo.errors import BodyError, VoodooError
from voodoo.export import (
    write_bag,
    write_bvh,
    write_c3d,
    write_foxglove,
    write_glb,
    write_mot,
    write_sto,
    write_trc,
)
from voodoo.export.files import check_target, save
from voodoo.export.human_frames import frame_places, frame_plan
from voodoo.export.layout import rows_of
from voodoo.export.skeleton import skeleton
from voodoo.export.track import Track
from voodoo.export.upright import Turn, by_axes, by_feet, by_floor, lying_words, turned
from voodoo.pipeline.run import start_tracker
from voodoo.pipeline.run import track as run_track
from voodoo.recordings import sample_path
from voodoo.recordings.marker_trajectories import Z_UP_FROM_Y_UP, read_trc

REST = {
    "l_hip": (0, 0.09, 0.93), "r_hip": (0, -0.09, 0.93), "l_shoulder": (0, 0.2, 1.43), "r_shoulder": (0, -0.2, 1.43),
    "l_elbow": (0, 0.2, 1.11), "r_elbow": (0, -0.2, 1.11), "l_wrist": (0, 0.2, 0.85), "r_wrist": (0, -0.2, 0.85),
    "l_knee": (0, 0.09, 0.5), "r_knee": (0, -0.09, 0.5), "l_ankle": (0, 0.09, 0.07), "r_ankle": (0, -0.09, 0.07),
    "vc7": (0, 0, 1.5), "skull_tip": (0, 0, 1.75),
}  # fmt: skip


def posed(changes, turn=0.0, shift=(0.0, 0.0, 0.0)):
    """Estimates of one body: at rest with changes, all turned about the vertical and shifted."""
    spin = Rotation.from_euler("z", turn).as_matrix()
    joints = {name: spin @ np.array(p, float) + shift for name, p in (REST | changes).items()}
    return joints


@pytest.fixture(scope="module", params=["papers", "full"])
def tracked(request):
    body = voodoo.Body.human(height=1.75, model=request.param)
    tracker = voodoo.Tracker(body, config=voodoo.Config(max_steps=30))
    first = tracker.reset(joints=posed({}), fit_sizes=True)
    body = tracker.body
    poses = [
        {},
        {"l_wrist": (0.26, 0.2, 1.11), "r_elbow": (0, -0.52, 1.43), "r_wrist": (0, -0.78, 1.43)},
        {"l_knee": (0.43, 0.09, 0.93), "l_ankle": (0.43, 0.09, 0.5)},
    ]
    estimates = []
    for index, changes in enumerate(poses):
        tracker.reset(joints=posed(changes, turn=0.3 * index, shift=(1.0, -0.5, 0.0)), fit_sizes=False)
        frame = voodoo.Frame(stamp=1.7e9 + index / 30)
        for name, place in posed(changes, turn=0.3 * index, shift=(1.0, -0.5, 0.0)).items():
            frame.add_position(name, place, weight=10.0)
        estimates.append(tracker.step(frame))
    assert first.status == "tracking"
    return Track.of(estimates), body


def read_bvh(path: Path, *, turns=None):
    """A minimal independent BVH reader with forward kinematics: joint name -> (F, 3); `turns` gets the local rotations."""
    words = path.read_text().split()
    at, stack, joints, channels = 0, [], [], []
    while words[at] != "MOTION":
        if words[at] in ("ROOT", "JOINT", "End"):
            joints.append([words[at + 1] if words[at] != "End" else f"{joints[stack[-1]][0]}_end", None, None, []])
            joints[-1][1] = stack[-1] if stack else None
            at += 2
        elif words[at] == "{":
            stack.append(len(joints) - 1)
            at += 1
        elif words[at] == "}":
            stack.pop()
            at += 1
        elif words[at] == "OFFSET":
            joints[stack[-1]][2] = np.array([float(word) for word in words[at + 1 : at + 4]])
            at += 4
        elif words[at] == "CHANNELS":
            count = int(words[at + 1])
            joints[stack[-1]][3] = words[at + 2 : at + 2 + count]
            channels += [(stack[-1], name) for name in joints[stack[-1]][3]]
            at += 2 + count
        else:
            at += 1
    frames, interval = int(words[at + 2]), float(words[at + 5])
    table = np.array([float(word) for word in words[at + 6 :]]).reshape(frames, len(channels))
    places = {joint[0]: np.empty((frames, 3)) for joint in joints}
    for frame, row in enumerate(table):
        world = []
        for number, (name, parent, offset, _) in enumerate(joints):
            turn, shift = np.eye(3), offset.copy()
            if parent is not None and any(channel.endswith("position") for channel in joints[number][3]):
                shift[:] = 0.0  # positions stand for the offset, as animation programs read them
            for value, (owner, channel) in zip(row, channels, strict=True):
                if owner == number and channel.endswith("rotation"):
                    turn = turn @ Rotation.from_euler(channel[0].lower(), value, degrees=True).as_matrix()
                elif owner == number:
                    shift["XYZ".index(channel[0])] += value
            if turns is not None:
                turns.setdefault(name, []).append(turn)
            above = (np.eye(3), np.zeros(3)) if parent is None else world[parent]
            world.append((above[0] @ turn, above[1] + above[0] @ shift))
            places[name][frame] = world[-1][1]
    return places, interval


def test_every_writer_replaces_an_old_file_whole_and_follows_no_link(tmp_path, tracked):
    track, body = tracked
    victim, path = tmp_path / "victim", tmp_path / "pose"
    victim.write_text("victim")
    people = {"p1": (track, body)}
    writers = {
        "bvh": lambda: write_bvh(path, track, body),
        "trc": lambda: write_trc(path, track),
        "c3d": lambda: write_c3d(path, track),
        "mot": lambda: write_mot(path, track, body),
        "sto": lambda: write_sto(path, track, body),
        "glb": lambda: write_glb(path, people),
    }
    if find_spec("foxglove"):
        writers["foxglove"] = lambda: write_foxglove(path, people, root_frame="odom")
    for name, write in writers.items():
        path.symlink_to(victim)
        write()
        assert victim.read_text() == "victim" and path.stat().st_size > 100 and not path.is_symlink(), name
        path.unlink()
    assert [file.name for file in tmp_path.iterdir()] == ["victim"]


def test_bvh_gives_the_joints_back_through_its_own_kinematics(tmp_path, tracked):
    track, body = tracked
    write_bvh(tmp_path / "pose.bvh", track, body)
    places, interval = read_bvh(tmp_path / "pose.bvh")
    assert interval == pytest.approx(1 / 30, abs=1e-6)
    for bone, joint in {
        "l_upperarm": "l_shoulder",
        "r_forearm": "r_elbow",
        "l_thigh": "l_hip",
        "l_calf": "l_knee",
    }.items():
        world = places[bone][:, [2, 0, 1]] / 100.0  # X left, Y up, Z forward to x forward, y left, z up
        error = np.linalg.norm(world - track.joints[:, track.joint_names.index(joint)], axis=1)
        assert error.max() < 0.01, joint


def test_bvh_at_rest_has_zero_rotations(tmp_path, tracked):
    track, body = tracked
    posed_track = skeleton(track, body)
    upright = Rotation.from_matrix(posed_track.rotations[0]).magnitude()
    assert upright.max() < 0.1
    # turned by 0.3 rad a frame: the torso follows
    turn = Rotation.from_matrix(posed_track.rotations[:, 0]).as_euler("ZYX")[:, 0]
    np.testing.assert_allclose(turn, [0.0, 0.3, 0.6], atol=0.03)


def test_joint_angles_have_the_signs_of_human_description(tracked):
    track, body = tracked
    layout, rows = rows_of(track, body)
    angle = dict(zip(layout.angles, layout.parts(rows)[4].T, strict=True))
    assert angle["l_elbow"][1] == pytest.approx(np.pi / 2, abs=0.1)  # flexed forwards
    assert angle["r_p_shoulder"][1] == pytest.approx(np.pi / 2, abs=0.1)  # abducted
    assert angle["l_knee"][2] == pytest.approx(-np.pi / 2, abs=0.1)
    assert angle["l_r_hip"][2] == pytest.approx(np.pi / 2, abs=0.1)  # thigh lifted forwards
    assert abs(angle["l_elbow"][0]) < 0.1


def test_trc_read_by_a_plain_table_reader(tmp_path, tracked):
    track, _ = tracked
    path = tmp_path / "pose.trc"
    write_trc(path, track, names=("l_wrist", "r_ankle"))
    lines = path.read_text().split("\n")
    assert lines[2].split("\t")[:5] == ["30", "30", "3", "2", "m"]
    assert [cell for cell in lines[3].split("\t") if cell] == ["Frame#", "Time", "l_wrist", "r_ankle"]
    table = np.loadtxt(path, skiprows=6, delimiter="\t")
    np.testing.assert_allclose(table[:, 1], [0, 1 / 30, 2 / 30], atol=1e-5)
    wrist = track.joints[:, track.joint_names.index("l_wrist")]
    np.testing.assert_allclose(table[:, 2:5], wrist[:, [1, 2, 0]], atol=1e-6)
    # and by this package's reader
    back = read_trc(path)
    np.testing.assert_allclose(back.positions[:, 0] @ Z_UP_FROM_Y_UP.T, wrist, atol=1e-6)
    with pytest.raises(VoodooError, match="l_wing"):
        write_trc(path, track, names=("l_wing",))


def test_bag_read_by_rosbags(tmp_path, tracked):
    track, body = tracked
    write_bag(tmp_path / "bag", track, body, root_frame="odom", person="ab12c")
    poses, states, shapes, sure = [], [], [], []
    with AnyReader([tmp_path / "bag"], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
        for connection, stamp, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            topic = connection.topic.removeprefix("/humans/bodies/ab12c")
            known = {"/tf": poses, "/joint_states": states, "/markers": shapes, "/pose": sure}
            if topic in known:
                known[topic].append((stamp, message))
    assert len(poses) == len(states) == len(shapes) == len(sure) == len(track)
    for index, (stamp, message) in enumerate(poses):
        assert stamp == round(track.stamps[index] * 1e9)
        world = {"odom": np.eye(4)}
        for item in message.transforms:  # parents come first
            t, q = item.transform.translation, item.transform.rotation
            local = np.eye(4)
            local[:3, :3] = Rotation.from_quat([q.x, q.y, q.z, q.w]).as_matrix()
            local[:3, 3] = (t.x, t.y, t.z)
            world[item.child_frame_id] = world[item.header.frame_id] @ local
        for frame, site in {
            "l_wrist": "l_wrist",
            "r_knee": "r_knee",
            "head": "head_center",
            "l_shoulder": "l_shoulder",
        }.items():
            place = track.joints[index, track.joint_names.index(site)]
            np.testing.assert_allclose(world[f"{frame}_ab12c"][:3, 3], place, atol=0.01)
        assert {"body_ab12c", "torso_ab12c", "r_ankle_ab12c"} <= set(world)
    names = states[0][1].name
    assert "l_y_shoulder_ab12c" in names and len(names) == len(states[0][1].position)
    assert {marker.ns for marker in shapes[0][1].markers} == {"limbs", "joints", "uncertainty"}
    assert len(shapes[0][1].markers) == len(body.limbs) + 1 + len(track.joint_names)
    assert {marker.type for marker in shapes[0][1].markers if marker.ns == "limbs"} == {3}  # cylinders
    with pytest.raises(VoodooError, match="does not exist"):
        write_bag(tmp_path / "bag", track, body, root_frame="odom")


def seen_by_a_camera(track):
    """The track in the optical frame of a level camera at the origin that looks along x."""
    turn = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
    limbs, both = track.world_from_limb.copy(), np.kron(np.eye(2), turn)
    limbs[..., :3, :] = turn @ limbs[..., :3, :]
    return replace(
        track,
        joints=track.joints @ turn.T,
        world_from_limb=limbs,
        covariance=turn @ track.covariance @ turn.T,
        root_covariance=both @ track.root_covariance @ both.T,
    )


def messages_of(folder):
    with AnyReader([folder], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
        return [(one.topic, reader.deserialize(raw, one.msgtype)) for one, _, raw in reader.messages()]


@pytest.mark.parametrize(("frame", "optical"), [("camera_depth_optical_frame", None), ("oak", True)])
def test_what_a_camera_sees_stands_in_every_format(tmp_path, tracked, frame, optical):
    """Files of a track in an optical frame are those of the same track in a level frame."""
    track, body = tracked
    for place, one, root, how in (
        (tmp_path / "level", track, "odom", None),
        (tmp_path / "camera", seen_by_a_camera(track), frame, optical),
    ):
        for name in ("x.bvh", "x.trc", "bag"):
            save(one, place / name, body=body, root_frame=root, turn=by_axes(root, optical=how))
    for name in ("x.bvh", "x.trc"):
        level, camera = (
            [float(word) for line in (tmp_path / room / name).read_text().splitlines()[-2:] for word in line.split()]
            for room in ("level", "camera")
        )
        np.testing.assert_allclose(camera, level, atol=2e-4)
    level, camera = (messages_of(tmp_path / room / "bag") for room in ("level", "camera"))
    assert [topic for topic, _ in camera] == [topic for topic, _ in level]
    for (topic, there), (_, here) in zip(level, camera, strict=True):
        if topic == "/tf":
            link, *transforms = here.transforms
            assert (link.header.frame_id, link.child_frame_id) == (frame, f"{frame}_upright")
            q = link.transform.rotation
            turn = Rotation.from_quat([q.x, q.y, q.z, q.w]).as_matrix()
            np.testing.assert_allclose(turn, [[0, -1, 0], [0, 0, -1], [1, 0, 0]], atol=1e-9)
            for one, other in zip(transforms, there.transforms, strict=True):
                assert one.header.frame_id == other.header.frame_id.replace("odom", f"{frame}_upright")
                places = [(each.transform.translation, each.transform.rotation) for each in (one, other)]
                a, b = ([t.x, t.y, t.z, q.x, q.y, q.z, q.w] for t, q in places)
                np.testing.assert_allclose(np.abs(a), np.abs(b), atol=1e-6)  # q is -q
        elif topic.endswith("/pose"):
            assert here.header.frame_id == f"{frame}_upright"
            np.testing.assert_allclose(here.pose.covariance, there.pose.covariance, atol=1e-9)
        elif topic.endswith("/markers"):
            assert {marker.header.frame_id for marker in here.markers} == {f"{frame}_upright"}
            for one, other in zip(here.markers, there.markers, strict=True):
                at = [(each.pose.position.x, each.pose.position.y, each.pose.position.z) for each in (one, other)]
                np.testing.assert_allclose(*at, atol=1e-6)


def test_a_body_that_lies_or_floats_is_doubted(tracked):
    track, _ = tracked
    assert lying_words(track, "odom") == ""
    camera = seen_by_a_camera(track)
    assert lying_words(camera, "oak_optical_frame") == ""
    assert "stands along -Y of base_link" in lying_words(camera, "base_link")
    high = replace(track, joints=track.joints + (0.0, 0.0, 4.0))
    assert "above the floor, z = 0 of odom" in lying_words(high, "odom")
    assert lying_words(high, "world") == ""  # nobody says that its z = 0 is the floor


@pytest.mark.parametrize(
    ("words", "roll"),
    [
        ("90 degrees clockwise", [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
        ("90 degrees counterclockwise", [[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
        ("180 degrees", [[-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]]),
    ],
)
def test_turned_images_are_named_and_their_results_put_upright(tracked, words, roll):
    track, _ = tracked
    camera = seen_by_a_camera(track)
    picture = turned(camera, Turn(np.pad(roll, (0, 1)) + np.diag([0.0, 0.0, 0.0, 1.0]), "of another camera"))
    assert f"are the images turned by {words}?" in lying_words(picture, "oak_optical_frame")
    turn = by_feet([picture], "oak_optical_frame")
    assert lying_words(picture, "oak_optical_frame", turn) == ""
    level = turned(picture, turn).joints - turned(camera, by_feet([camera], "oak_optical_frame")).joints
    np.testing.assert_allclose(level[..., 2], 0.0, atol=1e-9)


def test_a_floor_or_feet_level_a_leaning_frame(tracked):
    track, _ = tracked
    lean = np.eye(4)
    lean[:3, :3], lean[:3, 3] = Rotation.from_euler("xyz", (0.3, -0.2, 0.0)).as_matrix(), (0.1, -0.2, 1.3)
    camera = seen_by_a_camera(turned(track, by_axes("odom")._replace(pose=lean)))
    optical = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
    normal = optical @ lean[:3, :3] @ (0.0, 0.0, 1.0)
    level = turned(camera, by_floor((normal, float(normal @ optical @ lean[:3, 3])), optical=True))
    np.testing.assert_allclose(level.joints[..., 2], track.joints[..., 2], atol=1e-9)
    facing = level.joints[0, track.joint_names.index("l_wrist")] - level.joints[0, track.joint_names.index("r_wrist")]
    assert facing[1] > 0.2, "who looks away from the camera has the left hand on the left"
    lying = replace(track, joints=track.joints[..., [0, 2, 1]] * (1.0, -1.0, 1.0) + (0.0, 3.0, 0.0))  # along -Y
    turn = by_feet([lying], "world")
    assert "-Y of world" in turn.words
    np.testing.assert_allclose(turned(lying, turn).joints[..., 2], track.joints[..., 2], atol=0.03)


def converted(bag, folder):
    """The same bag of ROS 1."""
    nothing = {f"{which}_{what}": () for which in ("exclude", "include") for what in ("topics", "msgtypes")}
    how = {
        "compress": None,
        "compress_mode": "file",
        "default_typestore": None,
        "typestore": get_typestore(Stores.ROS1_NOETIC),
    }
    to = {"dst_storage": "", "dst_version": 9}
    convert([bag], folder / "one.bag", **to, **how, **nothing)
    return folder / "one.bag"


LOADED = {
    "ros2": ("reports", "export-from-camera-frame", "bag"),
    "ros1": ("reports", "export-from-camera-frame", "bag"),
    "folder": ("reports", "text-variants", "folder_bom"),
    "utd-mhad": ("utd-mhad", "Depth", "a23_s1_t1_depth.mat"),
    "pose2sim": ("reports", "keypoint-files-unpadded", "walk"),
    "c3d": ("reports", "c3d-z-up", "walk.c3d"),
    "trc": ("reports", "text-variants", "bom.trc"),
    "videos": (),
}


@pytest.mark.parametrize("loader", LOADED)
def test_every_loader_stands_in_every_format(loader, tmp_path, voodoo_data, monkeypatch):
    """Head minus feet points up."""
    monkeypatch.chdir(tmp_path)
    path = write_videos(tmp_path / "films", 2)
    if LOADED[loader]:
        path = data_folder(voodoo_data, *LOADED[loader][:2]) / LOADED[loader][2]
    if loader == "ros1":
        path = converted(path, tmp_path)
    options = ["--option", "rate=15"] if loader == "pose2sim" else []
    names = ["x.bvh", "x.trc", "x.mcap", "bag", "x.npz"]
    done = run("track", path, *options, *(f"--out={name}" for name in names))
    assert done.exit_code == 0, done.stderr
    track = Track.load(Path("x.npz"))
    ends = [track.joint_names.index(name) for name in ("head_center", "l_ankle")]
    seen = standing("", ends)
    if loader in ("ros2", "folder", "trc"):
        assert run("track", path, "--upright", *(f"--out=up{name}" for name in (*names, "x.csv"))).exit_code == 0
        seen |= standing("up", ends) | {one: Track.load(Path(one)).joints[-1][ends] for one in ("upx.npz", "upx.csv")}
    for name, (head, foot) in seen.items():
        assert head[2] - foot[2] > 0.8, name
        assert "up" not in name or abs(foot[2]) < 0.2, f"{name}: on the floor"


def standing(start, ends):
    """Head and foot (2, 3) by the last frame of each of the files whose names begin so."""
    bones, trc = read_bvh(Path(f"{start}x.bvh"))[0], read_trc(Path(f"{start}x.trc"))
    seen = {f"{start}x.bvh": np.array([bones[name][-1][[2, 0, 1]] / 100.0 for name in ("head", "l_foot")])}
    points = [trc.positions[-1, trc.names.index(name)] for name in ("head_center", "l_ankle")]
    seen[f"{start}x.trc"] = np.array(points) @ Z_UP_FROM_Y_UP.T
    for bag in (f"{start}x.mcap", f"{start}bag"):
        shapes = [message for topic, message in messages_of(Path(bag)) if topic.endswith("/markers")][-1].markers
        dots = next(marker for marker in shapes if marker.ns == "joints").points
        seen[bag] = np.array([[dots[index].x, dots[index].y, dots[index].z] for index in ends])
    return seen


BY_FRAME = ("residual", "joints", "world_from_limb", "angles", "covariance", "root_covariance")


def with_gaps(track):
    """The track with a searching frame before every frame of its own, and one behind."""
    frames = 2 * len(track) + 1
    found = np.arange(frames) % 2 == 1

    def spread(values):
        wide = np.full((frames, *values.shape[1:]), np.nan)
        wide[found] = values
        return wide

    status = iter(track.status)
    return replace(
        track,
        stamps=track.stamps[0] + np.arange(frames) / 30.0,
        status=tuple(next(status) if there else "searching" for there in found),
        limb_status={},
        **{name: spread(getattr(track, name)) for name in BY_FRAME},
    )


def test_bvh_holds_the_pose_through_searching_frames(tmp_path, tracked):
    track, body = tracked
    write_bvh(tmp_path / "whole.bvh", track, body)
    write_bvh(tmp_path / "gaps.bvh", with_gaps(track), body)
    whole, gaps = (read_bvh(tmp_path / f"{name}.bvh")[0]["l_forearm"] for name in ("whole", "gaps"))
    np.testing.assert_array_equal(gaps, whole[[0, 0, 0, 1, 1, 2, 2]])
    nobody = with_gaps(track).of_frames(np.array([0, 2, 4]))
    write_bvh(tmp_path / "nobody.bvh", nobody, body)
    places, _ = read_bvh(tmp_path / "nobody.bvh")
    assert places["l_forearm"].shape == (3, 3) and np.ptp(places["l_forearm"], axis=0).max() == 0.0
    assert places["head"][0, 1] > places["l_forearm"][0, 1] > places["l_calf"][0, 1]  # at rest, Y up


def test_trc_and_bag_leave_searching_frames_empty(tmp_path, tracked):
    track, body = tracked
    gaps = with_gaps(track)
    write_trc(tmp_path / "gaps.trc", gaps)
    back = read_trc(tmp_path / "gaps.trc")
    assert np.isnan(back.positions).all(axis=(1, 2)).tolist() == (~gaps.found).tolist()
    write_bag(tmp_path / "bag", gaps, body, root_frame="odom")
    stamps, actions = {}, []
    with AnyReader([tmp_path / "bag"], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
        for connection, stamp, raw in reader.messages():
            stamps.setdefault(connection.topic, []).append(stamp)
            if connection.topic.endswith("markers"):
                actions.append({marker.action for marker in reader.deserialize(raw, connection.msgtype).markers})
    there = [round(stamp * 1e9) for stamp in gaps.stamps[gaps.found]]
    assert stamps["/tf"] == stamps["/humans/bodies/p1/joint_states"] == there
    assert actions == [{3}, {0}] * len(track) + [{3}]  # delete all, add
    write_bag(tmp_path / "nobody", gaps.of_frames(~gaps.found), body, root_frame="odom")
    with AnyReader([tmp_path / "nobody"], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
        assert sum(connection.topic == "/tf" for connection, _, _ in reader.messages()) == 0


def test_a_bag_of_stamps_that_do_not_rise_has_the_pose_of_each(tmp_path, tracked):
    track, body = tracked
    bags = []
    for name, order in (("rising", np.arange(len(track))), ("falling", np.arange(len(track))[::-1])):
        write_bag(tmp_path / name, track.of_frames(order), body, root_frame="odom")
        with AnyReader([tmp_path / name]) as reader:
            bags.append([(one.topic, stamp, raw) for one, stamp, raw in reader.messages()])
    assert bags[0] == bags[1]


def test_stamps_that_no_bag_can_hold_leave_no_folder(tmp_path, tracked):
    track, body = tracked
    early = replace(track, stamps=track.stamps - track.stamps[0] - 1.0)
    with pytest.raises(VoodooError, match=r"stamps: expected none before zero.*-1\.0 s"):
        write_bag(tmp_path / "bag", early, body, root_frame="odom")
    assert not (tmp_path / "bag").exists()


def test_a_track_without_limb_poses_is_refused(tmp_path, tracked):
    track, body = tracked
    track.save(tmp_path / "pose.csv")
    with pytest.raises(VoodooError, match="npz"):
        write_bvh(tmp_path / "pose.bvh", Track.load(tmp_path / "pose.csv"), body)


@pytest.mark.parametrize(
    ("name", "folder"), [("bag", True), ("run.2026-05-01", True), ("run.v2", True), ("pose.cvs", False)]
)
def test_a_folder_may_have_a_dot_and_a_slip_is_reported(tmp_path, name, folder):
    if folder:
        check_target(tmp_path / name)
        (tmp_path / name).mkdir()
    with pytest.raises(VoodooError, match="exists" if folder else "cvs"):
        check_target(tmp_path / name)


def test_a_place_where_nothing_can_be_written_is_reported_before_the_work(tmp_path):
    (tmp_path / "file").write_text("")
    (tmp_path / "pose.csv").mkdir()
    check_target(tmp_path / "new" / "folders" / "pose.csv")
    for name in ("file/pose.csv", "file/new/bag"):
        with pytest.raises(VoodooError, match=r"expected a folder that can be written to, found .*file$"):
            check_target(tmp_path / name)
    with pytest.raises(VoodooError, match=r"pose\.csv: expected a file, found a folder"):
        check_target(tmp_path / "pose.csv")


@pytest.fixture(scope="module")
def recorded():
    """The bundled recording, tracked: its lengths are refined on the way."""
    recording = voodoo.open_recording(sample_path(), use=("depth", "scan"))
    tracker = start_tracker(recording)
    estimates = [step.estimate for step in run_track(recording, tracker)]
    return Track.of(estimates, body=tracker.body), tracker.body


def test_all_formats_report_the_same_joints(tmp_path, recorded):
    track, body = recorded
    for suffix in ("csv", "npz", "bvh", "trc"):
        save(track, tmp_path / f"pose.{suffix}", body=body, root_frame="base_link")
    places, _ = read_bvh(tmp_path / "pose.bvh")
    csv, npz, trc = (
        Track.load(tmp_path / "pose.csv"),
        Track.load(tmp_path / "pose.npz"),
        read_trc(tmp_path / "pose.trc"),
    )
    bones = {bone.name: bone.joint for bone in skeleton(track, body).bones if bone.joint in track.joint_names}
    assert len(bones) >= 12 and bones["l_foot"] == "l_ankle"
    for bone, joint in bones.items():
        here = track.joints[:, track.joint_names.index(joint)]
        reported = {
            "csv": csv.joints[:, csv.joint_names.index(joint)],
            "npz": npz.joints[:, npz.joint_names.index(joint)],
            "trc": trc.positions[:, trc.names.index(joint)] @ Z_UP_FROM_Y_UP.T,
            "bvh": places[bone][:, [2, 0, 1]] / 100.0,
        }
        for name, found in reported.items():
            assert np.abs(found - here).max() < 2e-6, (name, joint)
    write_bag(tmp_path / "bag", track, body, root_frame="base_link")
    names = {
        "l_wrist": "l_wrist",
        "r_elbow": "r_elbow",
        "l_knee": "l_knee",
        "r_ankle": "r_ankle",
        "l_shoulder": "l_shoulder",
    }
    frames, _, plan = frame_plan(track.joint_names, body.limb_tree)
    places = frame_places(plan, skeleton(track, body).heads, track.joints)
    for row in (0, 45, 89):
        for frame, joint in names.items():
            place = places[row, frames.index(frame)]
            assert np.abs(place - track.joints[row, track.joint_names.index(joint)]).max() < 1e-9, frame


def test_a_bvh_of_a_steady_body_has_one_set_of_offsets(tmp_path, recorded):
    track, body = recorded
    write_bvh(tmp_path / "changing.bvh", track, body)
    assert (tmp_path / "changing.bvh").read_text().count("CHANNELS 6") > 5
    write_bvh(tmp_path / "still.bvh", track.of_frames(np.array([40])), body)
    assert (tmp_path / "still.bvh").read_text().count("CHANNELS 6") == 1


@pytest.mark.parametrize("name", ["a\tb", "a\nb", "a{b", "a}b", "a\u2028b", "\x00"])
def test_names_that_break_files_are_refused(name):
    text = voodoo.Body.human().to_toml()
    for word in ("pelvis", "l_shoulder"):
        with pytest.raises(BodyError, match="a name without tabs, line breaks and braces"):
            voodoo.Body.from_toml(text.replace(f'"{word}"', json.dumps(name)))


def test_names_with_spaces_are_one_word_in_bvh(tmp_path, recorded):
    track, body = recorded
    names = {"l_forearm": "left fore arm \u00e4"}
    text = body.to_toml()
    for old, new in names.items():
        text = text.replace(f'"{old}"', f'"{new}"')
    renamed = replace(track, limb_names=tuple(names.get(limb, limb) for limb in track.limb_names), limb_status={})
    write_bvh(tmp_path / "pose.bvh", renamed, voodoo.Body.from_toml(text))
    assert "left_fore_arm__" in read_bvh(tmp_path / "pose.bvh")[0]
