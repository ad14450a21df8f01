import copy
import pickle
import subprocess
import sys
import threading
import time
import warnings
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

import voodoo
from scene import rest_pose, standing_joints, surface
from voodoo import BodyError, ConfigError, MeasurementError, VoodooError


@pytest.fixture(scope="module")
def body():
    return voodoo.Body.human(height=1.75, model="papers")


@pytest.fixture(scope="module")
def cloud(body):
    return surface(body, rest_pose(body), 1500)


@pytest.fixture
def tracker(body):
    tracker = voodoo.Tracker(body)
    tracker.reset_pose(rest_pose(body))
    return tracker


def frame_of(points, stamp=0.0, **options):
    frame = voodoo.Frame(stamp=stamp)
    frame.add_points(points, **options)
    return frame


METERS = np.full((48, 64), 2.5, dtype=np.float32)
MILLIMETERS = np.full((48, 64), 2500, dtype=np.uint16)


def warned_of(*images):
    """What `add_depth` warns of in two frames with each of some (source, image, options)."""
    camera = voodoo.Camera(64, 48, 50.0, 50.0, 32.0, 24.0)
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("default")
        for stamp in (0.0, 0.1):
            frame = voodoo.Frame(stamp=stamp)
            for source, image, options in images:
                frame.add_depth(image, camera=camera, source=source, **options)
    return [(each.category, str(each.message).split(":")[0], each.filename) for each in found]


def test_depth_of_a_wrong_unit_warns_once_for_each_sensor():
    wrong = [
        ("floats", MILLIMETERS.astype(np.float32), {"meters_per_unit": 1.0}),
        ("integers", MILLIMETERS, {"meters_per_unit": 1.0}),
        ("without a unit", METERS, {}),
    ]
    assert warned_of(*wrong) == [(voodoo.UnitWarning, source, __file__) for source, _, _ in wrong]
    near, far = METERS / 50.0, METERS * 30.0
    right = [
        ("a", METERS, {"meters_per_unit": 1.0}),
        ("b", MILLIMETERS, {}),
        ("c", METERS * 0.0, {"meters_per_unit": 1.0}),
    ]
    beside = [("near", near, {"meters_per_unit": 1.0}), ("far", far, {"meters_per_unit": 1.0})]
    assert warned_of(*right, *beside) == []


def test_an_estimate_has_every_name_and_shape(tracker, body, cloud):
    estimate = tracker.step(frame_of(cloud, stamp=2.5, source="lidar"))
    assert estimate.stamp == 2.5 and estimate.status == "tracking" and 1 <= estimate.steps <= 100
    assert tuple(estimate.joints) == estimate.joint_names == body.site_names
    assert tuple(estimate.world_from_limb) == estimate.limb_names == body.limb_names
    assert {"l_wrist", "r_ankle", "vc7", "head_center"} <= set(estimate.joint_names)
    assert estimate.joint_positions.shape == (len(body.site_names), 3) and estimate.joint_positions.dtype == np.float64
    assert estimate.limb_poses.shape == (len(body.limbs), 4, 4)
    np.testing.assert_array_equal(estimate.joint_positions[3], estimate.joints[estimate.joint_names[3]])
    np.testing.assert_array_equal(estimate.limb_poses[1], estimate.world_from_limb["head"])
    rotations = estimate.limb_poses[:, :3, :3]
    np.testing.assert_allclose(rotations @ rotations.transpose(0, 2, 1), np.eye(3)[None].repeat(10, 0), atol=1e-12)
    assert estimate.residual == pytest.approx(np.sqrt(estimate.mean_squared_distance)) and estimate.residual < 0.02
    assert sum(estimate.limb_points.values()) > 1000 and set(estimate.limb_residual) == set(body.limb_names)
    assert len(estimate.joint_gaps) == 9 and max(estimate.joint_gaps.values()) < 0.05
    count, inliers, residual = estimate.sources["lidar"]
    assert count == len(cloud) >= inliers > 1000 and 0.0 < residual < 0.02


