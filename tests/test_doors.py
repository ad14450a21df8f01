"""Formats of other programs, opened by their own readers; the same pose through all of them."""

import base64
import io
import json
import struct
import zipfile
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from scipy.spatial.transform import Rotation

import voodoo
from browser import needs_chromium, told_by
from test_exports import read_bvh, with_gaps
from voodoo.export.conventions import NAMES, names_of
from voodoo.export.files import save
from voodoo.export.layout import rows_of
from voodoo.export.people import PeopleTrack
from voodoo.export.skeleton import bones, skeleton
from voodoo.export.track import Track
from voodoo.recordings.marker_trajectories import read_c3d

FRAMES = 12


def moving(body, *, seed=3, frames=FRAMES, spread=0.5):
    """Rotations by limb (F, 3, 3) relative to the parent, and places of the root, of a body that moves smoothly."""
    parts, random = bones(body), np.random.default_rng(seed)
    swing = random.uniform(-spread, spread, (2, len(parts), 3))
    phase = np.linspace(0.0, 3.0, frames)
    local = {}
    for index, bone in enumerate(parts):
        wave = np.sin(phase)[:, None] * swing[0, index] + np.cos(phase)[:, None] * swing[1, index]
        local[bone.name] = Rotation.from_rotvec(wave).as_matrix()
    spin = Rotation.from_euler("z", 3.0 * phase[:, None]).as_matrix()  # through the half turn
    local[parts[0].name] = spin @ local[parts[0].name]
    return local, np.column_stack([phase, -phase, 1.0 + 0.1 * phase])


def track_of(body, local=None, root=((0.0, 0.0, 1.0),), **how):
    """A track of exactly these rotations by limb (F, 3, 3) relative to the parent; by default it moves."""
    parts = bones(body)
    if local is None:
        local, root = moving(body, **how)
    turns, heads = (np.stack(list(one.values()), axis=1) for one in placed(body, local, np.array(root)))
    limbs = np.tile(np.eye(4), (*heads.shape[:2], 1, 1))
    for index, bone in enumerate(parts):
        limbs[:, index, :3, :3] = turns[:, index] @ bone.rest
        limbs[:, index, :3, 3] = heads[:, index] - limbs[:, index, :3, :3] @ bone.head_in_limb
    names = body.limb_names
    sites = {name: limbs[:, names.index(limb)] @ [*place, 1.0] for name, limb, place in body.core.parts()[2]}
    frames = len(heads)
    return Track(
        stamps=1.7e9 + np.arange(frames) / 30.0,
        status=("tracking",) * frames,
        residual=np.zeros(frames),
        joint_names=tuple(sites),
        joints=np.stack([place[:, :3] for place in sites.values()], axis=1),
        limb_names=names,
        world_from_limb=limbs,
    )


@pytest.fixture(scope="module", params=["measured", "papers"])
def person(request):
    body = voodoo.Body.human(1.8, model=request.param)
    return track_of(body), body


def heads_of(track, body):
    posed = skeleton(track, body)
    return {bone.name: posed.heads[:, index] for index, bone in enumerate(posed.bones)}


def placed(body, local, root):
    """World rotations and heads by bone from rotations (F, 3, 3) relative to the parent, in the standing frame."""
    parts, turns, heads = bones(body), [], []
    for bone in parts:
        above = None if bone.parent is None else turns[bone.parent]
        turns.append(local[bone.name] if above is None else above @ local[bone.name])
        step = bone.head - parts[bone.parent].head if above is not None else None
        heads.append(root if above is None else heads[bone.parent] + above @ step)
    names = [bone.name for bone in parts]
    return dict(zip(names, turns, strict=True)), dict(zip(names, heads, strict=True))


def mot_columns(path: Path):
    header, _, table = path.read_text().partition("endheader\n")
    names, *rows = [line.split("\t") for line in table.splitlines()]
    assert f"nRows={len(rows)}\n" in header and f"nColumns={len(names)}\n" in header and "inDegrees=yes" in header
    return dict(zip(names, np.array(rows, float).T, strict=True))


RIGHT_OF = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])  # X forward, Y up, Z right from x forward, y left, z up


