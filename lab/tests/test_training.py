"""A toy of the detector's training: pictures with exact truth, a small network that learns, weights that come back."""

import sys

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="the extra `training` is not installed")
pytest.importorskip("numba", reason="the extra `training` is not installed")

from lab.training import anybody, crops, data, evaluate, export, train, unseen  # noqa: E402
from lab.training.bodies import JOINTS, Bodies  # noqa: E402
from lab.training.loader import SWAP, Store, augment  # noqa: E402
from lab.training.poses import load, standing  # noqa: E402
from lab.training.scenes import Scenes  # noqa: E402

import voodoo  # noqa: E402


@pytest.fixture(scope="module")
def scenes(voodoo_data):
    if not (voodoo_data / "bodies").is_dir() or not (voodoo_data / "mocap").is_dir():
        pytest.skip(f"no bodies and mocap in {voodoo_data}")
    return Scenes(Bodies(voodoo_data / "bodies", held_out=True), load(voodoo_data / "mocap", True))


@pytest.fixture(scope="module")
def store(scenes, tmp_path_factory):
    folder, rng = tmp_path_factory.mktemp("pictures"), np.random.default_rng(3)
    batch = []
    while len(batch) < 130:
        batch += crops.samples(scenes.frame(rng), rng)
    data.save(folder / "train_toy.npz", batch)
    return Store(folder, "train")


def test_files_made_by_other_options_are_not_taken_for_these(tmp_path):
    path, options = tmp_path / "train_1.json", {"pictures a process": 10, "others": 0.5, "groups": ["child"]}
    data.agree(path, options)
    data.agree(path, options)
    with pytest.raises(SystemExit, match=r"found .*'others': 0\.5"):
        data.agree(path, options | {"others": 0.0})


def test_pictures_show_people_as_often_as_scenes_do(store):
    assert 0.45 < len(store.people) / (len(store.people) + len(store.others)) < 0.85


def test_a_mirrored_pose_has_mirrored_joints(scenes):
    pose, body = standing(np.random.default_rng(1)), scenes.bodies[0]
    a, b = (body.posed(p, np.random.default_rng(2), dressed=False)[1] for p in (pose, pose.mirrored()))
    a, b = (np.stack([j[n] for n in JOINTS]) for j in (a, b))
    hands = [JOINTS.index("l_hand"), JOINTS.index("r_hand")]  # turned by chance
    error = np.delete(np.abs(a[SWAP] * [1, -1, 1] - b), hands, axis=0)
    assert error.max() < 0.02 and np.abs(a[3:, 1]).max() > 0.1


@pytest.mark.parametrize("change", [anybody.child, anybody.heavy])
def test_the_lengths_of_a_changed_body_are_the_distances_of_its_posed_joints(scenes, change):
    rng, adult = np.random.default_rng(6), scenes.bodies[1]
    body = change(rng, adult)
    joints = body.posed(standing(rng), rng, dressed=False)[1]
    pairs = [
        (f"l_{a}", f"l_{b}") for a, b in (("shoulder", "elbow"), ("elbow", "wrist"), ("hip", "knee"), ("knee", "ankle"))
    ]
    distances = [np.linalg.norm(joints[a] - joints[b]) for a, b in [*pairs, ("l_hip", "r_hip"), ("vc7", "head_center")]]
    np.testing.assert_allclose(distances[:5], body.lengths[[0, 1, 2, 3, 5]], atol=1e-9)
    assert body.vertices[:, 2].min() == pytest.approx(0, abs=1e-9)
    if change is anybody.child:
        legs, head = (lambda b: (b.lengths[2] + b.lengths[3]) / b.stature), (lambda b: b.lengths[7] / b.stature)
        assert 0.8 <= body.stature <= 1.5 and legs(body) < legs(adult) and head(body) > head(adult)
    else:
        assert body.stature == pytest.approx(adult.stature)
        wide = [np.ptp(b.vertices[b.set.region["trunk"] > 0.7], axis=0)[0] for b in (body, adult)]
        assert wide[0] > wide[1] + 0.03


@pytest.mark.parametrize("group", anybody.GROUPS)
def test_every_group_gives_pictures_of_people(scenes, group):
    rng, people = np.random.default_rng(8), []
    for _ in range(20):
        people += [s for s in crops.samples(scenes.frame(rng, group), rng) if s.person]
        if people:
            break
    assert people and all(anybody.GROUPS[s.group] == group and np.isfinite(s.joints).all() for s in people)