def test_an_estimate_cannot_be_changed(tracker, cloud):
    estimate = tracker.step(frame_of(cloud))
    with pytest.raises(AttributeError):
        estimate.status = "lost"
    with pytest.raises(TypeError):
        estimate.joints["l_wrist"] = np.zeros(3)
    for array in (estimate.joints["l_wrist"], estimate.joint_positions, estimate.limb_poses):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0
    before = estimate.joint_positions.copy()
    tracker.step(frame_of(cloud + np.array([0.05, 0.0, 0.0]), stamp=1.0))
    np.testing.assert_array_equal(estimate.joint_positions, before)
    assert "tracking" in repr(estimate) and "steps=" in repr(estimate)


def test_one_and_two_threads_give_the_same_bits(body, cloud):
    results = []
    for threads in (1, 2):
        tracker = voodoo.Tracker(body, config=voodoo.Config(threads=threads))
        tracker.reset_pose(rest_pose(body))
        results.append([tracker.step(frame_of(cloud + 0.01 * k, stamp=k)).joint_positions for k in range(3)])
    np.testing.assert_array_equal(*results)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_points_of_either_precision_and_any_layout_are_taken(body, cloud, dtype):
    points = cloud.astype(dtype)
    spread = np.zeros((len(points), 6), dtype=dtype)[:, ::2]
    spread[:] = points
    # As np.ndarray(..., message.data, offset=1) gives it.
    odd = np.ndarray(points.shape, dtype, bytearray(points.nbytes + 1), offset=1)
    odd[:] = points
    assert not odd.flags.aligned
    results = []
    for array in (points, spread, np.asfortranarray(points), odd):
        tracker = voodoo.Tracker(body)
        tracker.reset_pose(rest_pose(body))
        results.append(tracker.step(frame_of(array)).joint_positions)
    np.testing.assert_array_equal(results[0], results[1])
    np.testing.assert_array_equal(results[0], results[2])
    np.testing.assert_array_equal(results[0], results[3])


def test_contiguous_arrays_are_not_copied(body):
    points = np.zeros((200_000, 3))
    frame = voodoo.Frame(stamp=0.0)
    references = sys.getrefcount(points)
    frame.add_points(points)
    assert sys.getrefcount(points) == references + 1, "the frame holds the array itself"
    # What is written before the step is what the step reads.
    points[:] = np.nan
    tracker = voodoo.Tracker(body)
    tracker.reset_pose(rest_pose(body))
    with pytest.raises(MeasurementError, match="finite meters"):
        tracker.step(frame)


def test_step_releases_the_gil(body):
    points = np.ascontiguousarray(np.random.default_rng(0).uniform(-0.5, 0.5, (400_000, 3)))
    config = voodoo.Config(max_steps=30, min_change=0.0, max_limb_points=1_000_000)
    tracker = voodoo.Tracker(body, config=config)
    tracker.reset_pose(rest_pose(body))
    frame = frame_of(points)
    ticks: list[float] = []
    stop = threading.Event()

    def tick():
        while not stop.wait(0.001):
            ticks.append(time.perf_counter())

    thread = threading.Thread(target=tick)
    thread.start()
    start = time.perf_counter()
    tracker.step(frame)
    end = time.perf_counter()
    stop.set()
    thread.join()
    inside = sum(start + 0.1 * (end - start) < moment < end - 0.1 * (end - start) for moment in ticks)
    assert end - start > 0.02, "too short to tell"
    assert inside >= 3, f"the other thread ran {inside} times in {end - start:.3f} s"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"points": np.zeros((5, 2))}, ["points", "(N, 3)", "[5, 2]"]),
        ({"points": np.zeros(3)}, ["points", "(N, 3)"]),
        ({"points": np.zeros((5, 3), dtype=np.int32)}, ["points", "float32 or float64", "int32"]),
        ({"points": [[0.0, 0.0, 0.0]]}, ["points", "list"]),
        ({"points": np.zeros((1, 3)), "world_from_sensor": np.eye(3)}, ["world_from_sensor", "rigid 4x4"]),
        ({"points": np.zeros((1, 3)), "world_from_sensor": 2.0 * np.eye(4)}, ["world_from_sensor"]),
        ({"points": np.zeros((1, 3)), "world_from_sensor": np.diag([1.0, 1.0, -1.0, 1.0])}, ["world_from_sensor"]),
        ({"points": np.zeros((1, 3)), "world_from_sensor": np.full((4, 4), np.nan)}, ["world_from_sensor"]),
    ],
)
def test_arrays_that_cannot_be_meant_are_refused_by_name(arguments, words):
    with pytest.raises(MeasurementError) as caught:
        voodoo.Frame(stamp=0.0).add_points(**arguments)
    assert all(word in str(caught.value) for word in words), caught.value