def read_mot(path: Path, body, *, turns=None):
    columns, local = mot_columns(path), {} if turns is None else turns
    for limb in body.limb_names:
        angles = []
        for axis, name in enumerate(names_of(limb).angles):
            sign = (-1 if name.startswith("-") else 1) * (-1 if limb.startswith("l_") and axis else 1)
            angles.append(sign * columns[name.removeprefix("-")])
        turn = Rotation.from_euler("ZXY", np.column_stack(angles), degrees=True).as_matrix()
        local[limb] = RIGHT_OF.T @ turn @ RIGHT_OF
    root = np.column_stack([columns[f"pelvis_t{axis}"] for axis in "xyz"]) @ RIGHT_OF
    return placed(body, local, root)[1]


def read_glb(path: Path, frame: int, person: str = "pose", *, turns=None):
    """Heads of bones at a frame and the vertices of a skinned mesh there, z up, by pygltflib's reading."""
    gltflib = pytest.importorskip("pygltflib", reason="pip install pygltflib, of the extra test")
    scene = gltflib.GLTF2().load(str(path))
    kinds = {5126: "<f4", 5125: "<u4", 5121: "u1"}

    def array(index):
        accessor = scene.accessors[index]
        view = scene.bufferViews[accessor.bufferView]
        values = np.frombuffer(scene.binary_blob(), kinds[accessor.componentType], offset=view.byteOffset)
        wide = {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "MAT4": 16}[accessor.type]
        return values[: accessor.count * wide].reshape(accessor.count, wide)

    moved = {}
    for channel in scene.animations[0].channels:
        sampler = scene.animations[0].samplers[channel.sampler]
        assert len(array(sampler.input)) == len(array(sampler.output))
        moved[channel.target.node, channel.target.path] = array(sampler.output)[frame]
    world, names = {}, {}

    def walk(number, above):
        node, pose = scene.nodes[number], np.eye(4)
        pose[:3, :3] = Rotation.from_quat(moved.get((number, "rotation"), [0, 0, 0, 1])).as_matrix()
        pose[:3, :3] *= moved.get((number, "scale"), np.ones(3))
        pose[:3, 3] = moved.get((number, "translation"), node.translation or [0, 0, 0])
        world[number] = above @ pose
        names[node.name] = number
        if turns is not None:
            turns.setdefault(node.name, []).append(pose[:3, :3])
        for child in node.children or ():
            walk(child, world[number])

    (root,) = [number for number in scene.scenes[0].nodes if scene.nodes[number].name == person]
    walk(root, np.eye(4))
    shown = next(node for node in scene.nodes if node.name == f"{person}_mesh")
    skin, mesh = scene.skins[shown.skin], scene.meshes[shown.mesh].primitives[0]
    inverse = array(skin.inverseBindMatrices).reshape(-1, 4, 4).transpose(0, 2, 1)
    bound = np.array([world[joint] for joint in skin.joints]) @ inverse
    points = np.column_stack([array(mesh.attributes.POSITION), np.ones(len(array(mesh.attributes.POSITION)))])
    vertices = np.einsum("nij,nj->ni", bound[array(mesh.attributes.JOINTS_0)[:, 0]], points)[:, :3]
    heads = {name: world[number][:3, 3][[2, 0, 1]] for name, number in names.items() if number in skin.joints}
    return heads, vertices[:, [2, 0, 1]]