def test_people_stand_where_their_joints_are(scenes):
    rng, near = np.random.default_rng(4), []
    while len(near) < 12:
        frame = scenes.frame(rng)
        fx, fy, cx, cy = frame.intrinsics
        for person in frame.people:
            trunk = person.joints[JOINTS.index("humanoid_root")]
            u, v = round(fx * trunk[0] / trunk[2] + cx), round(fy * trunk[1] / trunk[2] + cy)
            if person.observed.all() and frame.labels[v, u] == person.label:
                near.append(trunk[2] - frame.depth[v, u])
    assert 0.03 < np.median(near) < 0.25  # the pelvis' middle lies behind the surface
    again = scenes.frame(np.random.default_rng(4))
    np.testing.assert_array_equal(again.depth, scenes.frame(np.random.default_rng(4)).depth)


def test_places_in_the_picture_come_back(store):
    middle = store.columns["middle"].numpy().astype(float)
    points = np.random.default_rng(0).normal([0, 0, 3.0], 0.4, (len(middle), 17, 3))
    places = np.stack([crops.place(p, m, 0.0) for p, m in zip(points, middle, strict=True)])
    np.testing.assert_allclose(crops.lifted(places, middle), points, atol=1e-6)


def test_a_joint_without_a_truth_is_no_hidden_one():
    """Errors of 1 m where the weight is 0, of 0.1 m where it is that of a hidden joint."""
    weight = np.ones((2, 17))
    weight[0, 9], weight[0, 10] = 0.4, 0.0
    joints = np.zeros((2, 17, 3))
    true = {"person": np.ones(2), "weight": weight, "joints": joints, "middle": np.tile([0.0, 0.0, 3.0], (2, 1)),
            "facing": np.ones(2), "lengths": np.ones((2, 9))}  # fmt: skip
    off = joints.copy()
    off[0, 9, 2], off[0, 10, 2] = 0.1, 1.0
    reported = {"joints": off, "facing": np.ones(2), "person": np.ones(2), "length": np.zeros((2, 9)),
                "length_scale": np.zeros((2, 9)), "scale": np.zeros((2, 17))}  # fmt: skip
    found = evaluate.measure(reported, true)
    assert found["hidden_cm"] == pytest.approx(10.0) and found["mean_cm"] == 0.0
    assert found["hidden_within_scale"]["mean"] == pytest.approx(0.1 / 3)


def test_a_toy_learns_and_its_weights_come_back(store, tmp_path):
    torch.manual_seed(0)
    torch.set_num_threads(1)
    training = train.Training.new(0, 3e-3, small=True)
    rng = np.random.default_rng(0)
    parts = [training.update(augment(store.draw(rng, 24, 8)), 3e-3)[0] for _ in range(50)]
    first, last = (np.mean([p["cm"] for p in some]) for some in (parts[:5], parts[-5:]))
    assert last < 0.8 * first, f"{first:.0f} cm, then {last:.0f} cm"
    export.write(tmp_path / "toy.weights", export.tensors(training.net.eval()))
    again = export.restored(export.read(tmp_path / "toy.weights"))
    begun = train.Training.new(0, 1e-3, weights=tmp_path / "toy.weights")
    begun.update(augment(store.draw(rng, 24, 8)), 1e-3)
    assert float(begun.net.s2.conv.norm.running_mean.abs().max()) == 0.0  # folded norms stay as they are
    x = store.batch(store.people[:4])["x"]
    with torch.no_grad():
        a, b = training.net(x), again(x)
    assert (a.joints - b.joints).abs().max() < 0.01
    for name in ("visible", "facing", "person", "scale", "length"):
        assert (getattr(a, name) - getattr(b, name)).abs().max() < 0.05, name


@pytest.mark.parametrize("group", [[], ["--group", "wheelchair"], ["--group", "clothes"]], ids=" ".join)
def test_a_recording_that_nothing_was_tuned_on_has_its_joints_inside_what_the_camera_sees(
    voodoo_data, tmp_path, monkeypatch, group
):
    command = ["unseen", str(tmp_path), "--data", str(voodoo_data), "--count", "1", "--seed", "3", *group]
    monkeypatch.setattr(sys, "argv", command)
    unseen.main()
    recording = voodoo.open_recording(next((tmp_path / "look").iterdir()))
    reference, inside = recording.reference, []
    assert reference is not None and reference.exact and len(reference.stamps) == len(recording) >= 60
    for frame in recording:
        image = frame.measurements[0]
        pose, camera = np.asarray(image.root_from_sensor), image.camera
        truth = reference.positions[np.argmin(np.abs(reference.stamps - frame.stamp))]
        at = (truth[reference.names.index("humanoid_root")] - pose[:3, 3]) @ pose[:3, :3]
        u, v = round(camera.fx * at[0] / at[2] + camera.cx), round(camera.fy * at[1] / at[2] + camera.cy)
        if 0 <= u < camera.width and 0 <= v < camera.height and image.image[v, u]:
            inside.append(at[2] - image.image[v, u] * image.meters_per_unit)
    assert len(inside) > 30 and -0.1 < np.median(inside) < 1.5  # hidden by furniture at most