def test_masked_arrays_are_refused_with_what_to_do():
    """What is masked would count as measured; nothing masked today may be something tomorrow."""
    camera = voodoo.Camera(4, 3, 100.0, 100.0, 1.5, 1.0)
    frame = voodoo.Frame(stamp=0.0)
    image = np.ma.masked_less(np.full((3, 4), 900, dtype=np.uint16), 1000)
    points = np.ma.masked_array(np.zeros((5, 3)), mask=[[False] * 3] * 4 + [[True] * 3])
    for masked in (image, np.ma.masked_array(image.data)):
        with pytest.raises(MeasurementError, match=r"image: expected an array without a mask.*image\.filled\(0\)"):
            frame.add_depth(masked, camera=camera)
    with pytest.raises(MeasurementError, match=r"points: expected an array without a mask.*leave the masked rows out"):
        frame.add_points(points)
    frame.add_depth(image.filled(0), camera=camera)
    frame.add_points(points.data[~np.ma.getmaskarray(points).any(axis=1)])


def test_images_that_cannot_be_meant_are_refused_by_name():
    camera = voodoo.Camera(4, 3, 100.0, 100.0, 1.5, 1.0)
    frame = voodoo.Frame(stamp=0.0)
    for image in (np.zeros((3, 4), dtype=np.float64), np.zeros((3, 4, 1), dtype=np.uint16), "image", None):
        with pytest.raises(MeasurementError, match=r"image: expected .*\(height, width\).*uint16 or float32"):
            frame.add_depth(image, camera=camera)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            lambda frame: frame.add_points(np.full((4, 3), np.inf)),
            ["points[0].points", "finite meters", "[inf, inf, inf] in row 0"],
        ),
        (lambda frame: frame.add_points(np.zeros((4, 3)), weight=0.0), ["points[0].weight", "above zero"]),
        (lambda frame: frame.add_points(np.zeros((4, 3)), limb="tail"), ["tail", "l_forearm"]),
        (lambda frame: frame.add_position("nose", (0, 0, 0)), ["nose", "l_wrist"]),
        (lambda frame: frame.add_position("l_wrist", (0, 0, 0), weight=-1.0), ["positions[0].weight"]),
        (lambda frame: frame.add_position("l_wrist", (0, np.nan, 0)), ["positions[0].position"]),
        (
            lambda frame: frame.add_ray("l_wrist", origin=(0, 0, 0), direction=(0, 0, 0)),
            ["rays[0].direction", "not zero"],
        ),
        (
            lambda frame: frame.set_ground(normal=(0, 0, 2)),
            ["ground", "unit normal", "found normal [0.0, 0.0, 2.0] and offset 0"],
        ),
    ],
)
def test_a_refused_frame_names_what_is_wrong_and_leaves_no_trace(body, cloud, change, words):
    observed, spared = voodoo.Tracker(body), voodoo.Tracker(body)
    for tracker in (observed, spared):
        tracker.reset_pose(rest_pose(body))
        tracker.step(frame_of(cloud))
    bad = voodoo.Frame(stamp=1.0)
    change(bad)
    with pytest.raises(VoodooError) as caught:
        observed.step(bad)
    assert all(word in str(caught.value) for word in words), caught.value
    assert dict(observed.estimate.sources) == dict(spared.estimate.sources)
    after = [tracker.step(frame_of(cloud + 0.01, stamp=1.0)).joint_positions for tracker in (observed, spared)]
    np.testing.assert_array_equal(*after)


def test_time_goes_forward_only(tracker, cloud):
    tracker.step(frame_of(cloud, stamp=5.0))
    for stamp in (5.0, 4.0, np.nan, np.inf):
        with pytest.raises(MeasurementError, match="stamp"):
            tracker.step(frame_of(cloud, stamp=stamp))
    assert tracker.step(frame_of(cloud, stamp=5.1)).stamp == 5.1