@pytest.mark.filterwarnings("ignore:No analog data")
def test_every_format_puts_the_joints_in_the_same_place(tmp_path, person):
    track, body = person
    for suffix in ("bvh", "mot", "sto", "glb", "c3d"):
        save(track, tmp_path / f"pose.{suffix}", body=body, root_frame="odom")
    expected = heads_of(track, body)
    bvh, _ = read_bvh(tmp_path / "pose.bvh")
    mot = read_mot(tmp_path / "pose.mot", body)
    c3d = read_c3d(tmp_path / "pose.c3d")
    table = (tmp_path / "pose.sto").read_text().partition("endheader\n")[2].splitlines()
    cells = np.array([[one.split(",") for one in line.split("\t")[1:]] for line in table[1:]], float)
    turns = {}
    for index, column in enumerate(table[0].split("\t")[1:]):
        turn = Rotation.from_quat(cells[:, index][:, [1, 2, 3, 0]]).as_matrix()
        turns[column.removesuffix("_imu")] = RIGHT_OF.T @ turn @ RIGHT_OF
    parts = bones(body)
    local = {
        bone.name: turns[names_of(bone.name).opensim]
        if bone.parent is None
        else turns[names_of(parts[bone.parent].name).opensim].transpose(0, 2, 1) @ turns[names_of(bone.name).opensim]
        for bone in parts
    }
    _, sto = placed(body, local, expected[parts[0].name])
    for bone in parts:
        here = expected[bone.name]
        assert np.abs(bvh[bone.name][:, [2, 0, 1]] / 100.0 - here).max() < 2e-3
        assert np.abs(mot[bone.name] - here).max() < 1e-4, bone.name
        assert np.abs(sto[bone.name] - here).max() < 1e-4, bone.name
        if bone.joint in c3d.names:
            assert np.abs(c3d.positions[:, c3d.names.index(bone.joint)] - here).max() < 1e-4
    for frame in (0, 5, FRAMES - 1):
        heads, _ = read_glb(tmp_path / "pose.glb", frame)
        for bone in parts:
            assert np.abs(heads[bone.name] - expected[bone.name][frame]).max() < 1e-4, bone.name
    # JointState has the angles of human_description; those of shoulder and hip are the whole rotation.
    posed = skeleton(track, body)
    layout, rows = rows_of(track, body)
    angle = dict(zip(layout.angles, layout.parts(rows)[4].T, strict=True))
    index = {bone.name: number for number, bone in enumerate(posed.bones)}
    for side, s in (("l", 1.0), ("r", -1.0)):
        thigh, calf = index[f"{side}_thigh"], index[f"{side}_calf"]
        yaw, pitch, roll = (angle[f"{side}_{axis}_hip"] for axis in "ypr")
        turn = Rotation.from_euler("ZXY", np.column_stack([-yaw, s * pitch, -roll])).as_matrix()
        across = parts[calf].head - parts[thigh].head
        knee = expected[f"{side}_thigh"] + posed.rotations[:, 0] @ turn @ across
        assert np.abs(knee - expected[f"{side}_calf"]).max() < 1e-4


def human_angles(local, parents):
    """The angles of human_description, by SciPy, from rotations (F, 3, 3) of limbs relative to their parents."""

    def between(limb, above):
        turn = np.eye(3)
        while limb != above:
            turn, limb = local[limb] @ turn, parents[limb]
        return Rotation.from_matrix(turn)

    def twist(turn):
        return 2.0 * np.arctan2(turn.as_quat()[:, 1], turn.as_quat()[:, 3])

    root = next(limb for limb, above in parents.items() if above is None)
    trunk = "thorax" if "thorax" in local else root
    roll, yaw, pitch = between("head", trunk).as_euler("XZY").T
    found = {"r_head": roll, "y_head": yaw, "p_head": -pitch}
    for side, s in (("l", 1.0), ("r", -1.0)):
        a, b, c = between(f"{side}_thigh", root).as_euler("ZXY").T
        found |= {f"{side}_y_hip": -a, f"{side}_p_hip": s * b, f"{side}_r_hip": -c}
        found[f"{side}_elbow"] = -twist(between(f"{side}_forearm", f"{side}_upperarm"))
        found[f"{side}_knee"] = -twist(between(f"{side}_calf", f"{side}_thigh"))
        found[f"{side}_shoulder"] = between(f"{side}_upperarm", trunk)
    return found


def test_every_format_has_the_same_joint_angles(tmp_path, person):
    track, body = person
    for name in ("pose.bvh", "pose.mot", "pose.glb", "bag"):
        save(track, tmp_path / name, body=body, root_frame="odom")
    parts = bones(body)
    parents = {bone.name: None if bone.parent is None else parts[bone.parent].name for bone in parts}
    z_up = np.eye(3)[[2, 0, 1]]  # from X left, Y up, Z forward
    read = {"bvh": {}, "mot": {}, "glb": {}}
    read_bvh(tmp_path / "pose.bvh", turns=read["bvh"])
    read_mot(tmp_path / "pose.mot", body, turns=read["mot"])
    for frame in range(FRAMES):
        read_glb(tmp_path / "pose.glb", frame, turns=read["glb"])
    for name in ("bvh", "glb"):
        read[name] = {limb: z_up @ np.array(read[name][limb]) @ z_up.T for limb in body.limb_names}
    truth = dict(zip(body.limb_names, skeleton(track, body).local().swapaxes(0, 1), strict=True))
    for name, local in read.items():
        for limb in body.limb_names:
            apart = Rotation.from_matrix(truth[limb].transpose(0, 2, 1) @ local[limb]).magnitude()
            assert np.degrees(apart).max() < 0.002, (name, limb)
    with AnyReader([tmp_path / "bag"]) as reader:
        told = [
            dict(zip(message.name, message.position, strict=True))
            for connection, _, raw in reader.messages()
            if connection.topic.endswith("joint_states")
            for message in [reader.deserialize(raw, connection.msgtype)]
        ]
    states = {name.removesuffix("_p1"): np.array([one[name] for one in told]) for name in told[0]}
    for name, local in read.items():
        for joint, values in human_angles(local, parents).items():
            if joint.endswith("shoulder"):  # R = Rz(-s y) Rx(s p) Rz(s r) has two solutions: compare the rotation
                s = 1.0 if joint[0] == "l" else -1.0
                y, p, r = (states[f"{joint[0]}_{axis}_shoulder"] for axis in "ypr")
                turn = Rotation.from_euler("ZXZ", np.column_stack([-s * y, s * p, s * r]))
                apart = (turn.inv() * values).magnitude()
            else:
                apart = (values - states[joint] + np.pi) % (2.0 * np.pi) - np.pi
            assert np.degrees(np.abs(apart)).max() < 0.005, (name, joint)


def test_yourdfpy_moves_the_description_by_the_joint_states(tmp_path, person):
    """Where elbows and knees only bend, as the joints of the description do, its links are where /tf has them."""
    yourdfpy = pytest.importorskip("yourdfpy", reason="pip install yourdfpy, of the extra test")
    _, body = person
    local, root = moving(body, spread=0.4)
    for limb, sign in (("forearm", -1.0), ("calf", 1.0)):
        for side in "lr":
            bend = 0.8 + 0.5 * np.sin(np.arange(FRAMES) + (side == "l"))
            local[f"{side}_{limb}"] = Rotation.from_euler("y", sign * bend[:, None]).as_matrix()
    bent = {"forearm", "upperarm", "thigh", "calf", "head"}
    for limb in body.limb_names[1:]:
        if limb.split("_")[-1] not in bent:
            local[limb] = np.tile(np.eye(3), (FRAMES, 1, 1))
    save(track_of(body, local, root), tmp_path / "bag", body=body, root_frame="odom")
    with AnyReader([tmp_path / "bag"]) as reader:
        told = [(one.topic, reader.deserialize(raw, one.msgtype)) for one, _, raw in reader.messages()]
    (text,) = (message.data for topic, message in told if topic == "/human_description_p1")
    (tmp_path / "human.urdf").write_text(text)
    robot = yourdfpy.URDF.load(tmp_path / "human.urdf")
    states = [message for topic, message in told if topic.endswith("/joint_states")]
    transforms = [message.transforms for topic, message in told if topic == "/tf"]
    assert len(states) == len(transforms) == FRAMES and robot.base_link == "body_p1"
    assert set(robot.actuated_joint_names) == set(states[0].name)
    for state, moved in zip(states, transforms, strict=True):
        robot.update_cfg(dict(zip(state.name, state.position, strict=True)))
        places = {"body_p1": np.eye(4)}
        for one in moved:
            if one.child_frame_id not in places:
                place, turn = one.transform.translation, one.transform.rotation
                pose = np.eye(4)
                pose[:3, :3] = Rotation.from_quat([turn.x, turn.y, turn.z, turn.w]).as_matrix()
                pose[:3, 3] = place.x, place.y, place.z
                places[one.child_frame_id] = places[one.header.frame_id] @ pose
        assert len(places) > 10
        for name, pose in places.items():
            np.testing.assert_allclose(robot.get_transform(name, "body_p1"), pose, atol=1e-3, err_msg=name)


def test_glb_opens_in_trimesh_and_its_skin_follows_the_limbs(tmp_path, person):
    trimesh = pytest.importorskip("trimesh", reason="pip install trimesh, of the extra test")
    track, body = person
    save(track, tmp_path / "pose.glb", body=body, root_frame="odom")
    scene = trimesh.load(tmp_path / "pose.glb")
    (mesh,) = scene.geometry.values()
    assert mesh.volume == pytest.approx(sum(limb_volume(limb) for limb in body.limbs), rel=0.02)
    assert 1.6 < np.ptp(mesh.vertices, axis=0)[1] < 2.0  # at rest, Y up
    for frame in (0, FRAMES - 1):
        assert_on_limbs(read_glb(tmp_path / "pose.glb", frame)[1], track, body, frame)