def test_a_reset_needs_positions_that_fix_the_pose(body):
    tracker = voodoo.Tracker(body)
    with pytest.raises(MeasurementError, match="three positions"):
        tracker.reset(joints={"l_wrist": (0, 0, 0)})
    with pytest.raises(BodyError, match="nose"):
        tracker.reset(joints={"nose": (0, 0, 0)})
    for bad in ((0, 0), (0, 0, np.nan), "abc", None):
        with pytest.raises(BodyError, match=r"joints\[l_wrist\]"):
            tracker.reset(joints={"l_wrist": bad})
    with pytest.raises(BodyError, match="world_from_limb"):
        tracker.reset_pose({"torso": np.eye(4)})
    with pytest.raises(BodyError, match="world_from_limb: expected a mapping of limbs to poses, found NoneType"):
        tracker.reset_pose(None)
    for bad in (2.0 * np.eye(4), np.eye(3), "upright"):
        with pytest.raises(MeasurementError, match=r"world_from_limb\[l_calf\]: expected a rigid 4x4 transform"):
            tracker.reset_pose(rest_pose(body) | {"l_calf": bad})


def test_a_reset_in_millimeters_is_refused(body):
    """It made a body of 1750 m, status tracking."""
    tracker = voodoo.Tracker(body)
    expected = standing_joints(body)
    for factor in (1000.0, 100.0, 0.001):
        with pytest.raises(MeasurementError, match=rf"joints: expected meters, .* found {factor:.4f} times"):
            tracker.reset(joints={name: factor * position for name, position in expected.items()})
    child = tracker.reset(joints={name: 0.4 * position for name, position in expected.items()})
    assert child.joints["l_wrist"] == pytest.approx(0.4 * expected["l_wrist"], abs=1e-6)


def test_before_a_reset_nothing_is_known_and_a_step_searches(body):
    tracker = voodoo.Tracker(body)
    assert np.isnan(tracker.estimate.stamp)
    for estimate in (tracker.estimate, tracker.step(voodoo.Frame(stamp=0.5))):
        assert estimate.status == "searching" and np.isnan(estimate.residual)
        assert not estimate.joints and not estimate.world_from_limb
    assert tracker.estimate.stamp == 0.5


def test_a_body_that_is_no_person_needs_a_reset():
    """Nothing knows how it looks."""
    lamp = voodoo.Body.load(Path(__file__).resolve().parent.parent / "examples" / "bodies" / "lamp.toml")
    tracker = voodoo.Tracker(lamp)
    with pytest.raises(MeasurementError, match="call reset first"):
        tracker.step(voodoo.Frame(stamp=0.0))
    assert tracker.estimate.status == "searching"


def test_a_tracker_is_not_copied(tracker):
    """A shallow copy had the same core: stepping one moved the other."""
    for copied in (copy.copy, copy.deepcopy):
        with pytest.raises(TypeError, match="cannot"):
            copied(tracker)


def pickled(thing):
    return pickle.loads(pickle.dumps(thing))


COPIES = pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, pickled])


@COPIES
def test_a_copy_of_a_body_has_the_same_bits(body, cloud, copied):
    tracker = voodoo.Tracker(body)
    tracker.reset(joints=standing_joints(voodoo.Body.human(height=1.83, model="papers")))
    tracker.add_limb(
        "stick",
        parent="r_forearm",
        shape=voodoo.TaperedEllipticCylinder(0.3, 0.02, 0.02, 0.01, 0.0),
        joint=voodoo.Joint(name="grip", on_parent=voodoo.Place(position=(0.0, 0.01, 0.2), rotation=(0.3, -0.7, 1.1))),
    )
    known = tracker.body
    again = copied(known)
    assert type(again) is voodoo.Body and again == known and again.limbs == known.limbs
    assert again.site_names == known.site_names and copied(known.limbs[1]) == known.limbs[1]
    found = []
    for each in (known, again):
        tracker = voodoo.Tracker(each)
        tracker.reset_pose(rest_pose(each))
        found.append([tracker.step(frame_of(cloud + 0.01 * index, stamp=index)).limb_poses for index in range(3)])
    np.testing.assert_array_equal(*found)