PLAYER = """<script>%(library)s</script><script>
const stage = new THREE.Scene(), camera = new THREE.PerspectiveCamera(40, 1, 0.1, 50), light = new THREE.DirectionalLight();
const drawn = new THREE.WebGLRenderer({preserveDrawingBuffer: true}), corner = new THREE.Vector3();
drawn.setSize(400, 400);
stage.add(light);
new THREE.GLTFLoader().load("data:text/plain;base64,%(file)s", (file) => {
  stage.add(file.scene);
  const player = new THREE.AnimationMixer(file.scene), skin = file.scene.getObjectByProperty("type", "SkinnedMesh");
  const action = player.clipAction(file.animations[0]).setLoop(THREE.LoopOnce).play();
  action.clampWhenFinished = true;
  const vertices = %(stamps)s.map((time) => {
    player.setTime(time);
    stage.updateMatrixWorld(true);
    const points = skin.geometry.attributes.position;
    return Array.from({length: points.count}, (_, index) =>
      skin.localToWorld(skin.boneTransform(index, corner.fromBufferAttribute(points, index))).toArray());
  });
  const center = vertices[vertices.length - 1].reduce((sum, one) => sum.map((value, axis) => value + one[axis]), [0, 0, 0]);
  const middle = new THREE.Vector3(...center).divideScalar(vertices[0].length);
  camera.position.copy(middle).add(new THREE.Vector3(1, 0.5, 3));
  camera.lookAt(middle);
  light.position.copy(camera.position).sub(middle);
  skin.frustumCulled = false;
  drawn.render(stage, camera);
  fetch("/", {method: "POST", body: JSON.stringify({vertices, picture: drawn.domElement.toDataURL()})});
});
</script>"""