@COPIES
def test_a_copy_of_a_shape_has_the_same_bits(copied):
    shape = voodoo.TaperedEllipticCylinder(0.1 + 0.2, 1 / 3, 0.0, 1e-3, 2e-5)
    assert type(copied(shape)) is voodoo.TaperedEllipticCylinder and copied(shape) == shape


@COPIES
def test_a_copy_of_an_estimate_has_the_same_bits(tracker, cloud, copied):
    unknown = voodoo.Tracker(tracker.body).estimate
    reset = tracker.estimate
    frame = frame_of(cloud, stamp=0.1)
    frame.add_ray("l_wrist", origin=(0, 0, 0), direction=(1, 2, 3), source="ray")
    for estimate in (unknown, reset, tracker.step(frame)):
        again = copied(estimate)
        assert type(again) is voodoo.Estimate and repr(again) == repr(estimate)
        for name in (name for name in dir(estimate) if not name.startswith("_")):
            was, now = (getattr(each, name) for each in (estimate, again))
            if isinstance(was, Mapping):
                assert list(was) == list(now), name
                was, now = list(was.values()), list(now.values())
            np.testing.assert_array_equal(was, now, err_msg=name)
        with pytest.raises(ValueError, match="read-only"):
            again.joint_positions[:] = 0.0


def test_a_reset_reproduces_positions_and_sizes(body):
    tall = voodoo.Body.human(height=1.9, model="papers")
    expected = {name: position + np.array([3.0, -1.0, 0.5]) for name, position in standing_joints(tall).items()}
    tracker = voodoo.Tracker(body)
    estimate = tracker.reset(joints=expected)
    for name, position in expected.items():
        np.testing.assert_allclose(estimate.joints[name], position, atol=1e-6, err_msg=name)
    for limb, other in zip(tracker.body.limbs, tall.limbs, strict=True):
        assert limb.shape.length == pytest.approx(other.shape.length, abs=1e-6), limb.name
    assert np.isnan(estimate.stamp) and body == voodoo.Body.human(height=1.75, model="papers"), (
        "the given body is not changed"
    )


def test_the_body_changes_between_frames(tracker, cloud):
    tracker.step(frame_of(cloud))
    tracker.scale(1.02)
    forearm = tracker.body.limbs[tracker.body.limb_names.index("l_forearm")].shape
    longer = voodoo.TaperedEllipticCylinder(forearm.length * 1.1, forearm.a0, forearm.b0, forearm.a1, forearm.b1)
    tracker.set_shape("l_forearm", longer)
    held = voodoo.TaperedEllipticCylinder(0.3, 0.1, 0.1, 0.1, 0.1)
    joint = voodoo.Joint(name="grip", on_parent=voodoo.Place(position=(0, 0, longer.length)), semi_axes=(0.05, 0.05))
    tracker.add_limb("box", parent="l_forearm", shape=held, joint=joint, sites={"box_end": (0, 0, 0.3)})
    assert tracker.step(frame_of(cloud, stamp=1.0)).joints["box_end"].shape == (3,)
    with pytest.raises(BodyError, match="box"):
        tracker.add_limb("box", parent="l_forearm", shape=held, joint=joint)
    tracker.remove_limb("box")
    estimate = tracker.step(frame_of(cloud, stamp=2.0))
    assert "box_end" not in estimate.joints and estimate.status == "tracking"
    for change in (
        lambda: tracker.remove_limb("torso"),
        lambda: tracker.scale(-1.0),
        lambda: tracker.set_shape("x", held),
    ):
        with pytest.raises(BodyError):
            change()


def test_points_that_are_not_finite_are_named_by_their_row(tracker):
    points = np.array([[0.0, 0.0, 0.0], [1.0, np.nan, 2.0]])
    words = r"points: expected finite meters, found \[1.0, NaN, 2.0\] in row 1$"
    for call in (
        tracker.distance,
        tracker.limb_distances,
        voodoo.TaperedEllipticCylinder(1, 1, 1, 1, 1).closest_points,
    ):
        with pytest.raises(MeasurementError, match=words):
            call(points)