@needs_chromium
def test_three_js_plays_a_glb_in_chromium(tmp_path, person):
    resources = pytest.importorskip("trimesh.resources", reason="pip install trimesh, of the extra test")
    track, body = person
    save(track, tmp_path / "pose.glb", body=body, root_frame="odom")
    with zipfile.ZipFile(io.BytesIO(resources.get_bytes("templates/viewer.zip"))) as packed:
        viewer = packed.read("viewer.html.template").decode()  # holds three.js and its reader of glTF
    library = viewer[viewer.index("<script>") + len("<script>") : viewer.rindex("var camera,controls")]
    file, frames = base64.b64encode((tmp_path / "pose.glb").read_bytes()).decode(), (0, FRAMES // 2, FRAMES - 1)
    stamps = [float(track.stamps[frame] - track.stamps[0]) for frame in frames]
    played, console = told_by(PLAYER % {"library": library, "file": file, "stamps": stamps}, tmp_path)
    assert console == []
    for frame, vertices in zip(frames, np.array(played["vertices"]), strict=True):
        assert_on_limbs(vertices[:, [2, 0, 1]], track, body, frame)
    picture = base64.b64decode(played["picture"].partition(",")[2])
    (tmp_path / "played.png").write_bytes(picture)
    shown = cv2.imdecode(np.frombuffer(picture, dtype=np.uint8), cv2.IMREAD_GRAYSCALE) > 0
    assert 0.03 < shown.mean() < 0.6


def assert_on_limbs(vertices, track, body, frame):
    """Vertices of a mesh, z up, lie on the limbs, the same number on each."""
    count = len(vertices) // len(body.limbs)
    for number, limb in enumerate(body.limbs):
        pose = track.world_from_limb[frame, number]
        own = (vertices[number * count : (number + 1) * count] - pose[:3, 3]) @ pose[:3, :3]
        distance = limb.shape.closest_points(np.ascontiguousarray(own)).signed_distance
        assert np.abs(distance).max() < 1e-3, limb.name


def limb_volume(limb):
    shape, places = limb.shape, np.linspace(0.0, 1.0, 201)
    a, b = (np.interp(places, [0, 1], ends) for ends in ((shape.a0, shape.a1), (shape.b0, shape.b1)))
    return np.trapezoid(np.pi * a * b, places) * shape.length


def test_glb_shows_each_person_while_it_is_there(tmp_path):
    body = voodoo.Body.human()
    first, second = track_of(body), track_of(body, seed=8)
    late = second.of_frames(np.arange(4, 9))
    people = PeopleTrack(first.stamps, {1: first, 2: late})
    save(people, tmp_path / "all.glb", body={1: body, 2: body}, root_frame="odom")
    content = (tmp_path / "all.glb").read_bytes()
    (length,) = struct.unpack_from("<I", content, 12)
    scene = json.loads(content[20 : 20 + length])
    shown = {"all_1", "all_1_mesh", "all_2", "all_2_mesh"}
    assert {scene["nodes"][number]["name"] for number in scene["scenes"][0]["nodes"]} == shown
    heads, _ = read_glb(tmp_path / "all.glb", 0, "all_2")
    # Frame 0 of the scale is at time zero, before the person comes; the skeleton has no size there.
    assert np.ptp(np.array(list(heads.values())), axis=0).max() == 0.0
    heads, _ = read_glb(tmp_path / "all.glb", 2, "all_2")
    assert np.abs(heads["head"] - heads_of(late, body)["head"][2]).max() < 1e-4
    save(PeopleTrack(first.stamps, {}), tmp_path / "none.glb", body={}, root_frame="odom")
    trimesh = pytest.importorskip("trimesh", reason="pip install trimesh, of the extra test")
    assert not trimesh.load(tmp_path / "none.glb").geometry


@pytest.mark.filterwarnings("ignore:No analog data")
def test_c3d_read_by_ezc3d(tmp_path, person):
    ezc3d = pytest.importorskip("ezc3d", reason="pip install ezc3d, of the extra test")
    track, body = person
    track = replace(with_gaps(track), joint_names=("left wrist", *track.joint_names[1:]))
    save(track, tmp_path / "pose.c3d", body=body, root_frame="odom")
    content = ezc3d.c3d(str(tmp_path / "pose.c3d"))
    about = content["parameters"]["POINT"]
    assert about["RATE"]["value"][0] == pytest.approx(30.0, abs=1e-4) and about["UNITS"]["value"] == ["mm"]
    assert about["LABELS"]["value"] == ["left_wrist", *track.joint_names[1:]]
    points = content["data"]["points"][:3].transpose(2, 1, 0) / 1000.0
    np.testing.assert_allclose(points, track.joints, atol=1e-4)  # NaN where nobody was found
    assert read_c3d(tmp_path / "pose.c3d").up == "+Z"


def test_sites_that_a_c3d_cannot_hold_are_refused(tmp_path, person):
    names = tuple(f"site_{number}" for number in range(256))
    track = Track(
        np.arange(2.0), ("tracking",) * 2, np.zeros(2), names, np.zeros((2, 256, 3)), (), np.empty((2, 0, 4, 4))
    )
    with pytest.raises(voodoo.VoodooError, match=r"pose\.c3d: expected joints and sites .* found 256"):
        save(track, tmp_path / "pose.c3d", body=person[1], root_frame="odom")
    assert not list(tmp_path.iterdir())


def test_equal_motions_of_both_sides_have_equal_angles_with_the_signs_of_opensim(tmp_path):
    body = voodoo.Body.human()
    parts = bones(body)
    turned = {  # by rotation vector in the standing frame: x forward, y left, z up
        "thigh": ((0, -0.7, 0), "hip_flexion"), "calf": ((0, 0.9, 0), "knee_angle"), "foot": ((0, -0.2, 0), "ankle_angle"),
        "forearm": ((0, -1.1, 0), "elbow_flex"), "upperarm": ((0, -0.4, 0), "arm_flex"),
    }  # fmt: skip
    vectors = [turned.get(name[2:] if name[1] == "_" else "", ((0, 0, 0), ""))[0] for name in body.limb_names]
    local = {name: Rotation.from_rotvec([one]).as_matrix() for name, one in zip(body.limb_names, vectors, strict=True)}
    save(track_of(body, local), tmp_path / "pose.mot", body=body, root_frame="odom")
    columns = mot_columns(tmp_path / "pose.mot")
    for vector, name in turned.values():
        for side in "lr":
            assert columns[f"{name}_{side}"][0] == pytest.approx(np.degrees(np.linalg.norm(vector)), abs=1e-3), name
    assert len(columns) == len({name.lower() for name in columns}) == 1 + 3 * len(parts) + 3
    assert set(NAMES) >= set(body.limb_names)