def test_distance_is_signed(tracker, cloud):
    assert np.abs(tracker.distance(cloud)).mean() < 0.01
    torso = tracker.estimate.world_from_limb["torso"]
    inside, outside = torso[:3, 3] + 0.2 * torso[:3, 2], torso[:3, 3] + [5.0, 0.0, 0.0]
    around = np.random.default_rng(2).normal(np.mean(cloud, axis=0), 0.6, (2000, 3))
    np.testing.assert_array_equal(tracker.distance(around), tracker.limb_distances(around).min(axis=0))
    assert (tracker.distance(around) < -0.02).sum() > 20
    distances = tracker.distance(np.stack([inside, outside]))
    assert distances[0] < -0.05 and distances[1] == pytest.approx(5.0, abs=0.5)


def test_the_shape_answers_with_points_normals_and_faces():
    shape = voodoo.TaperedEllipticCylinder(0.3, 0.05, 0.04, 0.03, 0.03)
    found = shape.closest_points(np.array([[0.2, 0.0, 0.1], [0.0, 0.0, 0.4], [0.0, 0.01, 0.15]]))
    assert [shape.REGIONS[number] for number in found.region][:2] == ["side", "distal_cap"]
    assert found.signed_distance[1] == pytest.approx(0.1) and found.signed_distance[2] < 0.0
    point, normal, distance = shape.closest_point((0.2, 0.0, 0.1))
    np.testing.assert_allclose(found.points[0], point, atol=1e-6)
    np.testing.assert_allclose(found.normals[0], normal, atol=1e-5)
    assert distance == pytest.approx(float(found.signed_distance[0]), abs=1e-6)
    with pytest.raises(MeasurementError, match="row 1"):
        shape.closest_points(np.array([[0.0, 0.0, 0.0], [np.nan, 0.0, 0.0]]))
    with pytest.raises(BodyError, match="a0"):
        voodoo.TaperedEllipticCylinder(0.3, -0.05, 0.04, 0.03, 0.03)


def test_a_configuration_is_frozen_checked_and_explained():
    config = voodoo.Config(max_steps=3)
    with pytest.raises(ValueError, match="frozen"):
        config.max_steps = 4
    for values in ({"max_steps": 0}, {"max_steps": 2.5}, {"max_distance": float("nan")}, {"overlap": "sometimes"}):
        with pytest.raises(ConfigError, match=next(iter(values))):
            voodoo.Config(**values)
    with pytest.raises(ConfigError, match=r"color.*known are .*max_steps"):
        voodoo.Config(color="red")
    text = config.to_toml()
    assert voodoo.Config.from_toml(text) == config and "\n# " in text
    with pytest.raises(ConfigError, match="syntax"):
        voodoo.Config.from_toml("max_steps =")
    with pytest.raises(ConfigError, match="readable"):
        voodoo.Config.load("/no/such/file.toml")


def test_every_error_is_a_voodoo_error_and_a_value_error():
    for error in (BodyError, ConfigError, MeasurementError, voodoo.RecordingError, voodoo.CameraError):
        assert issubclass(error, VoodooError) and issubclass(error, ValueError)


def test_the_package_is_imported_quietly():
    run = subprocess.run([sys.executable, "-c", "import voodoo"], capture_output=True, text=True, check=True)
    assert run.stdout == run.stderr == ""


def test_an_estimate_without_a_pose_says_so(tracker, body, cloud):
    searching = voodoo.Tracker(body).estimate
    assert not searching.joints and dict(searching.joints) == {} and searching.joints.get("l_wrist") is None
    of_names = [name for name in dir(searching) if isinstance(getattr(searching, name), Mapping) and name != "sources"]
    assert len(of_names) == 13
    for name in of_names:
        with pytest.raises(
            VoodooError, match=r"^'l_wrist': expected an estimate with a pose, found .*status 'searching'"
        ):
            getattr(searching, name)["l_wrist"]
        with pytest.raises(KeyError):
            getattr(pickle.loads(pickle.dumps(searching)), name)["l_wrist"]
    posed = tracker.step(frame_of(cloud))
    with pytest.raises(KeyError, match=r"^'wrist'$"):
        posed.joints["wrist"]
